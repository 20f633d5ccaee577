# SPDX-License-Identifier: BSD-3-Clause
"""Images of other renderers: whether they are right, and what is wrong with them.

Read in this order:

- `seen.py`: which layer of an image is judged, its values, and the pixels that take part;
- `prediction.py`: the image of a scene for a fog, lights, a camera and an encoding;
- `curves.py`: encodings and tone curves;
- `fault.py`: what a fault is, and how it changes a guess;
- `media_faults.py`, `light_faults.py`, `image_faults.py`, `layer_faults.py`: the faults;
- `faults.py`: the catalogue of all faults, and the faults of single lights;
- `search.py`: the parameters with which faults fit best;
- `evidence.py`: how much speaks for an explanation, and whether it leaves noise alone;
- `error_place.py`: where an error lies;
- `diagnose.py`: what is wrong with an image;
- `hints.py`: what may be wrong with an image as a whole, without any path of light;
- `judge.py`: whether an image is right;
- `images.py`: a folder of images, found by scene, for the report.
"""
