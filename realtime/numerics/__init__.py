# SPDX-License-Identifier: BSD-3-Clause
"""Arithmetic that other rooms are made of: types of one precision, fast functions.

Read in this order:

- `array_types.py`: the Dr.Jit types of one precision, arrays from NumPy, and the way back;
- `noise.py`: random numbers of a frame;
- `functions.py`: an azimuth without trigonometry, exponentials for bounded
  arguments, Gauss-Legendre nodes;
- `recorded.py`: functions that Dr.Jit records once and replays, and tables that they read.
"""
