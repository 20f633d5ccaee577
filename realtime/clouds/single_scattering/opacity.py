# SPDX-License-Identifier: BSD-3-Clause
r"""The opacity of clouds along a ray.

With the extinctions kappa_i and the lengths of the stretches in clouds, light from behind passes with the transmittance

    T = prod exp(-kappa_i (x_{i+1} - x_i)),        opacity = 1 - T.

Printed is (Bouthors 2008, eq. 2)

    opacity = sum (exp(-kappa_i x_{i+1}) - exp(-kappa_i x_i)) / kappa_i.

Its sign is wrong: it integrates exp(-kappa x), which falls. It is a length, since the factor kappa is missing, and each
exponent has the local kappa times the whole distance instead of the depth cumulated up to there. As printed the opacity
is negative, and more light comes out than went in; x is counted from where the ray enters the first cloud.
"""

from typing import Any

import drjit as dr

from realtime.clouds.bounds.crossings import optical_depths, sum_over_stretches
from realtime.clouds.bounds.surfaces import CloudSurfaces
from realtime.scene.media.bounded import Clouds


def opacity(surfaces: CloudSurfaces, clouds: Clouds, origin, direction, end) -> Any:
    """Return the opacity of rays up to a distance, a colour [1]; arguments as of `optical_depths`.

    `surfaces` and `clouds` are the boundaries and what fills them, `origin` [m] and unit `direction` the rays, `end`
    may be infinite [m].
    """
    return opacity_of(optical_depths(surfaces, clouds, origin, direction, end), type(clouds.albedo))


def opacity_of(depths: tuple[Any, ...], Color) -> Any:
    """Return 1 - exp(-depth) as a colour, from optical `depths` by channel [1]; `Color` is its type."""
    # 1 - exp(-d) = 2 exp(-d/2) sinh(d/2) loses nothing where d is small.
    shares = [
        dr.select(depth < 0.1, 2 * dr.exp(-0.5 * depth) * dr.sinh(0.5 * depth), 1 - dr.exp(-depth)) for depth in depths
    ]
    return Color(*shares)


def printed_opacity(surfaces: CloudSurfaces, clouds: Clouds, origin, direction, end) -> Any:
    """Return what is printed for the opacity, a colour [m]; arguments as of `opacity`.

    Bouthors, Neyret, Max, Bruneton, Crassin 2008, eq. 2.
    """
    Float, Color = type(direction.x), type(clouds.albedo)

    def add(total, begin, end, cloud, inside):
        kappas = [dr.gather(Float, sigma_t, cloud, inside) for sigma_t in clouds.sigma_t]
        return add_printed(total, begin, end, kappas, inside)

    nothing = nothing_printed(clouds, Float, dr.width(direction))
    _, sums = sum_over_stretches(surfaces, origin, direction, end, nothing, add)
    return Color(*sums)


def nothing_printed(clouds: Clouds, Float, lanes: int) -> tuple[Any, tuple[Any, ...]]:
    """Return the sum of no stretch: where the first cloud begins, infinite, and 0 by channel."""
    return dr.full(Float, dr.inf, lanes), tuple(dr.zeros(Float, lanes) for _ in clouds.sigma_t)


def add_printed(total, begin, end, kappas, inside) -> tuple[Any, tuple[Any, ...]]:
    """Return `total` and what is printed for a stretch [m] of the extinctions `kappas` [1/m], where it is `inside`."""
    first, sums = total
    first = dr.select(inside & ~dr.isfinite(first), begin, first)
    near, far = (dr.select(inside, place - first, 0) for place in (begin, end))
    terms = [
        dr.select(inside & (kappa > 0), (dr.exp(-kappa * far) - dr.exp(-kappa * near)) / kappa, 0) for kappa in kappas
    ]
    return first, tuple(own + term for own, term in zip(sums, terms))
