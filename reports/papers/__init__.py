# SPDX-License-Identifier: BSD-3-Clause
"""The tables and figures of four papers, measured here beside what was printed.

Each module makes plain data of what was measured, as they stand in report.json, and tables of these data.

Read in this order:

- `rates.py`: frames a second of a row beside the published ones
- `biri.py`: Tables 1 and 2 of Biri, Arques, Michelin 2006
- `billeter.py`: Figures 6 and 7 and Table 1 of Billeter, Sintorn, Assarsson 2010
- `ali.py`: Fig. 5.8 of Ali 2016 and what goes with it
- `bouthors.py`: what a slab decides of Bouthors 2008
- `fidelity.py`: a verdict for every claim of the papers
"""
