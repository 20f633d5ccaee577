# SPDX-License-Identifier: BSD-3-Clause
"""The collector search of Bouthors 2008: where the light of a set of orders enters a cloud, and how much of it comes.

Read in this order:

- `search.py`: the fixed point of the collector, and the light that comes from there.
"""
