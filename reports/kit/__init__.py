# SPDX-License-Identifier: BSD-3-Clause
"""The conformance kit: certified rays and scenes for a test in another language or renderer.

Read in this order:

- `rows.py`: which certified rays are in it, with their tolerances
- `languages.py`: the rays in C, Rust, JavaScript, GLSL and JSON
- `scenes.py`: the certified scenes as data
- `mitsuba.py`: a scene as Mitsuba XML
- `godot.py`: a scene for Godot
- `write.py`: the folder of the kit
"""
