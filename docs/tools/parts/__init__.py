# SPDX-License-Identifier: BSD-3-Clause
"""The parts of pages that are made from the program and its records; `fill_pages.py`
writes them into the pages.

Read in this order:

- `listed`: the commands, methods, parameters and kernels of the program, and the keys of a report
- `api`: the functions and classes of `import airlight`, by topic
- `measured`: tables of the report and of the records in `docs/data`
- `challenge`: built-in methods that were scored in the challenge
- `shown`: files of the project, and pictures of the gallery
- `paper`: the figures of the paper, and its record in numbers
- `tested`: the claims with their tests, and the last run of all tests
"""
