# SPDX-License-Identifier: BSD-3-Clause
"""The order of shadow planes and the stencil of Biri 2006, section 5, in a plane and along a ray, without images.

*Order.* In a plane the shadow of an edge P is bounded by the half line from P away from the light S. A ray from the
camera O that crosses two of them crosses the one with the larger angle between SO and SP farther away. So by the cosine
of this angle (5.1.4) they are drawn back to front.

*Stencil.* Along a ray a shadow is an interval [a, b]. Its plane at a faces the camera, that at b faces away. Planes are
drawn from the surface towards the camera: one that faces the camera adds Gamma(a) where the stencil is 1, one that
faces away subtracts Gamma(b) where it is 0. In section 5, stage 5, planes that face the camera then increment the
stencil; in 5.1.5 they decrement it. Any increasing function serves as Gamma; x does.
"""

import numpy as np

_PAIRS, _RAYS = 20_000, 4000


def ordering() -> dict[str, float]:
    """Return shares of random pairs and rays that come out right.

    Returns
    -------
    dict
        `plane` (pairs of edges in a plane that the cosine orders as the ray crosses them); for rays in up to five
        overlapping shadows, whose sum is the length of their lit part: `stencil` (the rule of 5.1.5, camera in light),
        `printed` (that of section 5, stage 5), `inside` (5.1.5, camera in shadow), `unordered` (without a stencil).
    """
    random = np.random.default_rng(65)
    shares = {"plane": _plane(random)}
    lit, dark = ([_shadows(random, inside) for _ in range(_RAYS)] for inside in (False, True))
    for name, rays, step in (("stencil", lit, -1), ("printed", lit, 1), ("inside", dark, -1), ("unordered", lit, 0)):
        shares[name] = float(np.mean([abs(drawn(ray, step) - _lit_length(ray)) < 1e-9 for ray in rays]))
    return shares


def _plane(random: np.random.Generator) -> float:
    """Return the share of pairs in the right order: the light at the origin, the camera at (1, 0)."""
    right = total = 0
    while total < _PAIRS:
        angles, reach = random.uniform(0, np.pi, (2, _PAIRS)), random.uniform(0.05, 2, (2, _PAIRS))
        way = random.uniform(0, np.pi, _PAIRS)
        # The ray (1, 0) + x (cos way, sin way) meets the direction `angles` at x, at the distance `far` of the light.
        with np.errstate(divide="ignore", invalid="ignore"):
            x = np.sin(angles) / np.sin(way - angles)
            far = np.sin(way) / np.sin(way - angles)
        both = np.all((x > 0) & (far > reach), axis=0)
        cosine = np.cos(angles[:, both])
        farther = x[0, both] > x[1, both]
        right += int(np.sum((cosine[0] < cosine[1]) == farther))
        total += int(np.sum(both))
    return right / total


def _shadows(random: np.random.Generator, inside: bool) -> list[tuple[float, float]]:
    """Return shadows on a ray from 0 to the surface at 1; `inside`: one of them holds the camera."""
    pairs = np.sort(random.uniform(0, 1.3, (int(random.integers(1, 6)), 2)), axis=1)
    if inside:
        pairs[0, 0] = -0.1
    return [(float(a), float(b)) for a, b in pairs]


def drawn(shadows: list[tuple[float, float]], step: int) -> float:
    """Return the sum that is drawn: `step` is what planes that face the camera add to the stencil, the others less it.

    Parameters
    ----------
    shadows
        Ends of the shadows on a ray whose surface is at 1 and whose camera is at 0.
    step
        -1 as in 5.1.5, +1 as in section 5, stage 5; 0: no plane is left out.
    """
    stencil = sum(a < 1 < b for a, b in shadows)
    planes = sorted([(a, True) for a, _ in shadows] + [(b, False) for _, b in shadows], reverse=True)
    total = 1.0 if stencil == 0 else 0.0
    for x, front in planes:
        if not 0 < x < 1:
            continue
        if step == 0 or stencil == (1 if front else 0):
            total += x if front else -x
        stencil += step if front else -step
    return total


def _lit_length(shadows: list[tuple[float, float]]) -> float:
    """Return how much of the ray lies in no shadow, by cutting it at all ends."""
    cuts = np.unique(np.clip([0.0, 1.0, *(end for pair in shadows for end in pair)], 0, 1))
    middles = 0.5 * (cuts[1:] + cuts[:-1])
    lit = [not any(a < x < b for a, b in shadows) for x in middles]
    return float(np.sum(np.diff(cuts)[lit]))
