# SPDX-License-Identifier: BSD-3-Clause
"""Area lights, and the background, as the camera sees them: their own radiance
through the medium, a layer.
"""

from collections.abc import Iterator

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from airlight.reference.quadrature.fields import optical_depth
from airlight.reference.scene.area_light import ReferenceAreaLight
from airlight.reference.scene.device import as_rows, vectors
from airlight.reference.scene.read import ReferenceScene, scene_from
from airlight.reference.visibility.distances import half_chord

Array = NDArray[np.float64]


def emitted_light(reference: ReferenceScene, distance: Array) -> Array:
    """Return the radiance of area lights before the visible surface, and of the
    background where there is none.

    In W/(m^2 sr), (rays, 3).

    `reference`: the scene; `distance`: to the visible surface, (rays,), infinite
    where there is none [m].

    Valid for the side that emits; a light of material `null` is seen with what is behind it,
    a black one ends the ray.
    """
    total = np.zeros((len(distance), 3))
    for light in reference.area:
        places = (
            _mesh_distances(light, reference)
            if light.kind == "mesh"
            else [_distance(light, reference)]
        )
        for at in places:
            # A surface as close to a light as 1e-4 of its distance is the light's own, or touches
            # it. NaN, where the ray misses the light, compares as false.
            rows = np.flatnonzero(at <= distance * (1 + 1e-4))
            depth = optical_depth(
                reference,
                reference.origin,
                reference.direction[rows],
                np.zeros(len(rows)),
                at[rows],
            )
            total[rows] += light.radiance * np.exp(-depth)
    if reference.background is not None:
        rows = np.flatnonzero(np.isinf(distance))
        # The background is seen through all media: 1e30 m is beyond their bounds.
        depth = optical_depth(
            reference,
            reference.origin,
            reference.direction[rows],
            np.zeros(len(rows)),
            np.full(len(rows), 1e30),
        )
        interaction = dr.zeros(mi.SurfaceInteraction3f, len(rows))
        interaction.wi = vectors(mi.Vector3f, -reference.direction[rows])
        total[rows] += as_rows(reference.background.eval(interaction)) * np.exp(-depth)
    return total


def _mesh_distances(light: ReferenceAreaLight, reference: ReferenceScene) -> Iterator[Array]:
    """Yield where rays meet a mesh from the side that emits, crossing after
    crossing, (rays,) [m]; else NaN.
    """
    mesh = scene_from([light.shape])
    start, walking = np.zeros(len(reference.direction)), np.ones(len(reference.direction), bool)
    while walking.any():
        place = reference.origin + start[:, None] * reference.direction
        hit = mesh.ray_intersect(
            mi.Ray3f(vectors(mi.Point3f, place), vectors(mi.Vector3f, reference.direction))
        )
        at = start + np.array(hit.t, dtype=np.float64)
        walking &= np.isfinite(at)
        # A black mesh hides what is behind its first crossing; through one of material `null` the
        # ray goes on, and may meet the emitting side again.
        yield np.where(walking & np.array(mi.Frame3f.cos_theta(hit.wi) > 0), at, np.nan)
        walking &= not light.opaque
        # The next crossing is looked for 1e-5 of the distance and 1e-5 m beyond this one, which
        # float32 rays would otherwise meet again.
        start = np.where(walking, at * (1 + 1e-5) + 1e-5, start)


def _distance(light: ReferenceAreaLight, reference: ReferenceScene) -> Array:
    """Return where rays meet the side of a light that emits, (rays,) [m]; NaN where they do not."""
    origin, direction = reference.origin, reference.direction
    away = light.centre - origin
    if light.kind == "sphere":
        middle = direction @ away
        miss = np.linalg.norm(away - middle[:, None] * direction, axis=1)
        at = middle - half_chord(light.radius, miss)
        return np.where((miss < light.radius) & (at > 0), at, np.nan)
    rate = direction @ light.normal
    with np.errstate(divide="ignore", invalid="ignore"):
        at = (away @ light.normal) / rate
        x, y = ((at[:, None] * direction - away) @ light.frame[:2].T).T
    a, b = light.half
    inside = (
        (np.abs(x) <= a) & (np.abs(y) <= b) if light.kind == "rectangle" else x * x + y * y <= a * a
    )
    return np.where((rate < 0) & (at > 0) & inside, at, np.nan)
