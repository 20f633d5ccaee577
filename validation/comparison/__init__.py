# SPDX-License-Identifier: BSD-3-Clause
"""Image files against each other and against the truth, those of other renderers among them.

Read in this order:

- `images.py`: compares two image files;
- `engine_layers.py`: which layer of it is judged, and what light it holds;
- `whole_image.py`: faults of an image as a whole, by what is said of them;
- `engine_hints.py`: what may be wrong with an image as a whole;
- `engine_pixels.py`: whether its pixels are centres or means;
- `engine_verdict.py`: whether it is right, and where it is not;
- `engine_compare.py`: one such image against the truth of its scene;
- `engine_images.py`: a folder of them, found by scene, for the report;
- `compare_text.py`: what `airlight compare` prints.
"""
