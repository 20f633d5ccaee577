# SPDX-License-Identifier: BSD-3-Clause
"""The side under test: real-time single scattering in Dr.Jit, float32 and float64 from one source.

`realtime.scene.read_scene` reads a Mitsuba scene and lists its features; `realtime.kernels` evaluate the airlight
integral between two distances along a ray; `realtime.methods` turn a view into the layers of every pixel;
`realtime.frame.renderer` makes a frame of them. Mitsuba only reads the scene and casts rays. Nothing here imports the
side of truth.

Read in this order:

- `errors.py`: the exception for what a user gave wrong.
- `memory.py`: what needs more memory than the machine has is refused before it is taken.
- `parameters.py`: typed parameters, each with its default, range and help in one place.

May import: `realtime.errors`.
"""
