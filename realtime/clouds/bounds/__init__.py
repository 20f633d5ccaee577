# SPDX-License-Identifier: BSD-3-Clause
"""Where rays cross the closed boundaries of clouds, whatever their shapes, and how much of the rays lies in them.

Read in this order:

- `surfaces.py`: the boundaries of all clouds as one Mitsuba scene, with the normal of every triangle;
- `crossings.py`: the next crossing of a ray, and from crossings optical depths;
- `stretches.py`: the first stretches of rays in clouds, kept.
"""
