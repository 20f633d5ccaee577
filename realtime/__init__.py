# SPDX-License-Identifier: BSD-3-Clause
"""The side under test: real-time single scattering in Dr.Jit, float32 and float64 from one source.

`realtime.scene.read_scene` reads a Mitsuba scene and lists its features; `realtime.kernels` evaluate the
airlight integral between two distances along a ray; `realtime.methods` turn a view into the in-scattered radiance of
every pixel; `realtime.frame.renderer` makes a frame of it. Mitsuba only reads the scene and casts rays. Nothing here
imports the side of truth.
"""
