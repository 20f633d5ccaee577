# SPDX-License-Identifier: BSD-3-Clause
"""How the rays of an image are divided: tiles of neighbouring rays, and blocks of neighbouring tiles."""

from enum import Enum

TILE = 16  #: rays in a tile, and tiles in a block
SIDE = 4  #: of a tile [pixels], where it is a square


class Layout(Enum):
    """How the rays of a view lie in the image."""

    SQUARES = "all pixels, of which every 16 that follow one another are a square of 4 x 4"
    LINES = "all pixels, of which 16 that follow one another are neighbours, but no square"
    CORNERS = "the first pixel of every tile"
    SOME = "any pixels: those of a branch, or rays between pixels"
