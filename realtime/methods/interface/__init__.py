# SPDX-License-Identifier: BSD-3-Clause
"""What a method is, what it is given, and what it returns: all that methods and frames know of one another.

Read in this order:

- `method.py`: a method with its parameters, the layers that it returns, and the formula of a frame.
- `view.py`: the rays of a frame, the lights and the media, as a method sees them.
- `marching.py`: the same integral by midpoint steps: what marchers sum up.
"""
