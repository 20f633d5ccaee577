# SPDX-License-Identifier: BSD-3-Clause
"""Builds the documentation, and keeps what it takes from elsewhere.

Read in this order:

- `build.py`: runs Sphinx
- `marked.py`: the part of a page that a program makes
- `data.py`: numbers and pictures of a report, and whether they are stale
- `fidelity.py`: the page of verdicts on papers
- `diagnosis.py`: the table of planted faults
- `full_run.py`: the last full run of all tests
- `live_view.py`: the picture of the live view
- `thousand_scenes.py`: the digest of the sweep over a thousand scenes
- `round_trips.py`: faults planted in Blender's Cycles, and what the diagnosis said
- `release.py`: one number, a source distribution, a wheel
- `verification.py`: the page of claims and of the tests that protect them

May import: `analytic`, `realtime.scene`, `reference.scene`, `reference.storage`, `reports.data`, `reports.interchange`,
`reports.machine`, `reports.papers`, `reports.sweep`, `reports.tables`, `validation.configurations`,
`validation.diagnosis`, `validation.fidelity`, `validation.frames`, `validation.properties`, `validation.scenes`.
"""
