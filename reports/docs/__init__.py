# SPDX-License-Identifier: BSD-3-Clause
"""Builds the documentation, and keeps what it takes from elsewhere.

Read in this order:

- `build.py`: runs Sphinx
- `data.py`: numbers and pictures of a report, and whether they are stale
- `full_run.py`: the last full run of all tests
- `verification.py`: the page of claims and of the tests that protect them

May import: `analytic`, `reference.storage`, `reports.data`, `reports.machine`, `validation.configurations`,
`validation.frames`, `validation.scenes`.
"""
