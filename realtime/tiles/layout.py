# SPDX-License-Identifier: BSD-3-Clause
"""How the rays of an image are divided: tiles of neighbouring rays, and blocks of neighbouring tiles."""

TILE = 16  #: rays in a tile, and tiles in a block
SIDE = 4  #: of a tile [pixels], where it is a square
