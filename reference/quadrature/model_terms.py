# SPDX-License-Identifier: BSD-3-Clause
r"""The terms of a model in the quadrature: where the fog of a ray begins and ends, what attenuates,
and how lamps fall off.

The integral of a lamp, with the terms of `reference.scene.model`, in v = asinh((x - foot)/h),
r = h cosh v:

    int q(x) albedo sigma_t p/(4 pi) edge  r^2 f(r) w(r)  exp(-a tau_c - b tau_l - sigma_t M)  dv/(h cosh v).

**What stays analytic.** The panels of `analytic.panels` need an integrand that is analytic in
|Im v| < pi/2. The zeros of r^2 + e are at cosh v = +-i sqrt(e)/h, and the branch points of
sqrt(r^2 + R0^2) and of r^(2-d) at cosh v = +-i R0/h and cosh v = 0: all have |Im v| = pi/2, since
cosh(u + i y) is imaginary only where cos y = 0. There the light has its own singularity, and no
panel gets harder. The windows are polynomials in r up to R; the light is clipped there, as a panel
that reaches beyond may see no node of the lit part at all. A clamped law has a kink at r0, where
stretches are cut; so has a fade at its beginning and end.

**A light on the ray.** Where r^2 f(r) is 0 at r = 0 the airlight is finite for h = 0. It is
smooth in h there, and in v the lit part lies about v = asinh(l/h), l the length of the law. With
h >= 1e-9 l this is below 22, and the value changes by (h/l)^2 = 1e-18, or in a sharp lobe by 1e-9
at most of what lies within l of the light.

**Planar depth.** For a ray with the cosine c to the camera's axis the depth is z = c x: a tau_c
becomes a c tau_c, and dz = c dx a factor c. A plane at z is at x = z/c.

**Where the fog begins at x_n > 0** nothing attenuates before: the depth a tau(0, x_n) is taken out of
the exponent, by a factor on the ray.

**Sources without lights.** Along a stretch of one albedo,

    int albedo sigma_t A exp(-a tau_c) dx = albedo A (exp(-a tau_0) - exp(-a tau_1))/a,

or albedo A (tau_1 - tau_0) for a = 0. A constant source is C min(1 - exp(-a tau_c), cap).

**A lit density** has L = 1 - exp(-k X), and so an error of k exp(-k (X - dX)) dX at most.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from airlight.analytic.phase import Isotropic
from airlight.errors import InputError
from airlight.reference.quadrature.fields import optical_depth
from airlight.reference.quadrature.homogeneous import by_medium
from airlight.reference.quadrature.integrate import WHOLE, Paths, Profile, profile_of
from airlight.reference.quadrature.intervals import (
    Stretches,
    camera_segments,
    clipped,
    cut_at,
    cut_stretches,
)
from airlight.reference.scene.directional_light import DirectionalLight
from airlight.reference.scene.homogeneous_medium import ReferenceMedium
from airlight.reference.scene.model import Law, Model, Range
from airlight.reference.scene.point_light import ReferenceLight
from airlight.reference.scene.read import ReferenceScene
from airlight.reference.scene.varying import HeightMedium, VaryingMedium
from airlight.reference.visibility.distances import half_chord
from airlight.reference.visibility.planes import Rays, axis_versine, spot_edge, versine

Array = NDArray[np.float64]
Weight = Callable[[Array], Array]

_FARTHEST = 1e30  #: beyond all bounds of media [m]


@dataclass(frozen=True)
class Route:
    """Where the fog of rays begins and ends for a model, arrays of shape (rays,)."""

    start: Array  #: [m]
    end: Array  #: may be infinite [m]
    paths: Paths = WHOLE  #: which fractions of the depths attenuate
    #: cosines of rays to the camera's axis where depth is planar, else 1
    slant: Array | None = None
    cut: bool = False  #: whether it begins or ends elsewhere than at camera and surface
    faded: Array | float = np.inf  #: from where on its fade is 0 [m]

    @property
    def steps(self) -> Array | float:
        """The steps of the ray that a metre counts as, (rays, 1) [1]."""
        return 1.0 if self.slant is None else self.slant[:, None]

    @property
    def camera(self) -> Array:
        """The fraction of the depth to the camera, as a column [1]."""
        return np.reshape(self.paths.camera, (-1, 1))

    def clipped(self, stretches: Stretches) -> Stretches:
        """Return the parts of stretches in the fog."""
        end = np.minimum(self.end, self.faded)
        return clipped(stretches, self.start, end) if self.cut else stretches


def route_of(reference: ReferenceScene, distance: Array) -> Route:
    """Return where the fog of rays begins and ends; `distance`: to visible surfaces, (rays,) [m].

    Raises InputError for suns whose light would add up without end.
    """
    model, start = reference.model, np.zeros(len(distance))
    if model.is_physical:
        return Route(start, distance)
    cosine, end = reference.direction @ reference.axis, distance
    # A depth that is taken for a distance, or a distance for a depth.
    if model.depth == "axis-ends":
        end = cosine * distance
    elif model.depth == "axis-lookup":
        end = distance / cosine
    # Planes lie further out on slanted rays.
    ends = model.ends_of
    slant = cosine if ends.planes else 1.0
    start, end = start + ends.near / slant, np.minimum(end, ends.far / slant)
    faded = np.inf if model.fade_of is None else model.fade_of[1] / cosine
    _check_suns(reference, np.minimum(end, faded))
    planar = model.depth == "axis"
    camera = model.camera_scale * cosine if planar else model.camera_scale
    return Route(
        start,
        np.maximum(end, start),
        Paths(camera, model.light_scale, model.light_length),
        cosine if planar else None,
        cut=True,
        faded=faded,
    )


def _check_suns(reference: ReferenceScene, end: Array) -> None:
    """Refuse suns whose light no path to the camera attenuates, on rays that stay in the fog."""
    model, medium = reference.model, reference.medium
    if not reference.directional or not model.factors[1] or model.constant or model.camera_scale:
        return
    stays = np.isinf(end)
    if isinstance(medium, ReferenceMedium):
        stays &= bool(np.any(medium.sigma_t * medium.albedo > 0))
    elif isinstance(medium, HeightMedium):  # a level ray, at a height with fog
        height = float(reference.origin @ medium.up)
        stays &= (reference.direction @ medium.up == 0) & (medium.floor <= height <= medium.cap)
    else:
        return
    if stays.any():
        raise InputError(
            "model: camera-path is off, so that a sun in a medium without bounds adds light without "
            "end; expected an end of the fog, such as ends=spheres:0:100"
        )


# --- lamps ----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class LampTerms:
    """How lamps of a model shine in the fog."""

    rays: Rays  #: in their planes, off the light where the law is finite
    stretches: Stretches  #: in the fog and in the range, cut where the law has kinks
    profile: Profile | None  #: the edge of a spot and the fade; None for 1
    law: Weight | None  #: r^2 f(r) w(r), by the distance [m]; None for 1


def lamp_terms(
    reference: ReferenceScene, light: ReferenceLight, rays: Rays, stretches: Stretches, route: Route
) -> LampTerms:
    """Return how a lamp shines on its lit stretches."""
    model, law = reference.model, reference.model.law_of(surface=False)
    cuts = [each for each in (_kink(law), model.range_of and model.range_of.end) if each]
    stretches = route.clipped(stretches)
    for radius in cuts:
        stretches = cut_at(rays, stretches, radius)
    if model.range_of is not None:
        half = half_chord(model.range_of.end, rays.height)
        stretches = clipped(stretches, rays.foot - half, rays.foot + half)
    if model.fade_of is not None:
        cosine = (reference.direction @ reference.axis)[stretches[0]]
        stretches = cut_stretches(stretches, *(place / cosine for place in model.fade_of))
    # A light on the ray: the least height of the derivation.
    if law.is_finite:
        rays = replace(rays, height=np.maximum(rays.height, 1e-9 * law.length))
    profile = _faded(reference, edge_profile(model, light, rays))
    return LampTerms(rays, stretches, profile, law_weight(law, model.range_of))


def of_lamps(reference: ReferenceScene) -> ReferenceScene:
    """Return the scene as lamps see it: without a phase function where the model says so."""
    if reference.model.phase != "none":
        return reference
    bare = Isotropic()
    return replace(
        reference,
        medium=replace(reference.medium, phase=bare),
        media=tuple(replace(medium, phase=bare) for medium in reference.media),
    )


def law_weight(law: Law, window: Range | None) -> Weight | None:
    """Return r^2 f(r) w(r) as a function of the distance [m]; None where it is 1."""
    if law.is_physical and window is None:
        return None

    def weight(r: Array) -> Array:
        # By ratios, whose squares do not overflow where r is large or small.
        with np.errstate(divide="ignore", over="ignore"):
            if law.is_physical:
                value = np.ones_like(r)
            elif law.kind == "softened":
                value = law.scale / (1 + np.square(law.length / r))
            elif law.kind == "sphere":
                ratio = 1 + np.square(law.length / r)
                value = 2 / (ratio + np.sqrt(ratio))
            elif law.kind == "clamped":
                value = np.square(r) * np.maximum(r, law.length) ** -law.power
            else:
                value = r ** (2 - law.power)
            return value if window is None else value * window_of(window, r)

    return weight


def window_of(window: Range, r: Array) -> Array:
    """Return w(r) [1]."""
    s = np.minimum(r / window.end, 1.0)
    if window.kind == "quartic":
        return np.square(1 - s**4)
    if window.kind == "fourth":
        return 1 - s**4
    if window.kind == "square":
        return np.square(1 - s**2)
    return 1 - s if window.kind == "linear" else (r <= window.end).astype(np.float64)


def largest_law(reference: ReferenceScene, rays: Rays) -> Array:
    """Return the largest r^2 f(r) along rays, (rays,) [1]."""
    model = reference.model
    law = model.law_of(surface=False)
    weight = law_weight(law, None)
    if weight is None:
        return np.ones_like(rays.height)
    # All laws are monotone but for the kink of a clamped one; 1e6 m is far for a law that grows.
    farthest = np.maximum(rays.height, model.range_of.end if model.range_of else 1e6)
    inner = np.clip(_kink(law), rays.height, farthest)
    return np.max([weight(rays.height), weight(farthest), weight(inner)], axis=0)


def _kink(law: Law) -> float:
    return law.length if law.kind == "clamped" else 0.0


def edge_profile(model: Model, light: ReferenceLight, rays: Rays) -> Profile | None:
    """Return intensity over that on the axis along rays; None where it is 1."""
    kind, power = model.spot_of
    if kind == "angle" or light.axis is None or light.cosine:
        return profile_of(light, rays)
    axis = light.axis

    def profile(x: Array, ray: NDArray[np.int64]) -> Array:
        theta = np.arctan2(x - rays.foot[ray, None], rays.height[ray, None])
        return edge(kind, power, axis_versine(theta, rays[ray], axis), light)

    return profile


def edge(kind: str, power: float, versine: Array, light: ReferenceLight) -> Array:
    """Return intensity over that on the axis by 1 - cos of the angle to it [1]."""
    # 1 - cos = 2 sin^2(angle/2) keeps its digits near the axis.
    beam, cutoff = (2 * np.sin(0.5 * angle) ** 2 for angle in (light.beam, light.cutoff))
    if kind == "angle":
        return spot_edge(versine, light)
    if kind == "rim":
        return 1 - np.minimum(versine / cutoff, 1.0) ** power
    if not beam < cutoff:  # a hard spot keeps its edge
        return (versine <= cutoff).astype(np.float64)
    t = np.clip((cutoff - versine) / (cutoff - beam), 0.0, 1.0)
    return t * t if kind == "cosine-squared" else t * t * (3 - 2 * t)


def _faded(reference: ReferenceScene, profile: Profile | None) -> Profile | None:
    """Return a profile times the fade of a model."""
    fade = fade_along(reference)
    if fade is None or profile is None:
        return profile or fade
    return lambda x, ray: profile(x, ray) * fade(x, ray)


def fade_along(reference: ReferenceScene) -> Profile | None:
    """Return q along rays; None where it is 1."""
    if reference.model.fade_of is None:
        return None
    full, end = reference.model.fade_of
    cosine = reference.direction @ reference.axis
    # It is 0 behind its end, and above 1 before its beginning.
    return lambda x, ray: np.maximum((end - cosine[ray, None] * x) / (end - full), 0.0)


# --- factors of rays, and sources without lights ---------------------------------------------------


def ray_factor(reference: ReferenceScene, route: Route) -> Array | float:
    """Return the factor of the light of the fog of each ray, (rays, 3) or 1."""
    model = reference.model
    if model.is_physical:
        return 1.0
    before = _depth(reference, np.zeros_like(route.start), route.start)
    return np.exp(route.camera * before) * route.steps


def depth_of_behind(reference: ReferenceScene, route: Route) -> Array:
    """Return the depth that attenuates what lies behind the fog of a ray, (rays, 3) [1]."""
    scale = reference.model.surface_paths[0] * route.steps
    depth = scale * _depth(reference, route.start, route.end)
    # A source that covers no more than its cap leaves the rest of what is behind it.
    most = reference.model.most
    return np.minimum(depth, -np.log1p(-most)) if most < 1 else depth


def _depth(reference: ReferenceScene, low: Array, high: Array) -> Array:
    return optical_depth(
        reference, reference.origin, reference.direction, low, np.minimum(high, _FARTHEST)
    )


def with_sources(
    reference: ReferenceScene, route: Route, airlight: Array, error: Array
) -> tuple[Array, Array]:
    """Return the airlight of a model and its error, (rays, 3) each, from those of lights."""
    model = reference.model
    if model.is_physical:
        return airlight, error
    more = np.zeros_like(airlight)
    if model.ambient_of is not None:
        more += np.array(model.ambient_of) * _scattered(reference, route)
    if model.constant is not None:
        opacity = -np.expm1(-route.camera * _depth(reference, route.start, route.end))
        more += np.array(model.constant) * np.minimum(opacity, model.most)
        more += _lobes(reference, route)
    if model.lit_scale is not None:
        k = model.lit_scale
        least = np.maximum(airlight - error, 0.0)
        with np.errstate(invalid="ignore"):  # a light on the ray lights its density without end
            error = np.where(np.isinf(airlight), 0.0, k * np.exp(-k * least) * error)
        airlight = -np.expm1(-k * airlight)
    # Closed forms: 64 roundings of their depths, which are 745 at most where light is left.
    return airlight + more, error + 64 * np.finfo(float).eps * more


def _scattered(reference: ReferenceScene, route: Route) -> Array:
    """Return int albedo sigma_t exp(-a tau_c) dx along rays, (rays, 3) [1]."""
    count = len(route.start)
    if isinstance(reference.medium, VaryingMedium):
        spans = [(np.zeros(count), np.full(count, np.inf), reference.medium.albedo)]
    else:
        segments = camera_segments(reference, route.end)
        spans = [
            (start, end, by_medium(reference, "albedo", medium))
            for start, end, medium in zip(segments.start, segments.end, segments.medium)
        ]
    total, scale = np.zeros((count, 3)), route.camera
    for start, end, albedo in spans:
        low = np.clip(start, route.start, route.end)
        high = np.clip(end, low, np.maximum(route.end, low))
        # From where the fog begins on; a depth that is infinite leaves nothing.
        before, whole = (_depth(reference, route.start, each) for each in (low, high))
        depth = whole - before
        # By expm1, so that thin parts keep their digits; 0 times an infinite depth is no number.
        with np.errstate(divide="ignore", invalid="ignore"):
            fallen = np.exp(-scale * before) * -np.expm1(-scale * depth) / scale
            total += albedo * np.where(scale > 0, fallen, depth)
    return total * route.steps


def _lobes(reference: ReferenceScene, route: Route) -> Array:
    """Return what the lobes about suns add, (rays, 3) [W/(m^2 sr)]."""
    lobe, total = reference.model.lobe_of, np.zeros((len(route.start), 3))
    if lobe is None:
        return total
    # It has a beginning of its own, on rays that reach the fog.
    begin = np.full_like(route.start, lobe.start)
    end = np.where(route.end > route.start, np.maximum(route.end, begin), begin)
    opacity = -np.expm1(-route.camera * _depth(reference, begin, end))
    for sun in reference.directional:
        towards = np.maximum(reference.direction @ -sun.direction, 0.0)
        total += (towards**lobe.power)[:, None] * sun.irradiance * opacity
    return total


def strength_of(reference: ReferenceScene, light: ReferenceLight | DirectionalLight) -> float:
    """Return the factor on a light in the fog."""
    lamps, suns, _ = reference.model.factors
    if reference.model.constant is not None:
        return 0.0
    if isinstance(light, DirectionalLight):
        return suns
    # A lamp without a phase function: 4 pi times an isotropic one.
    return lamps * (4 * np.pi if reference.model.phase == "none" else 1.0)


# --- surfaces --------------------------------------------------------------------------------------


def surface_strength(
    reference: ReferenceScene, light: ReferenceLight | DirectionalLight, point: Array
) -> Array:
    """Return the factor on what surface points reflect of a light, (points,) [1]."""
    model = reference.model
    factor = np.full(len(point), model.factors[2])
    if isinstance(light, DirectionalLight):
        return factor
    way = point - light.position
    r = np.maximum(np.linalg.norm(way, axis=1), np.finfo(float).tiny)
    weight = law_weight(model.law_of(surface=True), model.range_of)
    if weight is not None:
        factor = factor * weight(r)
    kind, power = model.spot_of
    if kind != "angle" and light.axis is not None:
        cosine = (way @ light.axis) / r
        squared_sine = np.sum(np.cross(way, light.axis) ** 2, axis=1) / r**2
        off_axis = versine(cosine, squared_sine)
        # Mitsuba's light has its own edge, which is taken out where there is light at all.
        own, asked = edge("angle", 1.0, off_axis, light), edge(kind, power, off_axis, light)
        factor = factor * np.where(own > 0, asked / np.where(own > 0, own, 1.0), 0.0)
    return factor
