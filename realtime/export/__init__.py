# SPDX-License-Identifier: BSD-3-Clause
"""Airlight kernels as shader code, to paste into an engine.

Read in this order:

- `text.py`: the kernels as one template, filled with the constants of the Python kernels;
- `languages.py`: the template in GLSL, HLSL, Slang and WGSL.
"""
