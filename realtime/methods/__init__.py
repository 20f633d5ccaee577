# SPDX-License-Identifier: BSD-3-Clause
"""The methods under test, each a class with its parameters, and a user's own.

A method answers one question: which radiance do the lit media scatter into each camera ray?
Each is a file, or a folder where it needs more, and none imports another. They share
`interface/`: `method.py` is what a frame asks of a method and what a method finds in its view,
`marching.py` the steps along rays, `media_checks.py` which media are refused.

Read in this order:

- `unshadowed.py`: one integral a ray and light, the shortest method there is.
- `ray_march.py`: the baseline, steps with a visibility test each.
- `equi_angular.py`: random samples, each of one light chosen by its power.
- `history.py`: any method with a mean over the frames before.
- `cloud_octaves.py`: clouds as engines render them.
- `cloud_collectors.py`: light of many orders in clouds, from where it enters them.
- `registry.py`: the methods by name, and how a name becomes a method.
- `published/`: methods as their papers have them, with their errors.
- `shader/`: a user's shader, drawn by OpenGL in a separate process.
- `user_method.py`: a user's plain function or class, made a method with its errors named
  and its results checked.
"""
