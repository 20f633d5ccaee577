# SPDX-License-Identifier: BSD-3-Clause
"""Shaders as methods: GLSL of a user's, run by OpenGL in a separate process.

Mesa's drivers bring their own libLLVM, which must not meet the one of Dr.Jit: the host imports
NumPy and moderngl, is handed the scene as arrays, and answers with images. It draws without a
window, by EGL.

Read in this order:

- `source.py`: the file of a user: its pragmas, what it includes, and where the
  driver's messages point.
- `prelude.py`: the text before it: rays, lights, medium, shadow maps; and
  the `main` of every stage.
- `host.py`: the process that draws.
- `client.py`: starts it and asks it.
- `scene_arrays.py`: what a shader is given of a view, as arrays.
- `method.py`: the shader as a method, like any other to its callers.
"""
