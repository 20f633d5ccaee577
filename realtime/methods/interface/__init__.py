# SPDX-License-Identifier: BSD-3-Clause
"""What a method is, what it is given, and what it returns: all that methods and frames know of one another.

Read in this order:

- `method.py`: the view that a method is given, a method with its parameters, and the layers that it returns.
- `marching.py`: the same integral by midpoint steps: what marchers sum up.
"""
