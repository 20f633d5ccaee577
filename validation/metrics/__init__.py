# SPDX-License-Identifier: BSD-3-Clause
"""How far one image is from another: each formula with its origin.

Read in this order:

- `errors.py`: bias, RMSE and quantiles of relative errors;
- `other_tools.py`: the errors that other tools print, by their own formulas;
- `colour.py`: CIEDE2000 and Delta E ITP;
- `flip.py`: HDR-FLIP, by its authors' code in a separate process.
"""
