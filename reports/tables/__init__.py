# SPDX-License-Identifier: BSD-3-Clause
"""Tables: each is written once, as data with units, and drawn as terminal text,
Markdown, HTML, LaTeX or CSV.

A function of this room takes records, those of report.json where they stand there, and returns a
`Table`. Who prints, writes a page or a paper chooses how it is drawn.

Read in this order:

- `table.py`: the record, its values, and how a number becomes digits
- `drawing.py`: the five ways to draw it
- `record.py`: what every result of a public function knows: tables, words,
  data; JSON on the terminal
- `methods.py`: what methods cost and how wrong they are; the fastest within an error; which
  are a paper as published
- `papers.py`: verdicts on the claims of papers, and their numbers beside ours
- `agreement.py`: the reference against Monte Carlo, the verdict, and the table of trust
- `costs.py`: what kernels cost, where they break, what methods cost as their work grows
"""
