# SPDX-License-Identifier: BSD-3-Clause
"""The airlight equation in float64 and in any number of digits: the side of the reference.

DESIGN section 2 defines names and units: lengths in metres, extinction in 1/m, J in 1/m.

Read in this order:

- `clock.py`: the one stopwatch;
- `mie.py`: how a sphere scatters light;
- `droplets.py`: the droplets of clouds and fog, their extinction and phase
  functions, full and modified;
- `phase.py`: phase functions of mean 1 over the sphere;
- `geometry.py`: foot and height of a ray over a light, and the changes of variables x, theta, q, w;
- `kronrod.py`: nodes and weights of the Gauss-Kronrod pair;
- `panels.py`: the airlight integral of millions of segments, in NumPy, each
  with its error estimate;
- `height_fog.py`: media whose density depends on height alone: optical depths, suns in
  closed form, lights at places;
- `series.py`: the power series behind the polynomial of Biri 2006.
"""
