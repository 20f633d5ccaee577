# SPDX-License-Identifier: BSD-3-Clause
"""The airlight equation in float64 and in as many digits as wanted: part of the side of truth.

Names and units are those of DESIGN section 2: lengths in metres, extinction in 1/m, J in 1/m.

Read in this order:

- `errors.py`: the exception for mistakes of the user;
- `phase.py`: phase functions with a mean of 1 over the sphere;
- `geometry.py`: foot and height of a ray over a light, without cancellation;
- `integral.py`: the airlight integral of one segment in three forms, by adaptive quadrature;
- `kronrod.py`: the nodes and weights of the Gauss-Kronrod pair;
- `panels.py`: the airlight integral of millions of segments, each with an error estimate;
- `certified.py`: the airlight integral in mpmath, by two quadratures that must agree;
- `series.py`: the power series behind the polynomial of Biri 2006;
- `case_columns.py`: cases from arrays;
- `cases.py`: cases from CSV files.

May import: nothing of ours.
"""
