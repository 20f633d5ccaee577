# SPDX-License-Identifier: BSD-3-Clause
"""The interface between methods and frames: a method, the view that it is given, and
the layers that it returns.

Read in this order:

- `method.py`: the view that a method is given, a method with its parameters, and
  the layers that it returns.
- `media_checks.py`: which media a method renders: fog, or clouds.
- `marching.py`: the same integral by midpoint steps, for methods that march.
"""
