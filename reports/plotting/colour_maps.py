# SPDX-License-Identifier: BSD-3-Clause
"""Colour maps of the error maps, in pictures and on the page: equal steps of value look like equal steps of colour.

The map of signed errors is made here: dark blue, over white in the middle, to dark red. Each arm is a quadratic Bezier
curve in CAM16-UCS (Li et al. 2017), a space in which the distance of two colours is about how different they look,
walked in equal steps of length. The arms are as long as one another within a few per cent, so that an error looks as
large on either side. What has no sign uses viridis, HDR-FLIP magma, as its authors do; both are even by construction
(van der Walt and Smith 2015). Of the ready-made maps that end as dark, colorcet's CET-D1A (Kovesi 2015) is the nearest:
its steps differ by up to 34 % of their mean in CAM16-UCS, those here by 5 %, and its middle is not white.
"""

import functools

import numpy as np
from numpy.typing import NDArray

Colours = NDArray[np.uint8]

#: Middle, control point and end of each arm's curve, in CAM16-UCS (J', a', b').
MIDDLE = (98.5, -1.87, -1.06)
BLUE = ((70.0, -14.0, -35.0), (22.0, -1.5, -22.0))
RED = ((70.0, 36.0, 24.0), (25.0, 29.0, 10.0))

NOT_FINITE = (255, 0, 255)  #: magenta, which no map contains

_FINE = 4097  # points along each curve, from which equal steps are interpolated


@functools.cache
def signed_colours(steps: int = 127) -> Colours:
    """Return the map of signed errors, (2 steps + 1, 3) in 8-bit sRGB: blue below, red above, white in the middle."""
    import colour

    lightness_and_hue = np.concatenate([_arm(BLUE, steps)[:0:-1], _arm(RED, steps)])
    # Both CAM16-UCS and the sRGB of colour-science scale XYZ to 1.
    linear = colour.XYZ_to_sRGB(colour.CAM16UCS_to_XYZ(lightness_and_hue))
    return np.round(255 * np.clip(linear, 0, 1)).astype(np.uint8)


@functools.cache
def unsigned_colours(name: str) -> Colours:
    """Return 256 colours of a map of matplotlib, (256, 3) in 8-bit sRGB."""
    import matplotlib

    return np.round(255 * matplotlib.colormaps[name](np.arange(256))[:, :3]).astype(np.uint8)


def _arm(points: tuple[tuple[float, float, float], ...], steps: int) -> NDArray[np.float64]:
    """Return a curve from the middle to its end in equal steps of length, (steps + 1, 3)."""
    middle, control, end = (np.array(point) for point in (MIDDLE, *points))
    t = np.linspace(0, 1, _FINE)[:, None]
    curve = (1 - t) ** 2 * middle + 2 * t * (1 - t) * control + t**2 * end
    length = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(curve, axis=0), axis=1))])
    wanted = np.linspace(0, length[-1], steps + 1)
    return np.stack([np.interp(wanted, length, curve[:, axis]) for axis in range(3)], axis=1)
