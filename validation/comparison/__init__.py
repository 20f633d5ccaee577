# SPDX-License-Identifier: BSD-3-Clause
"""Image files against each other and against the truth, those of other renderers among them.

Read in this order:

- `images.py`: compares two image files;
- `engine_images.py`: images of another renderer, found by scene;
- `engine_hints.py`: what may be wrong with an image as a whole;
- `engine_compare.py`: one such image against the truth of its scene;
- `compare_text.py`: what `airlight compare` prints.

May import: `analytic.errors`, `reference.quadrature`, `reference.storage`, `validation.estimates`,
`validation.metrics`, `validation.scenes`, `validation.statistics`.
"""
