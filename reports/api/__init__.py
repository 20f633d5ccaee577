# SPDX-License-Identifier: BSD-3-Clause
"""The public functions, which are the commands too, and their results.

Read in this order:

- `inputs.py`: what the functions take, and the one exception
- `scenes.py`: scenes as results
- `results.py`: images as results
- `comparisons.py`: comparisons, diagnoses and fits as results
- `render.py`: `load_scene`, `render`; `frames.py`: the work of it;
- `configurations.py`: the methods that a user names, checked
- `reference.py`: `reference`; `rays.py`: `rays`, the camera rays of a scene
- `compare.py`: `compare`, with `--diagnose` and `--fit`
- `check.py`: `check`, relations between frames
- `report.py`: `report`; `engines.py`: that on engines of others; `command.py`: what makes either again
- `diff.py`: `diff` of two reports; `paper.py`: `paper`
- `sweep.py`: `sweep`
- `challenge.py`: `challenge_new`, `challenge_score`, `challenge_board`
- `explore.py`: `describe`, `view`
- `capture.py`: `capture`, a scene in an engine of others
- `export.py`: `export`, a kernel as shader code, and the conformance kit
"""
