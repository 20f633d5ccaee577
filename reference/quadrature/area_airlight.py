# SPDX-License-Identifier: BSD-3-Clause
r"""The airlight of lights with extent: sums over points of the light, each over exact lit intervals.

With the points y on the surface of a light of radiance Le the radiance along a camera ray is

    L = albedo sigma_t Le / (4 pi)  int_A int  V p exp(-sigma_t (x + r)) cos_l / r^2  dx dA,
    cos_l = n . (o + x w - y) / r = (a + b x) / r,      nothing where it is negative.

The inner integral is that of a point light with the cosine in its integrand: a half space a + b x > 0, one interval of
the angle at the light like the cone of a spot, and a weight like that of a soft spot. It is continuous in y where the
light's visibility from a surface is not, so that few points do; the table in docs/ground-truth.md shows how few. Eight
independent scramblings (`reference.quadrature.light_points`) each give a mean, and their spread the standard error.
Points are doubled for the rays whose standard error is above the one that was asked for.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reference.quadrature.light_airlight import light_airlight
from reference.quadrature.light_points import REPLICATES, PointPlan, light_points, square_points
from reference.scene.read import TruthScene
from reference.visibility.before_light import before_light
from reference.visibility.intervals import RandomChecks

Array = NDArray[np.float64]
Share = Callable[[float], None]

_RTOL = 1e-8  # of the integral of one point: below the error of a mean over points
_CHECKS = 1  # random shadow rays of each ray and point: there are many points
FLOOR = 1e-3  #: of the mean over rays: below this a ray's error need not be small relative to its value


@dataclass(frozen=True)
class AreaAirlight:
    """The airlight of all lights with extent, by replicate."""

    replicates: Array  #: (rays, 3, replicates) [W/(m^2 sr)]
    bound: Array  #: of the error of the lit intervals and their integrals, not of the points, (rays, 3) [W/(m^2 sr)]
    random_checks: RandomChecks


def area_airlight(
    truth: TruthScene,
    distance: Array,
    known: Array,
    *,
    plan: PointPlan,
    shadow_scale: float,
    how: dict[str, Any],
    tell: Share,
) -> AreaAirlight:
    """Compute the airlight of all lights with extent along every ray.

    Parameters
    ----------
    truth
        The scene.
    distance
        To the visible surface, (rays,), infinite where there is none [m].
    known
        The airlight of all other lights, to which errors are relative too, (rays, 3) [W/(m^2 sr)].
    plan
        How many points.
    shadow_scale, how
        As in `reference.quadrature.light_airlight.light_airlight`.
    tell
        Called with the share of the work that is done.
    """
    count = len(truth.direction)
    total, bound = np.zeros((count, 3, REPLICATES)), np.zeros((count, 3))
    used, checks = np.zeros(count), []
    lights = [(light, *before_light(truth, light)) for light in truth.area]
    squares = [[square_points(plan, i, k) for k in range(REPLICATES)] for i in range(len(lights))]
    active, low, high = np.arange(count), 0, min(plan.first, plan.most)
    rounds = 1 + int(np.log2(max(1, plan.most // max(1, plan.first))))
    done = 0
    while len(active):
        for number, (light, scene, shapes) in enumerate(lights):
            rays = replace(scene, direction=truth.direction[active])
            ways = how | {"shapes": shapes, "checks": _CHECKS}
            for replicate in range(REPLICATES):
                for point in light_points(light, squares[number][replicate][low:high]):
                    sent = light_airlight(
                        rays, point, distance[active], shadow_scale=shadow_scale, how=ways, rtol=_RTOL
                    )
                    total[active, :, replicate] += sent.radiance
                    bound[active] += sent.bound
                    checks.append(sent.lit.random_checks)
                tell((done + (number + (replicate + 1) / REPLICATES) / len(lights)) / rounds)
        used[active] = high
        done += 1
        if high >= plan.most:
            break
        active = _unsettled(total[active] / high, known, active, plan.error)
        low, high = high, 2 * high
    means = total / used[:, None, None]
    return AreaAirlight(means, bound / (REPLICATES * used[:, None]), RandomChecks.of_all(checks))


def standard_error(replicates: Array) -> Array:
    """Return the standard errors of the means over the replicates, the last axis."""
    return replicates.std(axis=-1, ddof=1) / np.sqrt(replicates.shape[-1])


def _unsettled(replicates: Array, known: Array, active: NDArray[np.int64], error: float) -> NDArray[np.int64]:
    """Return which of the active rays have too large a standard error."""
    value = replicates.mean(axis=-1) + known[active]
    floor = FLOOR * value.mean(axis=0)
    above = standard_error(replicates) > error * np.maximum(value, floor)
    return active[above.any(axis=1)]
