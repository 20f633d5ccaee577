# SPDX-License-Identifier: BSD-3-Clause
"""The commands, one module each: a function with its options, which imports what it needs when it runs.

Read in this order:

- `start.py`: the entry of the command, signals first
- `main.py`: the command line: the commands, and how mistakes are reported
- `help.py`: how `--help` is drawn
- `completion.py`: what the shell completes
- `options.py`: options that several commands have
- `own_methods.py`: methods of the user's own
- `bench.py`: `airlight bench`
- `cache.py`: `airlight cache`
- `compare.py`: `airlight compare`
- `describe.py`: `airlight describe`
- `diff.py`: `airlight diff`
- `doctor.py`: `airlight doctor`
- `figures.py`: `airlight figures`
- `fit.py`: `airlight fit`
- `integrate.py`: `airlight integrate`
- `lists.py`: `airlight list`
- `maps.py`: `airlight maps`
- `merge.py`: `airlight merge`
- `paper.py`: `airlight paper`
- `reference.py`: `airlight reference`
- `render.py`: `airlight render`
- `report.py`: `airlight report`
- `slab.py`: `airlight slab`
- `clouds.py`: `airlight clouds`
- `stability.py`: `airlight stability`
- `sweep.py`: `airlight sweep`
- `test.py`: `airlight test`
- `view.py`: `airlight view`
"""
