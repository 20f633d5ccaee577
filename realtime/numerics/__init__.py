# SPDX-License-Identifier: BSD-3-Clause
"""Arithmetic that other rooms are made of: types of one precision, fast functions.

Read in this order:

- `array_types.py`: the Dr.Jit types of one precision, arrays from NumPy, and the way back;
- `diamond_angle.py`: an azimuth without trigonometry;
- `fast_exp.py`: exponentials for bounded arguments;
- `gauss_legendre.py`: nodes and weights as constants of recorded kernels;
- `recorded.py`: functions that Dr.Jit records once and replays.
"""
