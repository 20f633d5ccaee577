# SPDX-License-Identifier: BSD-3-Clause
r"""The errors that a method states for itself: a larger distance from the reference is a fault.

Methods that claim to be exact (the kernel `exact` along whole rays where nothing casts a shadow,
and shadow planes in exact order) state three errors:

* **The integral**, `EXACT` of the pixel. That is more than rounding: a pixel is a sum of float32
  values that cancel, and beyond what its ends are worth it errs by at most 33 units 2^-24 of itself
  or of the mean of the image, whichever is larger, in all built-in scenes without area lights and
  in `random:7` (64 x 48 pixels, 28 November 2026). In bounded media rules with few nodes stand in
  the place of the kernel: 99 % of the pixels of `random:3` err by less than 4.7e-4.
* **Ends.** A lit interval ends at a surface, at the bounds of a medium or at a shadow plane, at a
  distance x that is known to some units of float32. With s(x) the radiance that a metre of the ray
  scatters in full light, this error is x s(x) times `END`. It is small, but the lit length may be
  small, too: where a ray clips the edge of a medium by 37 um at 0.66 m, an error of 2.6 units
  changes this length, and all of the airlight, by 4e-3.

  The place where a ray meets the bounds of a medium at a small angle is less accurate. In x = n .
  (p - o)/(n . d) the direction d is rounded, and so are the three products of the divisor, which
  are not small where their sum, the cosine c, is: x is known to x `END`/|c|. A sphere of radius r
  has the same law: with b the distance of its middle from the ray and h = sqrt(r^2 - b^2) half of
  the chord, dh = b/h db, where b is known to x `END` and c = h/r.
* **Kinks.** The rules of the kernel have positive weights, and are exact for the smooth function
  that a tabulated phase function stands for. It departs from the table by an eighth of the second
  difference of its values, so rule and integral together err by two eighths of the largest second
  difference over the value.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial

import mitsuba as mi
import numpy as np

from airlight.realtime.methods.registry import METHODS
from airlight.realtime.parameters import defaults
from airlight.realtime.scene.phase import Phase, Tabulated
from airlight.realtime.scene.read_scene import Scene
from airlight.reference.quadrature.fields import field_of, optical_depth
from airlight.reference.quadrature.intervals import AMBIENT, camera_segments, scattering_range
from airlight.reference.quadrature.surface import surface_hits
from airlight.reference.scene.convex_bounds import normals_at
from airlight.reference.scene.directional_light import DirectionalLight
from airlight.reference.scene.homogeneous_medium import ReferenceMedium
from airlight.reference.scene.point_light import ReferenceLight
from airlight.reference.scene.read import ReferenceScene, homogeneous_around, read_reference
from airlight.reference.scene.varying import VaryingMedium
from airlight.reference.visibility.distances import crossings
from airlight.validation.arrays import Array, Bools, Index
from airlight.validation.study.configuration import Configuration

#: The error of the integral that methods promise which claim to be exact, relative to the pixel, or
#: to a thousandth of the mean in the dark: twice the error of their rules in bounded media.
EXACT = 1e-3

#: uncertainty of the end of a lit interval that a ray meets head on, relative to its distance
END = 8 * 2.0**-24

#: Returns the direction in which a light arrives at points and its irradiance [W/m^2], (n, 3) each.
Incident = Callable[[Array], tuple[Array, Array]]

_SAMPLES = 256  # of a ray, about each light: what is scattered is smooth between them
_RAYS = 1024  # at once: so many take some 100 MB


def stated_bound(chosen: Configuration, scene: Scene) -> float | None:
    """Return the relative error that a method states for itself in a scene, without that of the
    ends of lit intervals [1]; None for none.

    Points in the place of area lights are an approximation.
    """
    # All parameters but the side of a shadow map must be the usual ones.
    usual_values = defaults(METHODS[chosen.method]) if chosen.method in METHODS else {}
    usual = all(
        usual_values.get(name, value) == value for name, value in chosen.parameters if name != "map"
    )
    plain = usual and chosen.kernel == "exact" and not scene.area_lights
    whole_rays = chosen.method in ("unshadowed", "light-volumes") and not scene.features.shadows
    if not plain or not (chosen.method == "shadow-planes" or whole_rays):
        return None
    media = [scene.medium, *(bounded.medium for bounded in scene.medium.bounded_media)]
    bound = EXACT + max(_kinks(medium.phase) for medium in media)
    return bound if np.isfinite(bound) else None


def _kinks(phase: Phase) -> float:
    """Return the largest error by the kinks of a phase function, relative to the integral."""
    if not isinstance(phase, Tabulated):
        return 0.0
    values = np.array(phase.values, dtype=np.float64)
    neighbours = np.lib.stride_tricks.sliding_window_view(values, min(3, len(values)))
    # Rule and integral err by an eighth of the second difference each: a fourth of it, over the
    # least of the three values.
    bends = np.abs(neighbours @ np.array([1, -2, 1])) if len(values) > 2 else np.zeros(1)
    with np.errstate(divide="ignore", invalid="ignore"):
        return float(np.nan_to_num(0.25 * bends / neighbours.min(axis=1), posinf=np.inf).max())


def worth_of_ends(scene: mi.Scene, pixels: Index) -> Array:
    """Return the largest error by uncertain ends of lit intervals in pixels of a scene, by their
    numbers, (pixels, 3) [W/(m^2 sr)].

    Valid for lights without extent. The ends may be anywhere: the largest x s(x) along
    a ray counts, lit or not.
    """
    whole = read_reference(scene)
    parts = np.array_split(pixels, range(_RAYS, len(pixels), _RAYS))
    return np.concatenate(
        [_worth_of_ends(replace(whole, direction=whole.direction[part])) for part in parts]
    )


def _worth_of_ends(reference: ReferenceScene) -> Array:
    """Return the largest error by uncertain ends of lit intervals of all rays
    of `reference`, (rays, 3).
    """
    distance = surface_hits(reference).distance
    worth = np.zeros((len(distance), 3))
    ends, growth = _ends(reference, distance)
    for samples, incident in _sampled_lights(reference, distance):
        # The possible ends of rays have their own factor 1/|c|; at all other places a shadow may
        # end, with a factor of 1. Places that a ray does not have are infinite.
        places = np.concatenate([ends, samples])
        uncertain = np.concatenate([growth, np.ones_like(places[len(ends) :])]).T
        x = np.clip(places, 0, distance).T
        ray, column = np.nonzero(np.isfinite(x))
        uncertain, x = (uncertain * x)[ray, column], x[ray, column]
        scattered = uncertain[:, None] * _scattered(reference, incident, ray, x, distance)
        # One uncertain end for each light: errors of several lights add up.
        largest = np.zeros_like(worth)
        np.maximum.at(largest, ray, scattered)
        worth += largest
    # No place between the samples scatters more than 1.1 times the largest of them.
    return 1.1 * END * worth


def _sampled_lights(reference: ReferenceScene, distance: Array) -> Iterator[tuple[Array, Incident]]:
    """Yield for each light distances along rays at which it is sampled, (places, rays) [m], and
    its irradiance at points.
    """
    # Lights at a place are sampled at equal angles about them, lights at infinity at equal steps.
    for light in reference.lights:
        yield _angles_about(reference, light, distance), partial(_from_place, reference, light)
    for sun in reference.directional:
        yield _equal_steps(reference, distance), partial(_from_infinity, sun)


def _ends(reference: ReferenceScene, distance: Array) -> tuple[Array, Array]:
    """Return distances along rays [m], and the factor of their uncertainty, 1/|c| [1], (places,
    rays) each.

    The places are the ends of rays, the middles of segments in media and between media, and the
    points where rays cross bounds.
    """
    places = [np.zeros_like(distance), distance]
    if reference.media:
        segments = camera_segments(reference, distance)
        places += list(0.5 * (segments.start + segments.end))
    growth = [np.ones_like(distance)] * len(places)
    # A ray that misses a medium, or leaves the scene before it, has an infinite distance there:
    # all rays have as many places.
    for medium in reference.media:
        enter, leave = crossings(medium.bounds, reference.origin, reference.direction)
        for x in (enter, leave):
            met = (enter < leave) & (x > 0) & (x < distance)
            points = reference.origin + np.where(met, x, 0)[:, None] * reference.direction
            cosine = np.abs(np.sum(normals_at(medium.bounds, points) * reference.direction, axis=1))
            places.append(np.where(met, x, np.inf))
            # A ray along the bound itself: with a smaller cosine nothing is known of x.
            growth.append(1 / np.where(met, np.maximum(cosine, END), 1))
    return np.stack(places), np.stack(growth)


def _angles_about(reference: ReferenceScene, light: ReferenceLight, distance: Array) -> Array:
    """Return distances at equal angles about a light, (places, rays) [m]."""
    toward = light.position - reference.origin
    # At equal angles samples are dense near the light, where s(x) changes fast. An angle at pi/2
    # is a place at infinity.
    foot = reference.direction @ toward
    height = np.linalg.norm(toward - foot[:, None] * reference.direction, axis=1)
    first, last = np.arctan2(-foot, height), np.arctan2(distance - foot, height)
    angle = first + np.linspace(0, 1, _SAMPLES)[:, None] * (last - first)
    return np.where(angle < np.pi / 2 - 1e-6, foot + height * np.tan(angle), np.inf)


def _equal_steps(reference: ReferenceScene, distance: Array) -> Array:
    """Return distances at equal steps where rays scatter, (places, rays) [m]."""
    if isinstance(reference.medium, VaryingMedium):
        # A level ray through height fog scatters without an end: its steps are none.
        leave = field_of(reference).leave(reference.origin, reference.direction)
        low, high = np.zeros_like(distance), np.minimum(distance, leave)
        high = np.where(np.isfinite(high), high, 0.0)
    else:
        low, high = scattering_range(camera_segments(reference, distance))
    return low + np.linspace(0, 1, _SAMPLES)[:, None] * (high - low)


def _from_place(
    reference: ReferenceScene, light: ReferenceLight, point: Array
) -> tuple[Array, Array]:
    """Return the direction in which light arrives at points and its irradiance [W/m^2], (n, 3)
    each.
    """
    segment = point - light.position
    r = np.linalg.norm(segment, axis=1)
    segment /= r[:, None]
    depth = optical_depth(reference, light.position, segment, np.zeros(len(r)), r)
    return segment, light.intensity / (r * r)[:, None] * np.exp(-depth)


def _from_infinity(light: DirectionalLight, point: Array) -> tuple[Array, Array]:
    """As `_from_place`, but without attenuation on the way: an upper bound."""
    direction, irradiance = (
        np.broadcast_to(vector, point.shape) for vector in (light.direction, light.irradiance)
    )
    return direction, irradiance


def _scattered(
    reference: ReferenceScene,
    incident: Incident,
    ray: Index,
    x: Array,
    distance: Array,
) -> Array:
    """Return the radiance that a metre of rays scatters at distances x, fully lit by one light,
    (n, 3) [W/(m^3 sr)].

    `ray`: number of the ray of each x; `distance`: of the surface on each ray [m].
    """
    direction = reference.direction[ray]
    segment, arriving = incident(reference.origin + x[:, None] * direction)
    from_camera = optical_depth(reference, reference.origin, direction, np.zeros(len(x)), x)
    # Light that arrives, attenuated on the way to the camera; each medium scatters it by its own
    # phase function, which has the mean 1 over the sphere.
    radiance = arriving * np.exp(-from_camera) / (4 * np.pi)
    # A medium that differs from place to place scatters nowhere more than this.
    if isinstance(reference.medium, VaryingMedium):
        return np.asarray(radiance * field_of(reference).strongest)
    total = np.zeros_like(radiance)
    for medium, inside in _media(reference, ray, x, distance):
        phase = medium.phase(np.clip(np.sum(segment * -direction, axis=1), -1, 1))
        total += np.where(inside, phase, 0)[:, None] * medium.albedo * medium.sigma_t * radiance
    return total


def _media(
    reference: ReferenceScene, ray: Index, x: Array, distance: Array
) -> list[tuple[ReferenceMedium, Bools]]:
    """Return media, each with the mask of the places in it, (n,); a place at a bound is in the
    media on both sides.
    """
    if not reference.media:
        return [(homogeneous_around(reference), np.ones(len(x), dtype=bool))]
    # The slack is the uncertainty of a bound: a place on it is in the media at both sides.
    segments = camera_segments(reference, distance)
    slack = END * x
    inside = [
        (number[ray], (x >= start[ray] - slack) & (x <= end[ray] + slack) & (start[ray] < end[ray]))
        for start, end, number in zip(segments.start, segments.end, segments.medium)
    ]
    numbers = [AMBIENT, *range(len(reference.media))]
    media = [homogeneous_around(reference), *reference.media]
    return [
        (medium, np.any([which & (of == number) for of, which in inside], axis=0))
        for number, medium in zip(numbers, media, strict=True)
    ]
