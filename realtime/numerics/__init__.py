# SPDX-License-Identifier: BSD-3-Clause
"""Arithmetic that other rooms are made of: types of one precision, fast functions.

Read in this order:

- `array_types.py`: the Dr.Jit types of one precision, so that one source runs in float32 and float64;
- `aligned.py`: arrays from NumPy, aligned as Dr.Jit's own;
- `host_numbers.py`: the way back, for a few numbers of a scene;
- `diamond_angle.py`: an azimuth without trigonometry;
- `fast_exp.py`: exponentials for bounded arguments;
- `gauss_legendre.py`: nodes and weights as constants of recorded kernels;
- `recorded.py`: functions that Dr.Jit records once and replays.
"""
