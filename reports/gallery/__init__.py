# SPDX-License-Identifier: BSD-3-Clause
"""The pictures of README and documentation: scenes, what methods see, their errors, how they work.

`airlight gallery` makes them anew in `docs/gallery/`, with a list of what each shows and was made of. A test compares
that list with this room and with the accuracy baselines, so that no picture is older than what it speaks of.

Read in this order:

- `recipes.py`: which pictures there are, and by which command
- `sketches.py`: how each method works, drawn in a scene that is seen from the side
- `make.py`: the files and their list

May import: `analytic.errors`, `realtime.frame`, `realtime.methods`, `realtime.methods.shadow_planes`, `realtime.scene`,
`reference.storage`, `reports.data`, `reports.docs`, `reports.machine`, `reports.plotting`, `validation.configurations`,
`validation.estimates`, `validation.metrics`, `validation.scenes`.
"""
