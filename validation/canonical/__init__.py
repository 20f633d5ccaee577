# SPDX-License-Identifier: BSD-3-Clause
"""The tables of the canonical transport, as frames look them up, against the computation that they are made of.

Read in this order:

- `errors.py`: errors of a look-up at random points, by set of orders;
- `record.py`: size, time and errors by name, as the command prints them.
"""
