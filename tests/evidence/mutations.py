# SPDX-License-Identifier: BSD-3-Clause
"""Faults of the physics, one at a time, that the comparisons of the estimators must find.

A fault is given as hooks and patterns (`tests.evidence.injected`), most of them at what one part of an estimator hands
to the next: the scene that was read, lit intervals, the integrals over them, the points of a light. `stage` is the
scene on which the fault must be found. The margins of a stage are those of `tests.evidence.stages`.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from reference.monte_carlo.single_scatter.distance_sampling import mixture_pdfs
from reference.scene.read import TruthScene
from tests.evidence.injected import Change, Put, Rewrite, Wrap

_DIRECTIONAL = "reference.quadrature.directional_sums"
_AREA = "reference.scene.area_light:TruthAreaLight.area"
_TRACED = "reference.monte_carlo.single_scatter"
_ESTIMATOR, _EXTENDED = f"{_TRACED}.estimator", f"{_TRACED}.area_estimate"
_FOUR_PI = 4 * np.pi


@dataclass(frozen=True)
class Mutation:
    """One fault."""

    name: str
    meaning: str
    estimator: str  # 'quadrature', 'single-scatter', or 'all': what they share
    stage: str  # the scene on which it must be found
    changes: tuple[Change, ...]


# --- Hooks of the quadrature ---


def _sums(change: Callable[..., Any]) -> Wrap:
    """Change the airlight of one light: change(medium, radiance)."""

    def around(function, medium, *others, **named):
        radiance, bound = function(medium, *others, **named)
        return change(medium, radiance), bound

    return Wrap("reference.quadrature.unbounded:sum_intervals", around)


def _brighter(factor: float) -> Wrap:
    return _sums(lambda medium, radiance: radiance * factor)


def _first_extinction(function, medium, *others, **named):
    first = replace(medium, sigma_t=np.full(3, medium.sigma_t[0]))
    return tuple(values * medium.sigma_t / medium.sigma_t[0] for values in function(first, *others, **named))


def _integrals(change: Callable[..., Any]) -> Wrap:
    """Change the arguments of the airlight integral: change(foot, height, x0, x1, sigma_t) -> named ones."""

    def around(function, foot, height, x0, x1, sigma_t, phase, **how):
        columns = dict(foot=foot, height=height, x0=x0, x1=x1, sigma_t=sigma_t, phase=phase)
        return function(**(columns | how | change(how, foot, height, x0, x1, sigma_t)))

    return Wrap("analytic.panels:airlight_segments", around)


def _times(weight: Callable[..., Any]) -> Wrap:
    """Multiply the integrand: weight(x, foot, height, sigma_t)."""

    def change(how, foot, height, x0, x1, sigma_t):
        before = how.get("weight") or (lambda x, row: 1.0)
        return {"weight": lambda x, row: before(x, row) * weight(x, foot[row, None], height[row, None], sigma_t)}

    return _integrals(change)


def _phase(name: str, change: Callable[..., Any]) -> Wrap:
    """Change a phase function: change(value, g)."""

    def around(function, self, down, up):
        value = function(self, down, up)
        return change(value, self.g) if self.name == name else value

    return Wrap("analytic.phase:PhaseFunction.from_half", around)


_BACKWARD = Wrap("analytic.phase:PhaseFunction.from_half", lambda function, self, down, up: function(self, up, down))


def _read(change: Callable[[TruthScene], TruthScene]) -> Wrap:
    return Wrap("reference.scene.read:read_truth", lambda function, scene: change(function(scene)))


def _spots(change: Callable[..., Any]) -> Wrap:
    def around(function, emitter):
        light = function(emitter)
        return light if light.axis is None or light.cutoff > 3 else change(light)

    return Wrap("reference.scene.read:_read_light", around)


def _wide(light, cutoff: float):
    return replace(light, cutoff=cutoff, beam=min(light.beam, cutoff))


def _linear_in_cosine(function, theta, direction, normal, light):
    value = function(theta, direction, normal, light)
    if not light.is_soft or light.cosine:
        return value
    cosine = np.cos(light.cutoff - value * (light.cutoff - light.beam))
    return (cosine - np.cos(light.cutoff)) / (np.cos(light.beam) - np.cos(light.cutoff))


def _one_light(function, truth, light, *others, **named):
    found = function(truth, light, *others, **named)
    return found if light is truth.lights[0] else replace(found, radiance=0 * found.radiance)


def _lit(change: Callable[..., Any]) -> Wrap:
    """Change the lit intervals: change(intervals of a ray, ends of the ray) -> intervals of that ray."""

    def around(function, truth, light, rays, *, ends, **how):
        found = function(truth, light, rays, ends=ends, **how)
        parts = []
        for ray in np.flatnonzero(ends[1] > ends[0]):
            of_ray = [(low, high) for low, high in zip(found.low[found.ray == ray], found.high[found.ray == ray])]
            parts += [(ray, low, high) for low, high in change(of_ray, ends[0][ray], ends[1][ray]) if high > low]
        ray, low, high = np.array(parts, dtype=float).reshape(-1, 3).T
        return replace(found, ray=ray.astype(np.int64), low=low, high=high, doubt=None)

    return Wrap("reference.visibility.lit_intervals:lit_intervals", around)


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


def _behind(function, medium, light, rays, lit, *others, **named):
    high = np.where(rays.foot[lit.ray] > 0, lit.high, lit.low)
    return function(medium, light, rays, replace(lit, high=high), *others, **named)


def _surface(change: Callable[..., Any]) -> Wrap:
    """Change the lit surface: change(function, truth, hits, named)."""
    return Wrap(
        "reference.quadrature.surface:lit_surface",
        lambda function, truth, hits, **named: change(function, truth, hits, named),
    )


def _without_cosine(function, truth, hits, named):
    (light,) = truth.lights
    towards = hits.interaction.to_local(dr.normalize(mi.Point3f(*map(float, light.position)) - hits.interaction.p))
    cosine = np.array(mi.Frame3f.cos_theta(towards), dtype=float)[:, None]
    return function(truth, hits, **named) / np.where(np.abs(cosine) > 0, cosine, 1)


def _to_camera(truth, hits):
    return np.where(np.isfinite(hits.distance), hits.distance, 0)[:, None] * truth.medium.sigma_t


def _no_shadow_leg(function, truth, hits, named):
    return function(truth, hits, **named | {"shadow_scale": 0.0})


def _all_reached(function, truth, hits, named):
    everywhere = [np.ones(len(hits.distance), bool)] * len(truth.lights)
    return function(truth, hits, **named | {"reached": everywhere})


def _sun(change: Callable[..., Any]) -> Wrap:
    """Change what hides a directional light: change(shapes)."""
    return Wrap(
        "reference.visibility.directional_geometry:parallel_intervals",
        lambda function, rays, shapes: function(rays, change(shapes)),
    )


def _points(change: Callable[..., Any]) -> Wrap:
    """Change the points of area lights: change(function, light, square)."""
    return Wrap("reference.quadrature.light_points:light_points", change)


def _square_for_disk(function, light, square):
    if light.kind != "disk":
        return function(light, square)
    intensity = light.radiance * light.area
    return [replace(point, intensity=intensity) for point in function(replace(light, kind="rectangle"), square)]


def _even_angles(function, light, square):
    even = np.stack([0.5 * (1 - np.cos(np.pi * square[:, 0])), square[:, 1]], axis=1)
    return function(light, even if light.kind == "sphere" else square)


def _stronger(factor: Callable[..., float]) -> Wrap:
    def change(function, light, square):
        return [replace(point, intensity=point.intensity * factor(light)) for point in function(light, square)]

    return _points(change)


def _one_too_few(function, *arguments, plan, **named):
    found = function(*arguments, plan=plan, **named)
    return replace(found, replicates=found.replicates * plan.most / (plan.most - 1))


def _own_shape(function, truth, light):
    scene, shapes = function(truth, replace(light, shape=None))
    return scene, shapes


def _sorted(emitters_are_opaque: bool) -> Wrap:
    def around(function, scene):
        opaque, boundaries = function(scene)
        emitters = [shape for shape in scene.shapes() if shape.is_emitter()]
        others = [shape for shape in opaque if not shape.is_emitter()]
        return [*others, *emitters] if emitters_are_opaque else others, boundaries

    return Wrap("reference.scene.read:sorted_shapes", around)


# --- Hooks of single-scatter ---


def _leg(change: Callable[..., Any]) -> Wrap:
    """Change the attenuation between light and point: change(media)."""
    return Wrap(
        f"{_TRACED}.boundary_walk:transmittance",
        lambda function, *arguments, media, active: function(*arguments, media=change(media), active=active),
    )


def _one_technique(function, u, mixture):
    y, s, _ = function(u, mixture)
    return y, s, mi.Float(mixture_pdfs(mi.Float64(y), mixture)[0])


def _equal_cells(function, number, shift, count):
    low, _ = function(number, shift, count)
    return low, mi.Float(1 / (count - 1))


def _no_albedo(function, task, number, ray, stretch, *others):
    return function(task, number, ray, replace(stretch, sigma_s=stretch.sigma_t), *others)


def _clear_leg(function, *arguments, **named):
    return dr.select(function(*arguments, **named) > 0, mi.Spectrum(1), mi.Spectrum(0))


# --- Hooks of what all estimators share: the camera ---


def _film(change: Callable[..., Any]) -> Wrap:
    """Change the positions on the film through which rays go: change(x, y, width, height), from the middle."""

    def around(function, sensor, positions, size):
        middle = 0.5 * np.array(size, dtype=float)
        return function(sensor, middle + change(positions - middle), size)

    return Wrap("reference.scene.camera:film_directions", around)


def _stepped(function, sensor):
    matrix = function(sensor).copy()
    matrix[:3, 3] += 0.01 * matrix[:3, 2]
    return matrix


def _all(estimator: str, stage: str, *rows: tuple[Any, ...]) -> tuple[Mutation, ...]:
    return tuple(Mutation(name, meaning, estimator, stage, tuple(changes)) for name, meaning, *changes in rows)


_FOG = _all(
    "quadrature",
    "many-lights",
    ("no-four-pi", "the 1/(4 pi) of the phase function dropped", _brighter(_FOUR_PI)),
    ("four-pi-twice", "1/(4 pi) applied twice", _brighter(1 / _FOUR_PI)),
    ("extinction-for-scattering", "the albedo dropped", _sums(lambda medium, radiance: radiance / medium.albedo)),
    ("albedo-squared", "the albedo applied twice", _sums(lambda medium, radiance: radiance * medium.albedo)),
    (
        "one-extinction",
        "the extinction of the first channel taken for all three",
        Wrap("reference.quadrature.unbounded:sum_intervals", _first_extinction),
    ),
    ("one-per-cent", "everything scattered in the medium 1 % too bright", _brighter(1.01)),
    ("three-per-mille", "everything scattered in the medium 0.3 % too bright", _brighter(1.003)),
    ("one-per-mille", "everything scattered in the medium 0.1 % too bright", _brighter(1.001)),
    ("bright-shadow-leg", "the leg from the light not attenuated", _integrals(lambda *_: {"shadow_scale": 0.0})),
    (
        "bright-camera-leg",
        "the leg to the camera not attenuated",
        _times(lambda x, foot, height, sigma_t: np.exp(np.minimum(sigma_t * x, 600.0))),
    ),
    (
        "distance-not-squared",
        "1/r in the place of 1/r^2",
        _times(lambda x, foot, height, sigma_t: np.hypot(x - foot, height)),
    ),
    (
        "end-at-one-optical-depth",
        "rays end after one mean free path",
        _integrals(lambda how, foot, height, x0, x1, sigma_t: {"x1": np.clip(x1, x0, np.maximum(x0, 1 / sigma_t))}),
    ),
    (
        "near-clip",
        "the first 0.2 m before the camera left out, as by a near clip plane",
        _integrals(lambda how, foot, height, x0, x1, _: {"x0": np.maximum(x0, 0.2), "x1": np.maximum(x1, 0.2)}),
    ),
    (
        "near-segment-skipped",
        "the lit interval that begins at the camera left out",
        _integrals(lambda how, foot, height, x0, x1, sigma_t: {"x1": np.where(x0 > 0, x1, x0)}),
    ),
    ("forward-is-backward", "the sign of g swapped", _BACKWARD),
    (
        "henyey-greenstein-of-two",
        "Henyey and Greenstein's function normalised to 2",
        _phase("hg", lambda value, g: 2 * value),
    ),
    (
        "henyey-greenstein-squared",
        "an exponent of 1 in the place of 3/2 in Henyey and Greenstein's function",
        _phase("hg", lambda value, g: (1 - g * g) * (value / (1 - g * g)) ** (2 / 3)),
    ),
    (
        "radians-for-degrees",
        "the cone of a spot read in the wrong unit",
        _spots(lambda light: _wide(light, np.rad2deg(light.cutoff) % np.pi)),
    ),
    (
        "wide-spot",
        "the whole angle of a spot's cone taken for half of it",
        _spots(lambda light: _wide(light, 2 * light.cutoff)),
    ),
    (
        "falloff-in-the-cosine",
        "a soft spot linear in the cosine, not in the angle",
        Wrap("reference.visibility.spot_cone:falloff", _linear_in_cosine),
    ),
    (
        "hard-spot",
        "the falloff of a soft spot left out",
        Wrap("reference.visibility.spot_cone:falloff", lambda function, theta, *others: np.ones_like(theta)),
    ),
    (
        "first-light-only",
        "all lights but the first ignored",
        Wrap("reference.quadrature.light_airlight:light_airlight", _one_light),
    ),
    (
        "no-light-behind",
        "a light behind the camera ignored",
        Wrap("reference.quadrature.unbounded:sum_intervals", _behind),
    ),
    ("shadow-for-light", "lit and shadowed intervals confused", _lit(_complement)),
    ("no-shadows", "the fog lit through everything", _lit(lambda lit, low, high: [(low, high)])),
    (
        "no-sphere-shadows",
        "the fog lit through spheres",
        Wrap(
            "reference.visibility.spheres:hidden_behind",
            lambda function, *arguments: tuple(part[:0] for part in function(*arguments)),
        ),
    ),
    (
        "through-surfaces",
        "rays not ended at the visible surface",
        Wrap(
            "reference.quadrature.light_airlight:light_airlight",
            lambda function, truth, light, distance, **how: function(truth, light, distance + np.inf, **how),
        ),
    ),
    ("surface-bright-shadow-leg", "the leg from the light to the surface not attenuated", _surface(_no_shadow_leg)),
    (
        "surface-bright-camera-leg",
        "the leg from the surface to the camera not attenuated",
        _surface(lambda function, truth, hits, named: function(truth, hits, **named) * np.exp(_to_camera(truth, hits))),
    ),
    (
        "surface-wrong-leg",
        "the leg to the camera counted twice, in the place of that to the light",
        _surface(
            lambda function, truth, hits, named: (
                _no_shadow_leg(function, truth, hits, named) * np.exp(-_to_camera(truth, hits))
            )
        ),
    ),
    ("surface-without-shadows", "the surface lit through everything", _surface(_all_reached)),
)

_MESHES = _all(
    "quadrature",
    "two-pens",
    ("edges-shifted", "every shadow 0.01 rad too far along the ray", _lit(_shifted)),
    ("thin-shadows-missed", "shadows and gaps below a hundredth of the ray stepped over", _lit(_coarse)),
    (
        "last-tenth-missed",
        "what begins in the last tenth of the way from the light to the ray casts no shadow",
        Rewrite(
            "reference.visibility.triangles", "(low_ <= height) & (high_ > 0)", "(low_ <= 0.9 * height) & (high_ > 0)"
        ),
    ),
    ("surface-without-cosine", "the cosine at the lit surface dropped", _surface(_without_cosine)),
)

_RAYLEIGH = _all(
    "quadrature",
    "rayleigh",
    ("rayleigh-of-two", "3/2 in the place of Rayleigh's 3/4", _phase("rayleigh", lambda value, g: 2 * value)),
    (
        "rayleigh-without-lobes",
        "Rayleigh's function without its dependence on the angle",
        _phase("rayleigh", lambda value, g: np.ones_like(value)),
    ),
)

_SUN = _all(
    "quadrature",
    "sun",
    (
        "directional-without-four-pi",
        "the 1/(4 pi) of the phase function dropped under directional lights",
        Wrap(
            f"{_DIRECTIONAL}:sum_directional",
            lambda function, *arguments, **named: tuple(_FOUR_PI * part for part in function(*arguments, **named)),
        ),
    ),
    (
        "directional-bright-leg",
        "the leg from a directional light not attenuated",
        Rewrite(
            _DIRECTIONAL,
            "np.maximum(length_(rows_, x_), 0.0)[:, :, None] * sigma_",
            "np.maximum(length_(rows_, x_), 0.0)[:, :, None] * 0 * sigma_",
        ),
    ),
    (
        "directional-leg-both-ways",
        "the leg from a directional light followed on behind the scattering point",
        Rewrite(_DIRECTIONAL, "(enter_, low_ <= 0)", "(enter_, low_ < -np.inf)"),
    ),
    (
        "directional-chord-both-ways",
        "the leg through a sphere followed on behind the scattering point",
        Rewrite(
            _DIRECTIONAL,
            "closest_ + half_ - np.maximum(closest_ - half_, 0.0)",
            "closest_ + half_ - (closest_ - half_)",
        ),
    ),
    (
        "directional-forward-is-backward",
        "the direction of a directional light reversed in the phase function",
        _BACKWARD,
    ),
    (
        "directional-corners-behind",
        "the pieces of a ray cut where legs pass the corners behind it, not those before it",
        Rewrite(_DIRECTIONAL, "(y_ > 0) & np.isfinite(x_)", "(y_ < 0) & np.isfinite(x_)"),
    ),
    (
        "directional-shadows-leaning-back",
        "the shadows of triangles brought down to the ray the wrong way round",
        Rewrite(
            "reference.visibility",
            "(rays_.cosine / rays_.sine)[mine_][row_]",
            "-(rays_.cosine / rays_.sine)[mine_][row_]",
        ),
    ),
    (
        "directional-no-shadows",
        "the fog lit through all triangles",
        _sun(lambda shapes: replace(shapes, triangles=shapes.triangles[:0])),
    ),
    (
        "directional-no-sphere-shadows",
        "the fog lit through all spheres",
        _sun(lambda shapes: replace(shapes, centre=shapes.centre[:0], radius=shapes.radius[:0])),
    ),
    (
        "directional-surface-bright-leg",
        "the leg from a directional light to the surface not attenuated",
        Rewrite("reference.quadrature.surface", "-to_camera_ - optical_depth(a_, b_, c_, d_, e_)", "-to_camera_"),
    ),
)

_WIDE = _all(
    "quadrature",
    "wide-lights",
    ("area-without-cosine", "the cosine at the light dropped", _integrals(lambda *_: {"weight": None})),
    (
        "area-both-sides",
        "light from both sides of every shape",
        _points(
            lambda function, light, square: [
                turned
                for point in function(light, square)
                for turned in (point, replace(point, axis=-np.asarray(point.axis)))
            ]
        ),
    ),
    (
        "area-other-side",
        "light from the wrong side",
        _points(
            lambda function, light, square: [
                replace(point, axis=-np.asarray(point.axis)) for point in function(light, square)
            ]
        ),
    ),
    (
        "area-wrong-count",
        "N - 1 in the place of N points",
        Wrap("reference.quadrature.area_airlight:area_airlight", _one_too_few),
    ),
    (
        "area-projected-sphere",
        "the projected area of a sphere in the place of its area",
        Wrap(_AREA, lambda function, light: function(light) / (4 if light.kind == "sphere" else 1)),
    ),
    (
        "area-half-sides",
        "half the sides of a rectangle taken for its sides",
        Wrap(_AREA, lambda function, light: function(light) / (4 if light.kind == "rectangle" else 1)),
    ),
    (
        "area-power-for-intensity",
        "the power pi Le A in the place of the intensity Le A",
        _stronger(lambda light: np.pi),
    ),
    (
        "area-radiance-for-intensity",
        "the radiance in the place of the intensity: no area",
        _stronger(lambda light: 1 / light.area),
    ),
    (
        "area-polar-angles-evenly",
        "points on a sphere spread evenly over the angle from its pole",
        _points(_even_angles),
    ),
    ("area-square-for-disk", "the square around a disk in the place of the disk", _points(_square_for_disk)),
    (
        "area-shadows-itself",
        "a light hidden by its own shape",
        Wrap("reference.visibility.before_light:before_light", _own_shape),
    ),
    ("area-null-is-opaque", "a light of material null that ends rays and casts shadows", _sorted(True)),
    ("area-black-is-clear", "a black light that neither ends rays nor casts shadows", _sorted(False)),
    (
        "area-surface-without-cosine",
        "the cosine at the light dropped on surfaces",
        Rewrite(
            "reference.quadrature",
            "(factor_ * seen_.depth[row_] / lines_.height[of_] ** 2)[:, None] * cosine_",
            "(factor_ / lines_.height[of_])[:, None] * np.ones_like(cosine_)",
        ),
    ),
    (
        "area-surface-bright-leg",
        "the leg from the light to the surface not attenuated",
        Rewrite("reference.quadrature", "bsdf_(point_, towards_) * np.exp(-depth_)", "bsdf_(point_, towards_)"),
    ),
    (
        "area-surface-half-horizon",
        "half of what is above the horizon of a surface left out",
        Rewrite("reference.visibility", "np.maximum(low_, middle_ - 0.5 * np.pi)", "np.maximum(low_, middle_)"),
    ),
)

_TRACED_FOG = _all(
    "single-scatter",
    "many-lights",
    (
        "equi-angular-without-height",
        "the distance of the light from the ray left out of the equi-angular density",
        Rewrite(_TRACED, "0.5 * h_ / (range_ * (h_ * h_ + s_ * s_))", "0.5 / (range_ * (h_ * h_ + s_ * s_))"),
    ),
    (
        "free-flight-not-truncated",
        "the density of free flights without the normalisation by their truncation",
        Rewrite(_TRACED, "flight_.rate * scale_ * survival_", "flight_.rate * survival_"),
    ),
    (
        "no-weights",
        "the multiple importance weights left out: both techniques count in full",
        Wrap(f"{_TRACED}.distance_sampling:sample_distance", _one_technique),
    ),
    (
        "equal-cells",
        "the narrower cells at both ends weighed like the others",
        Wrap(f"{_TRACED}.stretches:cell_of", _equal_cells),
    ),
    (
        "traced-distance-not-squared",
        "1/r in the place of 1/r^2 along the ray",
        Rewrite(_ESTIMATOR, "width_ / (r_ * r_ * density_)", "width_ / (r_ * density_)"),
    ),
    (
        "traced-bright-shadow-leg",
        "the leg from the light not attenuated",
        _leg(lambda media: replace(media, end_sigma_t=0 * media.end_sigma_t)),
    ),
    (
        "traced-bright-camera-leg",
        "the leg to the camera not attenuated",
        Rewrite(
            _ESTIMATOR,
            "sent_ * dr.exp(-camera_leg_) * (width_ / (r_ * r_ * density_))",
            "sent_ * (width_ / (r_ * r_ * density_))",
        ),
    ),
    (
        "leg-before-the-cone-forgotten",
        "the leg to the camera counted from the edge of a spot's cone",
        Rewrite(_ESTIMATOR, "mi.Float(start_ - first_)", "0 * mi.Float(start_ - first_)"),
    ),
    (
        "traced-forward-is-backward",
        "the direction of the light reversed in the phase function",
        Rewrite(
            _ESTIMATOR,
            "phase_.eval_pdf(context_, point_, -light_, on_)",
            "phase_.eval_pdf(context_, point_, light_, on_)",
        ),
    ),
    (
        "traced-extinction-for-scattering",
        "sigma_t in the place of sigma_s: the albedo dropped",
        Wrap(f"{_ESTIMATOR}:_scattered", _no_albedo),
    ),
    (
        "traced-surface-not-squared",
        "1/r in the place of 1/r^2 at the surface",
        Rewrite(_ESTIMATOR, "sent_ / (r_ * r_)", "sent_ / r_"),
    ),
    (
        "traced-surface-bright-camera-leg",
        "the leg from the surface to the camera not attenuated",
        Rewrite(_ESTIMATOR, "dr.select(on_, sent_ * dr.exp(-camera_leg), 0)", "dr.select(on_, sent_, 0)", times=2),
    ),
)

_TRACED_MESHES = _all(
    "single-scatter",
    "two-pens",
    (
        "traced-shadow-epsilon",
        "the leg from the light attenuated over a shadow ray that ends short of it, as in volpath",
        _leg(lambda media: replace(media, end_sigma_t=(1 - 8.94e-4) * media.end_sigma_t)),
    ),
    (
        "traced-short-shadow-rays",
        "shadow rays that miss the last tenth of the way to the point",
        Put(f"{_TRACED}.boundary_walk:_SHORT_OF_POINT", 0.1),
    ),
)

_TRACED_SUN = _all(
    "single-scatter",
    "sun",
    (
        "traced-directional-uniform-density",
        "the density of free flights left out under directional lights",
        Rewrite(_TRACED, "0.5 / length_ + share_ * sum(pdfs_)", "1 / length_"),
    ),
    (
        "traced-directional-bright-leg",
        "the leg from a directional light not attenuated",
        Wrap(f"{_TRACED}.boundary_walk:transmittance", _clear_leg),
    ),
    (
        "traced-directional-bright-camera-leg",
        "the leg to the camera counted to the boundary alone, under a directional light",
        Rewrite(_ESTIMATOR, "dr.exp(-depth_ - sigma_ * y_)", "dr.exp(-depth_)"),
    ),
    (
        "traced-directional-forward-is-backward",
        "the direction of a directional light reversed in the phase function",
        Rewrite(
            _ESTIMATOR,
            "phase_.eval_pdf(context_, point_, towards, on_)",
            "phase_.eval_pdf(context_, point_, -towards, on_)",
        ),
    ),
)

_TRACED_WIDE = _all(
    "single-scatter",
    "wide-lights",
    (
        "traced-area-without-cosine",
        "the cosine at the light dropped",
        Rewrite(_EXTENDED, "width_ * cosine / all_", "width_ / all_"),
    ),
    (
        "traced-area-even-density",
        "points about the ray weighed as if they were spread evenly over a rectangle or disk",
        Rewrite(_TRACED, "dr.select(counts_, density, 0)", "dr.select(counts_, 1 / light.area, 0)"),
    ),
    (
        "traced-area-chord-density",
        "the density of points about a ray on a sphere twice too large",
        Rewrite(
            _TRACED,
            "0.5 * share_ / (4 * math.pi * radius_ * chord_)",
            "share_ / (4 * math.pi * radius_ * chord_)",
        ),
    ),
    (
        "traced-area-sphere-evenly",
        "points on the side of the ray weighed as if they were spread evenly over the sphere",
        Rewrite(_TRACED, "(1 - share_) * (1 + dr.dot(n_, side_)) / area_", "(1 - share_) / area_"),
    ),
    (
        "traced-area-projected-sphere",
        "the projected area of a sphere in the place of its area",
        Wrap(
            f"{_TRACED}.area_sampling:AreaLight.area",
            lambda function, light: function(light) / (4 if light.shape == "Sphere" else 1),
        ),
    ),
    (
        "traced-area-bright-camera-leg",
        "the leg to the camera not attenuated",
        Rewrite(_EXTENDED, "sent_ * dr.exp(-camera_leg_) * weight_", "sent_ * weight_"),
    ),
    (
        "traced-area-forward-is-backward",
        "the direction of the light reversed in the phase function",
        Rewrite(
            _EXTENDED,
            "phase_.eval_pdf(context_, point_, -light_, on_)",
            "phase_.eval_pdf(context_, point_, light_, on_)",
        ),
    ),
    (
        "traced-area-surface-without-cosine",
        "the cosine at the light dropped on surfaces",
        Rewrite(_EXTENDED, "cosine / (r_ * r_ * p_ * count_)", "1 / (r_ * r_ * p_ * count_)"),
    ),
    (
        "traced-area-surface-wrong-count",
        "N - 1 in the place of N points on surfaces",
        Rewrite(_EXTENDED, "cosine / (r_ * r_ * p_ * count_)", "cosine / (r_ * r_ * p_ * (count_ - 1))"),
    ),
)

#: Below the margin on purpose: what the comparison cannot see.
BELOW_THE_MARGIN = Mutation(
    "one-in-ten-thousand",
    "everything scattered in the medium 0.01 % too bright",
    "quadrature",
    "many-lights",
    (_brighter(1.0001),),
)

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
)

#: Faults of what all estimators share: they agree all the same, and the certified scenes must find the fault.
SHARED = _all(
    "all",
    "certified",
    (
        "camera-pixel-corners",
        "rays through the corners of pixels",
        Wrap("reference.scene.camera:pixel_centres", lambda function, size: function(size) - 0.5),
    ),
    ("camera-mirrored", "left and right confused", _film(lambda place: place * [-1.0, 1.0])),
    ("camera-upside-down", "the film upside down", _film(lambda place: place * [1.0, -1.0])),
    ("camera-one-per-cent-wide", "a field of view 1 % too wide", _film(lambda place: 1.01 * place)),
    (
        "camera-stepped",
        "rays that begin 1 cm before the camera",
        Wrap("reference.scene.camera:camera_matrix", _stepped),
    ),
    (
        "read-scene-transposed",
        "pixels column by column, not row by row",
        Wrap(
            "reference.scene.camera:pixel_centres",
            lambda function, size: function(size).reshape(*size[::-1], 2).swapaxes(0, 1).reshape(-1, 2),
        ),
    ),
)
