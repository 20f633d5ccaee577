# SPDX-License-Identifier: BSD-3-Clause
r"""The airlight of lights with extent: sums over points of the light, each over exact lit intervals.

With the points y on the surface of a light of radiance Le the radiance along a camera ray is

    L = albedo sigma_t Le / (4 pi)  int_A int  V p exp(-sigma_t (x + r)) cos_l / r^2  dx dA,
    cos_l = n . (o + x w - y) / r = (a + b x) / r,      nothing where it is negative.

The inner integral is that of a point light with the cosine in its integrand: a half space a + b x > 0, one interval of
the angle at the light like the cone of a spot, and a weight like that of a soft spot. It is continuous in y where the
light's visibility from a surface is not, so that few points do. Eight
independent scramblings (`reference.quadrature.light_points`) each give a mean, and their spread the standard error.
`reference.quadrature.replicates` says how many points a ray gets.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import Any

import drjit as dr
import numpy as np
from numpy.typing import NDArray

from analytic.geometry import foot_and_height
from analytic.panels import airlight_segments
from reference.quadrature.ahead import done_ahead
from reference.quadrature.light_airlight import light_airlight
from reference.quadrature.light_points import REPLICATES, PointPlan, light_points, square_points
from reference.quadrature.replicates import PILOT, replicate_means
from reference.quadrature.unbounded import Rays, edge_worth
from reference.scene.area_light import TruthAreaLight
from reference.scene.read import TruthLight, TruthScene
from reference.scene.shapes import Shapes
from reference.visibility.before_light import before_light
from reference.visibility.intervals import RandomChecks
from reference.visibility.many_points import Blockers, PairIntervals, blockers, pair_intervals
from reference.visibility.pair_checks import checked_pairs

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Share = Callable[[float], None]
Kept = Mapping[str, Array]
Keep = Callable[[str, Callable[[], Kept]], Kept]

_RTOL = 1e-6  # of the integral of one point, whose estimate is many digits too large: far below the error of a mean
_ROWS = 1 << 16  # rays and points at once
_PAIRS = 1 << 17  # the same, where lit intervals are looked for
_SHADOWS = 1 << 22  # shadows of that many rays and points at once
_CHECKS = 1  # random shadow rays of each ray and point: there are many points


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
    keep: Keep = lambda name, work: work(),
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
    keep
        Called with the name of each part of the work and a function that does it; may return what it did before.
    """
    count = len(truth.direction)
    bound, checks = np.zeros((count, 3)), list[RandomChecks]()
    lights = [(light, *before_light(truth, light)) for light in truth.area]
    rounds = 2 * plan.rounds * len(lights) * REPLICATES
    done = 0

    def sums(part: str, chosen: PointPlan, active: Index, numbers: tuple[int, int]) -> Array:
        nonlocal done
        total = np.zeros((len(active), 3, REPLICATES))
        for number, (light, scene, shapes) in enumerate(lights):
            rays = replace(scene, direction=truth.direction[active])
            ways = how | {"shapes": shapes, "checks": _CHECKS}
            if _is_geometric(rays, light, ways):
                ways["blockers"] = cache(
                    partial(blockers, light, shapes, truth.origin, rays.direction, distance[active])
                )
            for replicate in range(REPLICATES):
                square = square_points(chosen, number, replicate, light.kind)[slice(*numbers)]
                work = partial(_sums_over, rays, light_points(light, square), distance[active], shadow_scale, ways)
                got = keep(f"airlight-{part}{number}-{numbers[1]}-{replicate}", work)
                total[..., replicate] += got["radiance"]
                if part != PILOT:
                    bound[active] += got["bound"]
                    checked, disagreements, refined, left = (int(value) for value in got["checks"][:4])
                    checks.append(RandomChecks(checked, disagreements, refined, left, float(got["checks"][4])))
                done += 1
                tell(done / rounds)
        return total

    means, used = replicate_means(count, known, plan, sums)
    return AreaAirlight(means, bound / (REPLICATES * used[:, None]), RandomChecks.of_all(checks))


def _sums_over(
    rays: TruthScene, points: Sequence[TruthLight], distance: Array, shadow_scale: float, how: dict[str, Any]
) -> Kept:
    """Return sums over points: radiances and bounds of their errors, (rays, 3) each, and counts of the checks."""
    if _is_open(rays, how["shapes"]):
        radiance, bound = _open_airlight(rays, points, distance, shadow_scale)
        return {"radiance": radiance, "bound": bound, "checks": np.zeros(5)}
    if "blockers" in how:
        radiance, bound, known = _geometric_airlight(rays, points, distance, shadow_scale, how["blockers"]())
    else:
        sent = [
            light_airlight(rays, point, distance, shadow_scale=shadow_scale, how=how, rtol=_RTOL) for point in points
        ]
        known = RandomChecks.of_all([each.lit.random_checks for each in sent])
        radiance, bound = (np.sum([getattr(each, name) for each in sent], axis=0) for name in ("radiance", "bound"))
    checks = known.checked, known.disagreements, known.refined, known.left, known.missed
    return {"radiance": radiance, "bound": bound, "checks": np.array(checks)}


def _is_open(scene: TruthScene, shapes: Shapes) -> bool:
    """Return whether nothing can stand in a light, in a medium without bounds."""
    return not (scene.media or len(shapes.triangles) or len(shapes.radius) or shapes.others)


def _is_geometric(scene: TruthScene, light: TruthAreaLight, how: dict[str, Any]) -> bool:
    """Return whether nothing but triangles, and spheres beside the light, stands in it, in a medium without bounds."""
    shapes = how["shapes"]
    apart = np.linalg.norm(shapes.centre - light.centre, axis=1) > shapes.radius + light.radius
    return not scene.media and not shapes.others and how["edges"] != "rays" and bool(apart.all())


def _geometric_airlight(
    truth: TruthScene, points: Sequence[TruthLight], distance: Array, shadow_scale: float, known: Blockers
) -> tuple[Array, Array, RandomChecks]:
    """Return the sums over points before triangles and spheres, the bounds of their errors, and the random checks."""
    place, normal = _place_and_normal(points)
    radiance, bound, checks = np.zeros((len(distance), 3)), np.zeros((len(distance), 3)), []
    step = max(1, min(_PAIRS, _SHADOWS // max(1, known.most)) // len(points))

    def blocks() -> Iterator[tuple[int, PairIntervals]]:
        for start in range(0, len(distance), step):
            rows = slice(start, start + step)
            rays = np.arange(len(distance))[rows], truth.direction[rows], distance[rows]
            yield start, pair_intervals(known, truth.origin, rays, (place, normal))

    def summed(block: tuple[int, PairIntervals]) -> tuple[int, PairIntervals, tuple[Array, Array]]:
        start, lit = block
        ray, point = np.divmod(lit.pair, len(points))
        height, foot = lit.height[lit.pair], lit.foot[lit.pair]
        x0, x1 = np.maximum(foot + height * lit.low, 0.0), foot + height * lit.high
        stretches = start + ray, point, foot, height, x0, np.maximum(x0, x1)
        return start, lit, _stretch_sums(truth, points, stretches, shadow_scale, edge=lit.edge)

    for start, lit, sums in done_ahead(summed, blocks(), workers=dr.thread_count()):
        radiance, bound = radiance + sums[0], bound + sums[1]
        direction = truth.direction[start : start + step]
        checked, doubtful = checked_pairs(
            truth.occluders, known.shapes, lit, (truth.origin, direction), (place, normal)
        )
        checks.append(checked)
        # As if all of a ray were lit where a contradiction is left, at the most that an angle there can be worth.
        theta = np.arctan(lit.ends[1][doubtful]) - np.arctan(lit.ends[0][doubtful])
        strongest = truth.medium.phase(np.linspace(-1, 1, 1001)).max()
        factor = truth.medium.albedo * truth.medium.sigma_t * points[0].intensity / (4 * np.pi) * strongest
        np.add.at(bound, start + doubtful // len(points), (theta / lit.height[doubtful])[:, None] * factor)
    return radiance, bound, RandomChecks.of_all(checks)


def _place_and_normal(points: Sequence[TruthLight]) -> tuple[Array, Array]:
    return np.stack([point.position for point in points]), np.stack([np.asarray(point.axis) for point in points])


def _open_airlight(
    truth: TruthScene, points: Sequence[TruthLight], distance: Array, shadow_scale: float
) -> tuple[Array, Array]:
    """Return the sums over points in whose light nothing stands, and the bounds of their errors, (rays, 3) each.

    All points at once, and by distance in the place of angles: the cosine is (a + b x)/r, and the ray is cut where that
    is zero.
    """
    count, step = len(distance), max(1, _ROWS // max(1, len(points)))
    place, normal = _place_and_normal(points)
    radiance, bound = np.zeros((count, 3)), np.zeros((count, 3))

    def summed(start: int) -> tuple[Array, Array]:
        ray, point = np.divmod(np.arange(len(distance[start : start + step]) * len(points)), len(points))
        ray += start
        direction, n, y = truth.direction[ray], normal[point], place[point]
        foot, height = foot_and_height(truth.origin, direction, y)
        a, b = np.sum(n * (truth.origin - y), axis=1), np.sum(n * direction, axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            zero = np.where(b != 0, -a / b, np.where(a > 0, -np.inf, np.inf))
        x0 = np.where(b >= 0, np.maximum(zero, 0.0), 0.0)
        x1 = np.where(b >= 0, distance[ray], np.minimum(zero, distance[ray]))
        lit = np.flatnonzero(x1 > x0)
        stretches = ray[lit], point[lit], foot[lit], height[lit], x0[lit], x1[lit]
        return _stretch_sums(truth, points, stretches, shadow_scale)

    for sums in done_ahead(summed, range(0, count, step), workers=dr.thread_count()):
        radiance, bound = radiance + sums[0], bound + sums[1]
    return radiance, bound


def _stretch_sums(
    truth: TruthScene,
    points: Sequence[TruthLight],
    stretches: tuple[Index, Index, Array, Array, Array, Array],
    shadow_scale: float,
    edge: float = 0.0,
) -> tuple[Array, Array]:
    """Integrate lit stretches of rays and add up those of each ray, with the bounds of their errors, (rays, 3) each.

    A stretch has the numbers of its ray and point, the foot and height of the ray over the point, and both ends [m],
    which are uncertain by `edge` of their distance from the point.
    """
    ray, point, foot, height, x0, x1 = stretches
    place, normal = _place_and_normal(points)
    n, direction = normal[point], truth.direction[ray]
    a, b = np.sum(n * (truth.origin - place[point]), axis=1), np.sum(n * direction, axis=1)
    radiance, bound = np.zeros((len(truth.direction), 3)), np.zeros((len(truth.direction), 3))

    def cosine(x: Array, row: Index) -> Array:
        r = np.hypot(height[row, None], x - foot[row, None])
        return np.maximum(a[row, None] + b[row, None] * x, 0.0) / np.maximum(r, np.finfo(float).tiny)

    known: dict[float, tuple[Array, Array]] = {}
    for channel, sigma_t in enumerate(truth.medium.sigma_t.tolist()):
        if sigma_t not in known:
            values, errors = airlight_segments(
                foot, height, x0, x1, sigma_t, truth.medium.phase, shadow_scale=shadow_scale, weight=cosine, rtol=_RTOL
            )
            if edge:
                lines = Rays(direction, n, foot, height)
                errors = errors + edge * edge_worth(lines, np.arange(len(ray)), (x0, x1), sigma_t, truth.medium)
            known[sigma_t] = values, errors
        factor = truth.medium.albedo[channel] * sigma_t * points[0].intensity[channel] / (4 * np.pi)
        for target, column in zip((radiance, bound), known[sigma_t], strict=True):
            target[:, channel] = factor * np.bincount(ray, column, len(target))
    return radiance, bound
