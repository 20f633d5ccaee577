# SPDX-License-Identifier: BSD-3-Clause
"""Which parameters of the fog explain an image: a robust least-squares fit with intervals,
and what no fit can tell.

Read in this order:

- `unknowns.py`: the parameters by name, as faults of a guess that set a number;
- `solve.py`: robust least squares with the weights that the noise asks for, and intervals;
- `confounding.py`: which parameters an image does not tell apart;
- `fit.py`: an image file against a scene.
"""
