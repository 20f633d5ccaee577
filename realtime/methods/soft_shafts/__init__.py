# SPDX-License-Identifier: BSD-3-Clause
"""Soft shafts (Ali 2016): few points of a light, visibility in few levels,
and filters that smooth it.

The source prints no equation; what is built here is reconstructed from captions (docs/papers.md).

Read in this order:

- `parameters.py`: the parameters, and which of them are those of the source.
- `sources.py`: the points of a light as a table, with their shadow maps: which fraction of the
  light reaches the visible surfaces, and how wide its penumbrae are.
- `method.py`: the method, how its stages follow one another, and its filters.
"""
