# SPDX-License-Identifier: BSD-3-Clause
"""The error of a shadow map against its size, and the flicker under a light that moves.

**The order of the error.** With N texels on a side a shadow edge lies within a texel of its place in the map, an angle
of O(1/N) as seen from the light. A camera ray that crosses the edge enters or leaves the light too early or too late by
that angle over the sine of the angle between ray and edge, both as seen from the light. So the airlight of *every* ray
that crosses a shadow edge is wrong by O(1/N), of either sign: the root of the mean square falls as 1/N, order 1.
Whether edges are steps or ramps does not matter; what is smooth between them is known to O(1/N^2) where the map is
interpolated, O(1/N) where it is not.

Rays that graze a shadow add to this. At a distance of delta from touching a smooth outline the part of a ray that is
hidden has a length of sqrt(delta), and misplacing the outline by epsilon changes it by about epsilon / sqrt(delta). The
mean square, the integral of epsilon^2 / delta from epsilon on, is epsilon^2 log(1/epsilon): the root still falls with
order 1, but for the root of a logarithm, and over sizes of N the slope is 1 - 1 / (2 log N): 0.9 at 128. A straight
edge that the camera sees edge-on hides the rays within epsilon of it whole: there the order is 1/2. Occluders that are
thinner than a texel do not converge before the map resolves them.

**Upright walls.** Where rays have found the jumps on the edges of texels
(`realtime.methods.light_volumes.jump_search`) the edge of a shadow is known to epsilon = 1/64 of a texel, or to
O(1/N^2) where it is a smooth outline between two sides. What is left of order 1 has a constant that is smaller by as
much. Corners of outlines lie within a texel, which has the wrong shape there: a share of O(1/N) of the rays that cross
the edge is wrong by O(1/N), a root mean square of O(N^(-3/2)). So the order lies between 1 and 3/2; occluders that are
thinner than a texel and smooth ones that are met at a grazing angle take from it as above.

**The order of the flicker.** An edge in the map stays where it is while the light moves by less than a texel, and then
jumps by one. Let the light move by m texels a frame, m = N step / 2 at a step in radians. For m < 1 a share m of the
edges jumps in a frame, by O(1/N) each: their root mean square is sqrt(m) / N, and at a given step it falls as
N^(-1/2). For m >= 1 the errors of consecutive frames have nothing to do with each other: the flicker is sqrt(2) times
the error of a frame and falls as 1/N.
"""

import math

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import linregress


def fitted_slope(sizes: ArrayLike, errors: ArrayLike) -> tuple[float, float]:
    """Return the order at which errors fall with the texels along an edge of the map, and its standard error.

    Both are (n,), and the errors relative. The order is that of least squares of the logarithms, NaN for fewer than two
    errors that are positive and finite; its standard error, from the scatter about the line, for fewer than three.
    """
    n, e = np.asarray(sizes, dtype=np.float64), np.asarray(errors, dtype=np.float64)
    counts = (e > 0) & np.isfinite(e)
    if counts.sum() < 2:
        return math.nan, math.nan
    line = linregress(np.log(n[counts]), np.log(e[counts]))
    return -float(line.slope), float(line.stderr) if counts.sum() > 2 else math.nan
