# SPDX-License-Identifier: BSD-3-Clause
"""Faults of the physics, one at a time, that the comparisons of the estimators must find.

A fault is given as hooks and patterns (`tests.evidence.injected`), most of them at what one part of
an estimator hands to the next: the scene that was read, lit intervals, the integrals over them, the
points of a light. `stage` is the scene on which the fault must be found. The margins of a stage are
those of `tests.evidence.stages`.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from airlight.reference.monte_carlo.single_scatter.distance_sampling import mixture_pdfs
from airlight.reference.scene.read import ReferenceScene
from tests.evidence.injected import Change, Put, Rewrite, Wrap

_MEDIA = "airlight.reference.quadrature.homogeneous"
_FIELD = f"{_MEDIA}:HomogeneousField.sums"
_SAMPLES = "airlight.reference.quadrature.light_samples"
_WEIGHTED = "airlight.reference.quadrature.area_lights"
_SHADOWS = "airlight.reference.visibility.shadows"
_TRACED = "airlight.reference.monte_carlo.single_scatter"
_ESTIMATOR, _SOURCES = f"{_TRACED}.estimator", f"{_TRACED}.sources"
_FOUR_PI = 4 * np.pi


@dataclass(frozen=True)
class Mutation:
    """One fault."""

    name: str
    estimator: str  # 'quadrature', 'single-scatter', or 'all': what they share
    stage: str  # the scene on which it must be found
    change: Change


# --- Hooks of the quadrature ---


def _sums(change: Callable[..., Any]) -> Wrap:
    """Change the airlight of one light: change(medium, radiance)."""

    def around(function, reference, *others, **named):
        radiance, bound = function(reference, *others, **named)
        return change(reference.medium, radiance), bound

    return Wrap("airlight.reference.quadrature.light_airlight:lit_sums", around)


def _brighter(factor: float) -> Wrap:
    return _sums(lambda medium, radiance: radiance * factor)


def _first_extinction(function, reference, *others, **named):
    medium = reference.medium
    first = replace(reference, medium=replace(medium, sigma_t=np.full(3, medium.sigma_t[0])))
    return tuple(
        values * medium.sigma_t / medium.sigma_t[0] for values in function(first, *others, **named)
    )


def _stretches(change: Callable[..., Any]) -> Wrap:
    """Change what homogeneous media are asked: change(rays, x0, x1, sigma_t) -> other
    ends of the lit stretches.
    """

    def around(function, field, rays, stretches, distance, terms):
        ray, x0, x1 = stretches
        x0, x1 = change(rays, x0, x1, field.reference.medium.sigma_t[0])
        return function(field, rays, (ray, x0, np.maximum(x0, x1)), distance, terms)

    return Wrap(_FIELD, around)


def _terms(change: Callable[..., Any]) -> Wrap:
    """Change how lights shine: change(terms, rays, sigma_t) -> changes of the terms."""

    def around(function, field, rays, stretches, distance, terms):
        terms = replace(terms, **change(terms, rays, field.reference.medium.sigma_t[0]))
        return function(field, rays, stretches, distance, terms)

    return Wrap(_FIELD, around)


def _times(weight: Callable[..., Any]) -> Wrap:
    """Multiply the integrand: weight(x, foot, height, sigma_t)."""

    def change(terms, rays, sigma_t):
        before = terms.profile or (lambda x, ray: 1.0)
        return {
            "profile": lambda x, ray: (
                before(x, ray) * weight(x, rays.foot[ray, None], rays.height[ray, None], sigma_t)
            )
        }

    return _terms(change)


def _phase(name: str, change: Callable[..., Any]) -> Wrap:
    """Change a phase function: change(value, g)."""

    def around(function, self, down, up):
        value = function(self, down, up)
        return change(value, getattr(self, "g", 0.0)) if self.name == name else value

    return Wrap("airlight.analytic.phase:PhaseFunction.from_half", around)


_BACKWARD = Wrap(
    "airlight.analytic.phase:PhaseFunction.from_half",
    lambda function, self, down, up: function(self, up, down),
)


def _read(change: Callable[[ReferenceScene], ReferenceScene]) -> Wrap:
    return Wrap(
        "airlight.reference.scene.read:read_reference",
        lambda function, scene: change(function(scene)),
    )


def _spots(change: Callable[..., Any]) -> Wrap:
    def around(function, emitter):
        light = function(emitter)
        return light if light.axis is None or light.cutoff > 3 else change(light)

    return Wrap("airlight.reference.scene.read:read_point_light", around)


def _wide(light, cutoff: float):
    return replace(light, cutoff=cutoff, beam=min(light.beam, cutoff))


def _linear_in_cosine(function, theta, rays, light):
    value = function(theta, rays, light)
    if not light.is_soft or light.cosine:
        return value
    cosine = np.cos(light.cutoff - value * (light.cutoff - light.beam))
    return (cosine - np.cos(light.cutoff)) / (np.cos(light.beam) - np.cos(light.cutoff))


def _one_light(function, reference, light, *others, **named):
    found = function(reference, light, *others, **named)
    return found if light is reference.lights[0] else replace(found, radiance=0 * found.radiance)


def _lit(change: Callable[..., Any]) -> Wrap:
    """Change the lit intervals: change(intervals of a ray, ends of the ray) -> its
    intervals, angles at the light.
    """

    def around(function, rays, ends, known, **how):
        found = function(rays, ends, known, **how)
        first, last = (rays.theta(end) for end in ends)
        begin, end = (rays.theta(x, found.ray) for x in (found.low, found.high))
        parts = []
        for ray in np.flatnonzero(ends[1] > ends[0]):
            of_ray = list(zip(begin[found.ray == ray], end[found.ray == ray]))
            parts += [
                (ray, low, high)
                for low, high in change(of_ray, first[ray], last[ray])
                if high > low
            ]
        ray, low, high = np.array(parts, dtype=float).reshape(-1, 3).T
        ray = ray.astype(np.int64)
        return replace(found, ray=ray, low=rays.distance(low, ray), high=rays.distance(high, ray))

    return Wrap("airlight.reference.visibility.lit_intervals:lit_intervals", around)


def _complement(lit, low, high):
    places = [low, *(end for part in lit for end in part), high]
    return list(zip(places[::2], places[1::2]))


def _coarse(lit, low, high):
    """Return lit intervals without gaps, and without parts, below a hundredth of the ray."""
    least, merged = 0.01 * (high - low), []
    for begin, end in lit:
        if merged and begin - merged[-1][1] < least:
            merged[-1] = (merged[-1][0], end)
        else:
            merged.append((begin, end))
    return [(begin, end) for begin, end in merged if end - begin > least]


def _shifted(lit, low, high):
    return [(a + 0.01 * (a > low), min(high, b + 0.01 * (b < high))) for a, b in lit]


def _behind(function, reference, light, rays, lit, *others, **named):
    high = np.where(rays.foot[lit.ray] > 0, lit.high, lit.low)
    return function(reference, light, rays, replace(lit, high=high), *others, **named)


def _surface(change: Callable[..., Any]) -> Wrap:
    """Change the lit surface: change(function, reference, hits, named) -> radiance."""

    def around(function, reference, hits, route, **named):
        def radiance(reference, hits, **changed):
            return function(reference, hits, route, **changed)[0]

        changed = change(radiance, reference, hits, named)
        return changed, np.zeros_like(changed)

    return Wrap("airlight.reference.quadrature.surface:lit_surface", around)


def _of_model(name: str, around: Callable[..., Any]) -> Wrap:
    """Change a function of the terms of a model."""
    return Wrap(f"airlight.reference.quadrature.model_terms:{name}", around)


def _without_cosine(function, reference, hits, named):
    (light,) = reference.lights
    towards = hits.interaction.to_local(
        dr.normalize(mi.Point3f(*map(float, light.position)) - hits.interaction.p)
    )
    cosine = np.array(mi.Frame3f.cos_theta(towards), dtype=float)[:, None]
    return function(reference, hits, **named) / np.where(np.abs(cosine) > 0, cosine, 1)


def _to_camera(reference, hits):
    return (
        np.where(np.isfinite(hits.distance), hits.distance, 0)[:, None] * reference.medium.sigma_t
    )


def _no_shadow_segment(function, reference, hits, named):
    return function(reference, hits, **named | {"shadow_scale": 0.0})


def _all_reached(function, reference, hits, named):
    everywhere = [np.ones(len(hits.distance), bool)] * len(reference.lights)
    return function(reference, hits, **named | {"reached": everywhere})


def _sun(change: Callable[..., Any]) -> Wrap:
    """Change what hides a directional light: change(lists of shapes near rays)."""
    return Wrap(
        f"{_SHADOWS}:lit_parts",
        lambda function, rays, ends, near, shapes, of: function(
            rays, ends, change(near), shapes, of
        ),
    )


def _none(lists):
    return lists[0], lists[0], lists[2]


def _samples(change: Callable[..., Any]) -> Wrap:
    """Change the samples of area lights along rays: change(samples, light)."""
    return Wrap(
        f"{_SAMPLES}:samples_for_rays",
        lambda function, light, *arguments: change(function(light, *arguments), light),
    )


def _weighted(factor: Callable[..., float]) -> Wrap:
    return _samples(lambda samples, light: replace(samples, weight=samples.weight * factor(light)))


def _for_points(function, *arguments):
    samples = function(*arguments)
    return replace(samples, weight=2 * samples.weight)


def _through_everything(function, sections, eye, known, *others):
    no_spheres, no_disks = np.empty((0, 3)), replace(known.shapes.disks, radius=np.empty(0))
    shapes = replace(
        known.shapes,
        triangles=np.empty((0, 3, 3)),
        centre=no_spheres,
        radius=np.empty(0),
        disks=no_disks,
    )
    return function(sections, eye, replace(known, shapes=shapes), *others)


def _one_too_few(function, *arguments, plan, **named):
    found = function(*arguments, plan=plan, **named)
    return replace(found, replicates=found.replicates * plan.most / (plan.most - 1))


def _own_shape(function, reference, light):
    scene, shapes = function(reference, replace(light, shape=None))
    return scene, shapes


def _sorted(emitters_are_opaque: bool) -> Wrap:
    def around(function, scene):
        opaque, boundaries = function(scene)
        emitters = [shape for shape in scene.shapes() if shape.is_emitter()]
        others = [shape for shape in opaque if not shape.is_emitter()]
        return [*others, *emitters] if emitters_are_opaque else others, boundaries

    return Wrap("airlight.reference.scene.read:sorted_shapes", around)


# --- Hooks of single-scatter ---


def _segment(change: Callable[..., Any]) -> Wrap:
    """Change the attenuation between light and point: change(media)."""
    return Wrap(
        f"{_TRACED}.boundary_walk:transmittance",
        lambda function, *arguments, media, **named: function(
            *arguments, media=change(media), **named
        ),
    )


def _one_technique(function, u, mixture):
    y, _ = function(u, mixture)
    return y, mixture_pdfs(y, mixture)[0]


def _equal_cells(function, number, shift, count):
    low, _ = function(number, shift, count)
    return low, mi.Float(1 / (count - 1))


def _clear_segment(function, *arguments, **named):
    return dr.select(function(*arguments, **named) > 0, mi.Spectrum(1), mi.Spectrum(0))


#: The way from the camera to a sample left out, and the scattering angle turned
#: round, whatever the light.
_BRIGHT_CAMERA_SEGMENT = Rewrite(
    _ESTIMATOR,
    "part.transmittance(sample.x, a_, b_, c_, d_, e_)",
    "part.transmittance(part.start, a_, b_, c_, d_, e_)",
)
_TRACED_BACKWARD = Rewrite(
    f"{_TRACED}.stretches",
    "phase_.eval_pdf(context_, point_, towards, on_)",
    "phase_.eval_pdf(context_, point_, -towards, on_)",
)


# --- Hooks of what all estimators share: the camera ---


def _film(change: Callable[..., Any]) -> Wrap:
    """Change the positions on the film through which rays go: change(x, y, width,
    height), from the middle.
    """

    def around(function, sensor, positions, size):
        middle = 0.5 * np.array(size, dtype=float)
        return function(sensor, middle + change(positions - middle), size)

    return Wrap("airlight.reference.scene.camera:film_directions", around)


def _stepped(function, sensor):
    matrix = function(sensor).copy()
    matrix[:3, 3] += 0.01 * matrix[:3, 2]
    return matrix


def _all(estimator: str, stage: str, changes: dict[str, Change]) -> tuple[Mutation, ...]:
    return tuple(Mutation(name, estimator, stage, change) for name, change in changes.items())


_FOG = _all(
    "quadrature",
    "many-lights",
    {
        "no-four-pi": _brighter(_FOUR_PI),
        "four-pi-twice": _brighter(1 / _FOUR_PI),
        "extinction-for-scattering": _sums(lambda medium, radiance: radiance / medium.albedo),
        "albedo-squared": _sums(lambda medium, radiance: radiance * medium.albedo),
        "one-extinction": Wrap(
            "airlight.reference.quadrature.light_airlight:lit_sums", _first_extinction
        ),
        "one-per-cent": _brighter(1.01),
        "three-per-mille": _brighter(1.003),
        "one-per-mille": _brighter(1.001),
        "bright-shadow-segment": _terms(lambda *_: {"shadow_scale": 0.0}),
        "bright-camera-segment": _times(
            lambda x, foot, height, sigma_t: np.exp(np.minimum(sigma_t * x, 600.0))
        ),
        "distance-not-squared": _times(lambda x, foot, height, sigma_t: np.hypot(x - foot, height)),
        "end-at-one-optical-depth": _stretches(
            lambda rays, x0, x1, sigma_t: (x0, np.minimum(x1, 1 / sigma_t))
        ),
        "near-clip": _stretches(lambda rays, x0, x1, sigma_t: (np.maximum(x0, 0.2), x1)),
        "near-segment-skipped": _stretches(
            lambda rays, x0, x1, sigma_t: (x0, np.where(x0 > 0, x1, x0))
        ),
        "forward-is-backward": _BACKWARD,
        "henyey-greenstein-of-two": _phase("hg", lambda value, g: 2 * value),
        "henyey-greenstein-squared": _phase(
            "hg", lambda value, g: (1 - g * g) * (value / (1 - g * g)) ** (2 / 3)
        ),
        "radians-for-degrees": _spots(lambda light: _wide(light, np.rad2deg(light.cutoff) % np.pi)),
        "wide-spot": _spots(lambda light: _wide(light, 2 * light.cutoff)),
        "falloff-in-the-cosine": Wrap(
            "airlight.reference.visibility.planes:falloff", _linear_in_cosine
        ),
        "hard-spot": Wrap(
            "airlight.reference.visibility.planes:falloff",
            lambda function, theta, *others: np.ones_like(theta),
        ),
        "first-light-only": Wrap(
            "airlight.reference.quadrature.light_airlight:light_airlight", _one_light
        ),
        "no-light-behind": Wrap("airlight.reference.quadrature.light_airlight:lit_sums", _behind),
        "shadow-for-light": _lit(_complement),
        "no-shadows": _lit(lambda lit, low, high: [(low, high)]),
        "no-sphere-shadows": Wrap(
            f"{_SHADOWS}:_sphere",
            lambda function, *arguments: (mi.Float64(dr.inf), mi.Float64(-dr.inf)),
        ),
        "through-surfaces": Wrap(
            "airlight.reference.quadrature.light_airlight:light_airlight",
            lambda function, reference, light, distance, **how: function(
                reference, light, distance + np.inf, **how
            ),
        ),
        "surface-bright-shadow-segment": _surface(_no_shadow_segment),
        "surface-bright-camera-segment": _surface(
            lambda function, reference, hits, named: (
                function(reference, hits, **named) * np.exp(_to_camera(reference, hits))
            )
        ),
        "surface-wrong-segment": _surface(
            lambda function, reference, hits, named: (
                _no_shadow_segment(function, reference, hits, named)
                * np.exp(-_to_camera(reference, hits))
            )
        ),
        "surface-without-shadows": _surface(_all_reached),
    },
)

_MESHES = _all(
    "quadrature",
    "two-pens",
    {
        "edges-shifted": _lit(_shifted),
        "thin-shadows-missed": _lit(_coarse),
        "last-tenth-missed": Rewrite(_SHADOWS, "y1 >= 0", "y1 >= 0.1 * top"),
        "surface-without-cosine": _surface(_without_cosine),
    },
)

_RAYLEIGH = _all(
    "quadrature",
    "rayleigh",
    {
        "rayleigh-of-two": _phase("rayleigh", lambda value, g: 2 * value),
        "rayleigh-without-lobes": _phase("rayleigh", lambda value, g: np.ones_like(value)),
    },
)

_SUN = _all(
    "quadrature",
    "sun",
    {
        "directional-without-four-pi": Wrap(
            _FIELD,
            lambda function, *arguments, **named: tuple(
                _FOUR_PI * part for part in function(*arguments, **named)
            ),
        ),
        "directional-bright-segment": Rewrite(
            _MEDIA, "body_.length(rows_, x_, r_, limit_)", "0 * body_.length(rows_, x_, r_, limit_)"
        ),
        "directional-chord-both-ways": Rewrite(_MEDIA, "np.maximum(enter, 0.0)", "enter"),
        "directional-forward-is-backward": _BACKWARD,
        "directional-corners-behind": Rewrite(
            "airlight.reference.quadrature.intervals",
            "(y_ > 0) & (w_ * y_ < height_)",
            "(y_ < 0) & (w_ * y_ < height_)",
        ),
        "directional-shadows-leaning-back": Rewrite(
            _SHADOWS, "z * self.height - y * self.foot", "z * self.height + y * self.foot"
        ),
        "directional-no-shadows": _sun(lambda near: replace(near, triangles=_none(near.triangles))),
        "directional-no-sphere-shadows": _sun(
            lambda near: replace(near, spheres=_none(near.spheres))
        ),
        "directional-surface-bright-segment": Rewrite(
            "airlight.reference.quadrature.surface",
            "depth + light_scale * to_light",
            "depth",
        ),
    },
)

_WIDE = _all(
    "quadrature",
    "wide-lights",
    {
        "area-without-cosine": _terms(lambda *_: {"profile": None}),
        "area-other-side": _samples(
            lambda samples, light: replace(samples, normal=-samples.normal)
        ),
        "area-wrong-count": Wrap(f"{_WEIGHTED}:area_airlight", _one_too_few),
        "area-projected-sphere": _weighted(lambda light: 0.25 if light.kind == "sphere" else 1.0),
        "area-half-sides": _weighted(lambda light: 0.25 if light.kind == "rectangle" else 1.0),
        "area-power-for-intensity": _weighted(lambda light: np.pi),
        "area-radiance-for-intensity": _weighted(lambda light: 1 / light.area),
        "area-sphere-evenly": Rewrite(
            _SAMPLES,
            "radius_ * h_ * (high_ - low_) * rate_",
            "radius_ * radius_ * (high_ - low_) * rate_",
        ),
        "area-sections-of-one-length": Rewrite(
            _SAMPLES,
            "h_ * np.hypot(a_, b_) * per_density_",
            "h_ * np.hypot(a_, b_).mean() * per_density_",
        ),
        "area-shadows-itself": Wrap(
            "airlight.reference.visibility.lit_intervals:before_light", _own_shape
        ),
        "area-null-is-opaque": _sorted(True),
        "area-black-is-clear": _sorted(False),
        "area-surface-both-sides": Wrap(
            "airlight.reference.quadrature.light_sections:sections_for_points", _for_points
        ),
        "area-surface-bright-segment": Rewrite(
            _WEIGHTED, "value_ * np.exp(-shadow_) * weight_[:, None]", "value_ * weight_[:, None]"
        ),
        "area-surface-without-shadows": Wrap(
            "airlight.reference.quadrature.area_lights:seen_samples", _through_everything
        ),
    },
)

_TRACED_FOG = _all(
    "single-scatter",
    "many-lights",
    {
        "equi-angular-without-height": Rewrite(
            _TRACED,
            "0.5 * h_ / (range_ * (h_ * h_ + s_ * s_))",
            "0.5 / (range_ * (h_ * h_ + s_ * s_))",
        ),
        "free-flight-not-truncated": Rewrite(
            _TRACED, "flight_.rate * scale_ * survival_", "flight_.rate * survival_"
        ),
        "no-weights": Wrap(f"{_TRACED}.distance_sampling:sample_distance", _one_technique),
        "equal-cells": Wrap(f"{_TRACED}.stretches:cell_of", _equal_cells),
        "traced-distance-not-squared": Rewrite(
            _SOURCES, "1 / (square_ * density_)", "1 / (dr.sqrt(square_) * density_)"
        ),
        "traced-bright-shadow-segment": _segment(
            lambda media: replace(media, end_sigma_t=0 * media.end_sigma_t)
        ),
        "traced-bright-camera-segment": _BRIGHT_CAMERA_SEGMENT,
        "segment-before-the-cone-forgotten": Rewrite(
            _SOURCES,
            "Sample(low_ + y_, a_, b_, c_, d_, e_)",
            "Sample(part.start + y_, a_, b_, c_, d_, e_)",
        ),
        "traced-forward-is-backward": _TRACED_BACKWARD,
        "traced-extinction-for-scattering": Rewrite(
            _ESTIMATOR,
            "sigma_s_ * phase_ * sample.value * kept_ * width_",
            "part.sigma_t * phase_ * sample.value * kept_ * width_",
        ),
        "traced-surface-not-squared": Rewrite(
            _SOURCES,
            "self.sent(light_, hit_, way_) / (r_ * r_)",
            "self.sent(light_, hit_, way_) / r_",
        ),
        "traced-surface-bright-camera-segment": Rewrite(
            _ESTIMATOR,
            "part.transmittance(x, hit, a_, b_, c_, d_)",
            "part.transmittance(part.start, hit, a_, b_, c_, d_)",
            times=2,  # of diffuse surfaces and of mirrors
        ),
    },
)

_TRACED_MESHES = _all(
    "single-scatter",
    "two-pens",
    {
        "traced-shadow-epsilon": _segment(
            lambda media: replace(media, end_sigma_t=(1 - 8.94e-4) * media.end_sigma_t)
        ),
        "traced-short-shadow-rays": Put(f"{_TRACED}.boundary_walk:_SHORT_OF_POINT", 0.1),
    },
)

_TRACED_SUN = _all(
    "single-scatter",
    "sun",
    {
        "traced-directional-uniform-density": Rewrite(
            _TRACED, "0.5 / length_ + share_ * sum(pdfs_)", "1 / length_"
        ),
        "traced-directional-bright-segment": Wrap(
            f"{_TRACED}.boundary_walk:transmittance", _clear_segment
        ),
        "traced-directional-bright-camera-segment": _BRIGHT_CAMERA_SEGMENT,
        "traced-directional-forward-is-backward": _TRACED_BACKWARD,
    },
)

_TRACED_WIDE = _all(
    "single-scatter",
    "wide-lights",
    {
        "traced-area-without-cosine": Rewrite(
            _SOURCES, "self.radiance * (cosine_ / density_)", "self.radiance * (1 / density_)"
        ),
        "traced-area-even-density": Rewrite(
            _TRACED,
            "dr.select(counts, density, 0)",
            "dr.select(counts, 1 / self.area, 0)",
            times=2,
        ),
        "traced-area-chord-density": Rewrite(
            _TRACED,
            "0.5 * share_ / (4 * math.pi * radius_ * chord_)",
            "share_ / (4 * math.pi * radius_ * chord_)",
        ),
        "traced-area-sphere-evenly": Rewrite(
            _TRACED, "(1 - share_) * (1 + dr.dot(n_, side_)) / area_", "(1 - share_) / area_"
        ),
        "traced-area-projected-sphere": Wrap(
            f"{_TRACED}.area_sampling:Ball.area", lambda function, light: function(light) / 4
        ),
        "traced-area-bright-camera-segment": _BRIGHT_CAMERA_SEGMENT,
        "traced-area-forward-is-backward": _TRACED_BACKWARD,
        "traced-area-surface-wrong-count": Rewrite(
            _ESTIMATOR,
            "material_ * irradiance_ * kept_ / count_",
            "material_ * irradiance_ * kept_ / (count_ - 1)",
        ),
    },
)

_LAWS = f"{_TRACED}.model_lamps"
_EQUATION = _all(
    "quadrature",
    "own-equation",
    {
        "model-law-for-law": _of_model(
            "law_weight",
            lambda function, law, window: function(replace(law, kind="sphere"), window),
        ),
        "model-no-range": _of_model(
            "law_weight", lambda function, law, window: function(law, None)
        ),
        "model-edge-of-the-scene": _of_model(
            "edge_profile",
            lambda function, model, *others: function(replace(model, spot="angle"), *others),
        ),
        "model-camera-for-light": _terms(
            lambda terms, *_: {
                "paths": replace(
                    terms.paths,
                    camera=np.full_like(terms.paths.camera, terms.paths.light),
                    light=float(np.mean(terms.paths.camera)),
                )
            }
        ),
        "model-depth-is-distance": _of_model(
            "route_of",
            lambda function, reference, distance: function(
                replace(reference, model=replace(reference.model, depth="distance")), distance
            ),
        ),
        "model-begins-at-the-camera": _of_model(
            "route_of",
            lambda function, reference, distance: replace(
                function(reference, distance), start=np.zeros_like(distance)
            ),
        ),
        "model-surface-by-the-inverse-square": _of_model(
            "surface_strength", lambda function, reference, light, point: np.ones(len(point))
        ),
    },
)

_TRACED_EQUATION = _all(
    "single-scatter",
    "own-equation",
    {
        "traced-model-law-for-law": Rewrite(
            _LAWS, "self.scale / (square + self.area)", "1 / (square + self.area)"
        ),
        "traced-model-range-of-half-power": Rewrite(_LAWS, "dr.square(1 - s2 * s2)", "1 - s2 * s2"),
        "traced-model-camera-for-light": Rewrite(
            f"{_TRACED}.model_terms", "self.camera * step", "self.light * step"
        ),
    },
)

#: Below the margin on purpose: what the comparison cannot see.
BELOW_THE_MARGIN = Mutation("one-in-ten-thousand", "quadrature", "many-lights", _brighter(1.0001))

MUTATIONS = (
    *_FOG,
    *_MESHES,
    *_RAYLEIGH,
    *_SUN,
    *_WIDE,
    *_TRACED_FOG,
    *_TRACED_MESHES,
    *_TRACED_SUN,
    *_TRACED_WIDE,
    *_EQUATION,
    *_TRACED_EQUATION,
)

#: Faults of what all estimators share: they agree all the same, and the certified
#: scenes must find the fault.
SHARED = _all(
    "all",
    "certified",
    {
        "camera-pixel-corners": Wrap(
            "airlight.reference.scene.camera:pixel_centres",
            lambda function, size: function(size) - 0.5,
        ),
        "camera-mirrored": _film(lambda place: place * [-1.0, 1.0]),
        "camera-upside-down": _film(lambda place: place * [1.0, -1.0]),
        "camera-one-per-cent-wide": _film(lambda place: 1.01 * place),
        "camera-stepped": Wrap("airlight.reference.scene.camera:camera_matrix", _stepped),
        "read-scene-transposed": Wrap(
            "airlight.reference.scene.camera:pixel_centres",
            lambda function, size: (
                function(size).reshape(*size[::-1], 2).swapaxes(0, 1).reshape(-1, 2)
            ),
        ),
    },
)
