# SPDX-License-Identifier: BSD-3-Clause
"""Which method for a scene: errors and costs predicted from its properties, fitted to the rows of a sweep.

A configuration (a method with its kernel and parameters) has two linear regressions, of the logarithms of its error and
of its cost, over logarithms of properties. How far they are off is known from scenes that they were not fitted to, and
goes into every prediction: a choice holds an error with a stated share.

Read in this order:

- `features.py`: properties of a scene to the numbers of a regression;
- `regression.py`: one regression, with its errors on scenes that it has not seen;
- `model.py`: the regressions of all configurations, and the file that keeps them;
- `choose.py`: what every configuration will cost and err by, and the one to take;
- `auto.py`: the method `auto`: the configuration that the advice names;
- `judge.py`: how good the choices are in scenes that were held out;
- `rows.py`: the rows of a sweep, from its Parquet;
- `fit.py`: a model from rows: `python -m validation.advise.fit ROWS.parquet`.

May import: `analytic.errors`, `realtime.errors`, `realtime.scene`, `reference.storage`, `validation.configurations`,
`validation.properties`.
"""
