# SPDX-License-Identifier: BSD-3-Clause
"""Which parameters of the fog explain an image: a robust least-squares fit with intervals, and what no fit can tell.

Read in this order:

- `unknowns.py`: the parameters by name, and the fog as a function of them;
- `image_model.py`: the pixels of an image that take part, and what the fog makes of them;
- `noise.py`: how far single pixels may be off, from what a fit leaves;
- `least_squares.py`: Levenberg and Marquardt's method with these weights, and the covariance;
- `intervals.py`: the ends of intervals where an image is not linear in what is looked for;
- `confounding.py`: which parameters an image does not tell apart;
- `fit.py`: an image file against a scene;
- `fit_text.py`: what `airlight compare --fit` prints.
"""
