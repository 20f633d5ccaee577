# SPDX-License-Identifier: BSD-3-Clause
r"""The airlight of area lights and the surfaces that they light: sums over samples, each
with exact lit intervals.

With the points y on the surface of a light of radiance Le the radiance along a camera ray is

    L = albedo sigma_t Le / (4 pi)  int_A int  V p exp(-sigma_t (x + r)) cos_l / r^2  dx dA,
    cos_l = n . (o + x w - y) / r.

The inner integral is the integral of a point light with a cosine for its profile, cut where the ray
passes the plane of y and n. It is continuous in y where the visibility from a surface is not, so
that few samples suffice. Surfaces at the end of a ray receive, from their own samples,

    L = exp(-tau_camera)  int Le V f cos_s exp(-s tau_shadow) domega,

f cos_s by Mitsuba's `BSDF.eval`. V is exact along sections, and samples are drawn where V is 1. A
few fixed sections first find the points that see only a part of a light that is no mesh: these get
sections in pairs. `reference.quadrature.light_samples` and `light_sections` draw the samples,
`reference.quadrature.replicates` says how many a ray gets: eight independent scramblings each give
a mean, and their spread the standard error.
"""

import itertools
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cache, partial

import drjit as dr
import numpy as np
from numpy.typing import NDArray

from airlight.reference.quadrature.fields import field_of, optical_depth
from airlight.reference.quadrature.integrate import Terms, cosine_profile, sums_of
from airlight.reference.quadrature.light_airlight import worth_of_doubt
from airlight.reference.quadrature.light_samples import samples_for_rays
from airlight.reference.quadrature.light_sections import (
    Sections,
    sections_for_points,
    solid_angle,
    to_sphere,
)
from airlight.reference.quadrature.replicates import (
    PILOT,
    REPLICATES,
    Keep,
    Kept,
    PointPlan,
    RayPoints,
    Sums,
    keep_nothing,
    replicate_means,
)
from airlight.reference.quadrature.surface import Reflection, SurfaceHits
from airlight.reference.scene.area_light import ReferenceAreaLight
from airlight.reference.scene.read import ReferenceScene
from airlight.reference.scene.shapes import distance_to
from airlight.reference.visibility.candidates import Ball
from airlight.reference.visibility.certificate import LitIntervals, RandomChecks
from airlight.reference.visibility.lit_intervals import (
    IN_PLANE,
    Obstacles,
    before_light,
    lit_intervals,
    obstacles,
)
from airlight.reference.visibility.planes import Rays, before, rays_at

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Fraction = Callable[[float], None]

_PAIRS = 1 << 16  # rays and samples at once


@dataclass(frozen=True)
class AreaAirlight:
    """The airlight of all area lights, by replicate."""

    replicates: Array  #: (rays, 3, replicates) [W/(m^2 sr)]
    #: of the lit intervals and their integrals, not of the samples, (rays, 3) [W/(m^2 sr)]
    error: Array
    random_checks: RandomChecks


@dataclass(frozen=True)
class Beam:
    """An area light and what can stand in it."""

    light: ReferenceAreaLight
    scene: ReferenceScene  #: without the light's own shape
    distance: Array  #: of its rays to the visible surface, (rays,) [m]
    known: Callable[[], Obstacles]  #: looked for once, where somebody asks


def beams_of(reference: ReferenceScene, distance: Array) -> list[Beam]:
    """Return the area lights of a scene, and what can stand between them and its
    rays up to distances [m].
    """
    beams = []
    for light in reference.area:
        scene, shapes = before_light(reference, light)
        known = cache(partial(obstacles, scene, Ball(light.centre, light.radius), distance, shapes))
        beams.append(Beam(light, scene, distance, known))
    return beams


def area_airlight(
    reference: ReferenceScene,
    beams: list[Beam],
    known: Array,
    *,
    plan: PointPlan,
    shadow_scale: float = 1.0,
    tell: Fraction = lambda fraction: None,
    keep: Keep = keep_nothing,
) -> AreaAirlight:
    """Compute the airlight of all area lights along every ray.

    `reference`, `beams`: the scene, and its lights from `beams_of`; `known`: the airlight of all
    other lights, to which errors are relative too, (rays, 3) [W/(m^2 sr)]; `plan`: how many
    samples; `shadow_scale`: see `reference.quadrature.image.quadrature_image`; `tell`: called with
    the fraction of the work that is done; `keep`: called with the name of each part of the work and
    a function that does it; may return what it did before.
    """
    count = len(reference.direction)
    error, checks = np.zeros((count, 3)), list[RandomChecks]()

    def add(active: Index, got: Kept) -> None:
        error[active] += got["error"]
        checked, disagreements, refined, left = (int(value) for value in got["checks"][:4])
        checks.append(RandomChecks(checked, disagreements, refined, left, float(got["checks"][4])))

    def work(number: int, active: Index, points: Callable[[str], RayPoints]) -> Kept:
        return _scattered(beams[number], active, points(beams[number].light.kind), shadow_scale)

    sums = _by_replicate("airlight", len(beams), plan, work, tell=tell, keep=keep, add=add)
    means, used = replicate_means(count, known, plan, sums)
    return AreaAirlight(means, error / (REPLICATES * used[:, None]), RandomChecks.of_all(checks))


def _by_replicate(
    layer: str,
    lights: int,
    plan: PointPlan,
    work: Callable[[int, Index, Callable[[str], RayPoints]], Kept],
    *,
    tell: Fraction,
    keep: Keep,
    add: Callable[[Index, Kept], None] = lambda active, got: None,
) -> Sums:
    """Return the sums of a layer for `replicate_means`: work(number of the light, rays,
    points of all replicates).
    """
    # The most calls of `sums`, by pilots and by numbers of points: progress is a fraction of them.
    rounds, done = 2 * plan.rounds * lights, 0.0
    step = 1 << 12  # rays of a part of the work, which `keep` may store

    def sums(part: str, chosen: PointPlan, active: Index) -> Array:
        nonlocal done
        total = np.zeros((len(active), 3, REPLICATES))
        for number, first in itertools.product(range(lights), range(0, len(active), step)):
            rows = slice(first, first + step)
            points = partial(RayPoints.of, chosen, number, len(active[rows]), part=first)
            # A part is named by layer, light, number of points and first ray: what an interrupted
            # run stored is found again by it.
            one = partial(work, number, active[rows], points)
            got = keep(f"{layer}-{part}{number}-{chosen.most}-{first}", one)
            total[rows] += (
                _controlled(got["radiance"], got["fraction"])
                if "fraction" in got
                else got["radiance"]
            )
            # Pilots only decide how many points count; their errors and checks are not those of the
            # result.
            if part != PILOT:
                add(active[rows], got)
            done += len(active[rows]) / len(active)
            tell(done / rounds)
        return total

    return sums


def _controlled(found: Array, fractions: Array) -> Array:
    """Correct sums of replicates, (rays, 3, replicates), by the known solid
    angle as a control variate.

    A replicate whose sections have the fraction s of the light's solid angle, of mean 1, gets (1 -
    s) c more. c is the sum for the whole solid angle by the other replicates, which are independent
    of s: the mean does not change.
    """
    # Leave one out: the sums and fractions of the seven other replicates.
    others = fractions.sum(axis=1, keepdims=True) - fractions
    whole = (found.sum(axis=2, keepdims=True) - found) / np.maximum(others, np.finfo(float).tiny)[
        :, None
    ]
    return found + (1 - fractions)[:, None] * whole


def turn_of_sections(plan: PointPlan, number: int) -> float:
    """Return by what angle the sections of a light are turned, about half a right angle:
    edges often follow lights.

    All replicates have one: were the variance of each another, Student's
    intervals would hold too often.
    """
    return 0.25 * np.pi * (0.5 + np.random.default_rng((plan.seed, number)).random())


def _scattered(beam: Beam, active: Index, points: RayPoints, shadow_scale: float) -> Kept:
    """Return sums over samples: radiances, (rays, 3, replicates), their errors without that of
    samples, (rays, 3), and counts of the checks.
    """
    reference, light, count, each = beam.scene, beam.light, len(active), len(points)
    radiance, errors, checks = (
        np.zeros((count, 3, REPLICATES)),
        np.zeros((count, 3)),
        [RandomChecks()],
    )
    # A block has as many rays as make `_PAIRS` pairs of ray and sample.
    step = max(1, _PAIRS // each)

    def lit_pairs() -> Iterator[tuple[slice, Rays, Array, Array, LitIntervals]]:
        for first in range(0, count, step):
            rows = slice(first, first + step)
            direction, distance = reference.direction[active[rows]], beam.distance[active[rows]]
            # One row for each pair, ray by ray: the sample is the point light of the ray's plane.
            samples = samples_for_rays(light, reference.origin, direction, distance, points[rows])
            place, normal, weight = samples.flat()
            rays = rays_at(reference.origin, np.repeat(direction, each, axis=0), place)
            # A sample sends light only to the side of its normal: the ray is cut at the plane of
            # the sample, at the camera, and at the visible surface. Where nothing is left, low =
            # high.
            low, high = before(rays, normal)
            ends = np.maximum(low, 0.0), np.minimum(high, np.repeat(distance, each))
            ends = ends[0], np.maximum(*ends)
            of = np.repeat(active[rows], each)
            # A shadow ray checks every seventh pair: an odd number steps through all samples.
            lit = lit_intervals(rays, ends, beam.known(), of=of, checks=1, every=7, normal=normal)
            yield rows, rays, normal, weight, lit

    def summed(
        work: tuple[slice, Rays, Array, Array, LitIntervals],
    ) -> tuple[slice, RandomChecks, Array, Array]:
        rows, rays, normal, weight, lit = work
        # The tolerance of one sample's integral, whose estimate is many digits too large, is far
        # below the error of a mean.
        terms = Terms(
            cosine_profile(rays, normal), shadow_scale=shadow_scale, edge=lit.edge, rtol=1e-6
        )
        distance = np.repeat(beam.distance[active[rows]], each)
        parts = field_of(reference).sums(rays, (lit.ray, lit.low, lit.high), distance, terms)
        # Parts that shadow rays left in doubt may be lit or not: their largest airlight is added to
        # the error.
        parts = parts[0], parts[1] + worth_of_doubt(reference, rays, lit)
        # dA of a sample and the radiance of the light make radiance of the sums. The samples of a
        # ray are in the order of replicates, and each replicate is added up on its own.
        value, error = (
            (part * weight[:, None]).reshape(-1, REPLICATES, each // REPLICATES, 3).sum(axis=2)
            * light.radiance
            for part in parts
        )
        return rows, lit.random_checks, np.moveaxis(value, 1, 2), error.sum(axis=1)

    def add(rows: slice, found: RandomChecks, value: Array, error: Array) -> None:
        radiance[rows], errors[rows] = value, error
        checks.append(found)

    # NumPy, which sums, works on one processor and releases Python's lock meanwhile. Dr.Jit, which
    # finds the intervals, has threads of its own.
    # The queue is short, so that waiting blocks do not fill the memory.
    with ThreadPoolExecutor(dr.thread_count()) as pool:
        waiting: deque[Future] = deque()
        for pairs in lit_pairs():
            waiting.append(pool.submit(summed, pairs))
            if len(waiting) > dr.thread_count():
                add(*waiting.popleft().result())
        for future in waiting:
            add(*future.result())
    report = RandomChecks.of_all(checks)
    counts = report.checked, report.disagreements, report.refined, report.left, report.missed
    return {"radiance": radiance, "error": errors, "checks": np.array(counts)}


def area_surface(
    reference: ReferenceScene,
    hits: SurfaceHits,
    beams: list[Beam],
    known: Array,
    *,
    plan: PointPlan,
    shadow_scale: float = 1.0,
    tell: Fraction = lambda fraction: None,
    keep: Keep = keep_nothing,
) -> Array:
    """Return the radiance of surfaces lit by area lights, by replicate, (rays, 3,
    replicates) [W/(m^2 sr)].

    `reference`, `hits`, `beams`: the scene, what its rays hit, and its lights from `beams_of`;
    `known`: the radiance that all other lights give, to which errors are relative too, (rays, 3)
    [W/(m^2 sr)]; `plan`, `shadow_scale`, `tell`, `keep`: as in `area_airlight`.
    """
    result = np.zeros((len(hits.distance), 3, REPLICATES))
    rows = np.flatnonzero(np.isfinite(hits.distance))
    if not len(rows):
        return result
    # The light that leaves a surface is attenuated on its way to the camera, whatever lit it.
    reflection = Reflection(hits.interaction)
    depth = optical_depth(
        reference,
        reference.origin,
        reference.direction[rows],
        np.zeros(len(rows)),
        hits.distance[rows],
    )

    turns = [turn_of_sections(plan, number) for number in range(len(beams))]
    # In a penumbra mirrored pairs have the smaller error, elsewhere samples that are even in the
    # solid angle: each surface point uses one kind under each light.
    hidden = [_partly_hidden(beam, rows, turn) for beam, turn in zip(beams, turns, strict=True)]

    def work(number: int, active: Index, points: Callable[[str], RayPoints]) -> Kept:
        radiance, fraction = (
            np.zeros((len(active), 3, REPLICATES)),
            np.ones((len(active), REPLICATES)),
        )
        beam = beams[number]
        for pairs, kind in ((False, beam.light.kind), (True, "pairs")):
            chosen = np.flatnonzero(hidden[number][active] == pairs)
            if len(chosen):
                pixels, view = rows[active[chosen]], _View(beam, points(kind), turns[number], pairs)
                radiance[chosen], fraction[chosen] = _reflected(
                    view, pixels, shadow_scale, reflection
                )
        return {"radiance": radiance * np.exp(-depth[active])[..., None], "fraction": fraction}

    sums = _by_replicate("surface", len(beams), plan, work, tell=tell, keep=keep)
    result[rows], _ = replicate_means(len(rows), known[rows], plan, sums)
    return result


@dataclass(frozen=True)
class _View:
    """How surface points look at a light: at which sections."""

    beam: Beam
    points: RayPoints  # of the unit square, by surface point
    turn: float  # [rad]
    even: bool  # see `sections_for_points`

    def seen(
        self, active: Index
    ) -> Iterator[tuple[Index, Array, tuple[Index, Array, Array], Array]]:
        """Yield which of the surface points of some rays see the light, these points, what
        `seen_samples` says of their sections in the order of points and of the square, and the mean
        of the weights of all sections of a point.
        """
        reference, light, each = self.beam.scene, self.beam.light, len(self.points)
        end = self.beam.distance[active]
        point = reference.origin + end[:, None] * reference.direction[active]
        away = point - light.centre
        metre = self.beam.known().shapes.metre(reference.origin, light.centre)
        # Only points before the emitting side have sections. A point closer to a sphere than 1e-5
        # of the radius touches it.
        if light.kind == "sphere":
            sees = np.linalg.norm(away, axis=1) > light.radius * (1 + 1e-5)
        elif light.kind == "mesh":
            sees = np.ones(len(away), bool)  # the samples say it, triangle by triangle
        else:
            largest = max(metre, float(np.abs(light.centre).max()))
            sees = away @ light.normal > IN_PLANE * largest
        seeing = np.flatnonzero(sees)
        # For its section a surface point is the light: what can stand between is looked for about a
        # ball that holds all of these points.
        middle = point.mean(axis=0) if len(point) else light.centre
        ball = Ball(middle, float(np.linalg.norm(point - middle, axis=1).max(initial=0.0)))
        around = replace(self.beam.known(), light=ball)
        step = max(1, _PAIRS // each)
        for first in range(0, len(seeing), step):
            rows = seeing[first : first + step]
            square = self.points[rows]
            sections = sections_for_points(light, point[rows], square, self.turn, self.even)
            # Sections are looked at from a little before the surface, 1e-6 of the way and of a
            # metre or a smaller scene: the surface must not hide the light from itself.
            eye = (
                reference.origin
                + (end - 1e-6 * (metre + end))[rows, None] * reference.direction[active[rows]]
            )
            eye = np.repeat(eye, each, axis=0)
            samples = seen_samples(
                sections, eye, around, np.repeat(active[rows], each), square[..., 1].ravel()
            )
            yield rows, point[rows], samples, sections.weight.reshape(-1, each)


def _partly_hidden(beam: Beam, active: Index, turn: float) -> NDArray[np.bool_]:
    """Return from which surface points a light is not seen as a whole, as a few sections say.

    None of a mesh, and of a sphere into which a shape reaches: these have no
    sections but short ones.
    """
    hidden, light = np.zeros(len(active), bool), beam.light
    whole_sphere = (
        light.kind == "sphere" and distance_to(beam.known().shapes, light.centre) >= light.radius
    )
    if light.kind in ("rectangle", "disk") or whole_sphere:
        # Eight sections at even azimuths, the same for all points, say whether a surface point sees
        # the light as a whole; the place drawn in a section does not matter.
        probes = 8
        square = np.stack([(np.arange(probes) + 0.5) / probes, np.full(probes, 0.5)], axis=1)
        points = RayPoints(square, np.zeros((len(active), REPLICATES, 2)), "")
        for rows, _, (row, _, weight), whole in _View(beam, points, turn, True).seen(active):
            visible = np.bincount(row, weight, whole.size).reshape(whole.shape)
            # 1e-6 of the solid angle of a section is rounding.
            hidden[rows] = (visible < (1 - 1e-6) * whole).any(axis=1)
    return hidden


def _reflected(
    view: _View, active: Index, shadow_scale: float, reflection: Reflection
) -> tuple[Array, Array]:
    """Return sums over samples of what surface points reflect, before what is
    between them and the camera.

    They are by replicate, (rays, 3, replicates). The second array says which fraction of the
    light's solid angle the sections of a point have, (rays, replicates) [1].
    """
    light, reference, each = view.beam.light, view.beam.scene, len(view.points)
    total, fraction = np.zeros((len(active), 3, REPLICATES)), np.ones((len(active), REPLICATES))
    for rows, point, (row, place, weight), whole in view.seen(active):
        # Even sections have a known total, the solid angle in closed form: the control variate. The
        # solid angle of a disk has no closed form here.
        if view.even and light.kind != "disk":
            means = whole.reshape(len(rows), REPLICATES, -1).mean(axis=2)
            fraction[rows] = means / solid_angle(light, point)[:, None]
        # `row` numbers sections, point by point; `of` numbers the rays of this call.
        of = rows[row // each]
        point = point[row // each]
        way = place - point
        r = np.linalg.norm(way, axis=1)
        towards = way / np.maximum(r, np.finfo(float).tiny)[:, None]
        # The place is on the disk that the tangents touch: the way through the medium ends at the
        # sphere.
        if light.kind == "sphere":
            r = to_sphere(light, point - light.centre, towards)
        value = reflection(active[of], towards)
        shadow = optical_depth(reference, point, towards, np.zeros(len(of)), shadow_scale * r)
        radiance = value * np.exp(-shadow) * weight[:, None] * light.radiance
        # The sections of a point are in the order of replicates.
        sums = sums_of(row * REPLICATES // each, radiance, len(rows) * REPLICATES)
        total[rows] = np.moveaxis(sums.reshape(len(rows), REPLICATES, 3), 1, 2)
    return total, fraction


def seen_samples(
    sections: Sections, eye: Array, known: Obstacles, of: Index, uniform: Array
) -> tuple[Index, Array, Array]:
    """Return which sections are seen, a sample of what is seen of each, and its solid
    angle; see `Sections.drawn`.

    `sections`: the sections; `eye`: where each is looked at from, in front of the surface point,
    (n, 3) [m]; `known`, `of`: what can stand between, and the number of the ray to the surface
    point in it, (n,); `uniform`: numbers from 0 to 1, (n,).
    """
    length = np.linalg.norm(sections.way, axis=1)
    rays = rays_at(
        sections.start, sections.way / np.maximum(length, np.finfo(float).tiny)[:, None], eye
    )
    lit = lit_intervals(rays, (0 * length, length), known, of=of, checks=0)
    # Sections count in fractions of their length, intervals in metres.
    of_length = length[lit.ray]
    return sections.drawn(replace(lit, low=lit.low / of_length, high=lit.high / of_length), uniform)
