# SPDX-License-Identifier: BSD-3-Clause
"""The command line, made of the public functions of `airlight`.

Read in this order:

- `start.py`: the entry of the command, signals first
- `main.py`: each function as a command, what it prints, and how mistakes are reported
- `list.py`: `airlight list`
- `test.py`: `airlight test`
"""
