# SPDX-License-Identifier: BSD-3-Clause
"""Images of other renderers: whether they are right, and what is wrong with them.

Read in this order:

- `observation.py`: which layer of an image is judged, its values, and the pixels that take part;
- `prediction.py`: the image of a scene for a fog, lights, a camera and an encoding;
- `fault.py`: what a fault is, and the numbers that are looked for in it;
- `faults.toml` and `faults.py`: the catalogue of all faults, and the faults of single lights;
- `equations.py`: the equations of engines as faults, and their terms in words;
- `targets.py`: what of a guess of an image a fault changes;
- `transforms.py`: the formulas of faults;
- `curves.py`: encodings and tone curves;
- `starts.py`: the values with which the search for the numbers of a fault begins;
- `traits.py`: what a scene and its image have that faults need;
- `search.py`: the numbers with which faults fit best;
- `decide.py`: how much speaks for an explanation, what it leaves, and whether it is named;
- `stages.py`: in which order faults are tried, and when that is enough;
- `error_place.py`: where an error lies;
- `diagnose.py`: what is wrong with an image;
- `hints.py`: what may be wrong with an image as a whole, without any path of light;
- `model_errors.py`: the error of an engine's equation apart from that of its algorithm;
- `judge.py`: an image against the reference of its scene;
- `verdict.py`: whether an image is right;
- `other_orders.py`: whether an image of a cloud holds light of all orders;
- `images.py`: a folder of images, found by scene, for the report.
"""
