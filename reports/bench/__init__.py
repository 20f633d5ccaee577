# SPDX-License-Identifier: BSD-3-Clause
"""What `airlight bench` prints: a file for each of its questions.

Read in this order:

- `methods.py`: methods timed in scenes and compared with the truth
- `decompose.py`: the error of every method by its causes
- `kernels.py`: kernels alone, and what their derivatives cost
- `estimators.py`: Monte Carlo estimators at equal error
- `octaves.py`: the constants of cloud-octaves that fit best
- `scaling.py`: what methods cost as their work grows
- `interpolation.py`: how many rays an image needs between tiles, and along epipolar lines
- `diagnosis.py`: planted faults and what a diagnosis answers

May import: `analytic`, `realtime.errors`, `realtime.kernels`, `realtime.scene`, `reference.storage`, `reports.data`,
`reports.figures`, `reports.machine`, `reports.tables`, `validation.configurations`, `validation.diagnosis`,
`validation.estimates`, `validation.frames`, `validation.kernels`, `validation.metrics`,
`validation.scaling`, `validation.scenes`.
"""
