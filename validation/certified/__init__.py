# SPDX-License-Identifier: BSD-3-Clause
"""Twelve small scenes of fog whose airlight is known to 12 digits, for any renderer.

Read in this order:

- `model.py`: what such a scene consists of, and how Mitsuba reads it;
- `scenes.py`: the twelve scenes;
- `intervals.py`: lit intervals in 40 digits;
- `generate.py`: certifies the radiance of every ray and writes the file;
- `area_lights.py`: certified rows for points of lights with extent and for spheres.

May import: `analytic`.
"""
