# SPDX-License-Identifier: BSD-3-Clause
"""How the rays of an image are divided: tiles of neighbouring rays, and blocks of neighbouring tiles."""

TILE = 16  #: rays in a tile, and tiles in a block
SIDE = 4  #: of a tile [pixels], where it is a square
CORNERS = (0, SIDE - 1, TILE - SIDE, TILE - 1)  #: the rays at the corners of a square
