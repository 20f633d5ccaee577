# SPDX-License-Identifier: BSD-3-Clause
"""Even points on area lights, for sums that all rays share: point lights with the cosine
to the normal as profile.

The radiance Le of an element dA of the surface, seen under the angle whose cosine to its normal is
cos_l, is the intensity Le cos_l dA. The points are uniform on the surface, so one of N stands for
the area A/N. They come from the unit square by maps that keep areas: a rectangle as it is; a disk
by concentric squares (Shirley, Chiu 1997, A low distortion map between disk and square, J. Graphics
Tools 2(3)); a sphere by its heights and azimuths (Archimedes); a triangle of a mesh by the root of
how far they are from a corner.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from airlight.reference.quadrature.mesh_choice import choose_by_area, places_in
from airlight.reference.scene.area_light import ReferenceAreaLight
from airlight.reference.scene.point_light import ReferenceLight

Array = NDArray[np.float64]


def shared_samples(light: ReferenceAreaLight, square: Array) -> Sequence[ReferenceLight]:
    """Return the points of a light as lights whose mean is the light.

    `light`: the light; `square`: points of the unit square, (n, 2) [1]. Returns each with the
    intensity radiance times the whole area [W/sr].
    """
    if light.kind == "sphere":
        # Archimedes: even in height and azimuth is even on the sphere.
        height, azimuth = 1 - 2 * square[:, 0], 2 * np.pi * square[:, 1]
        across = np.sqrt(np.maximum(1 - height**2, 0.0))
        normals = (
            np.stack([across * np.cos(azimuth), across * np.sin(azimuth), height], axis=1)
            @ light.frame
        )
        places = light.centre + light.radius * normals
    elif light.kind == "mesh":
        # A mesh: triangles by area, then evenly within each.
        chosen = choose_by_area(light, square)
        places, normals = places_in(chosen.corners, chosen.square), chosen.normal
    else:
        sides = 2 * square - 1
        sides = _concentric(sides) if light.kind == "disk" else sides
        places = light.centre + (light.half * sides) @ light.frame[:2]
        normals = np.broadcast_to(light.normal, places.shape)
    # Le cos_l dA: the cosine is the profile of the light, within the half space of its normal.
    intensity, quarter = light.radiance * light.area, 0.5 * np.pi
    return [
        ReferenceLight(place, intensity, normal, cutoff=quarter, beam=quarter, cosine=True)
        for place, normal in zip(places, normals, strict=True)
    ]


def _concentric(sides: Array) -> Array:
    """Map [-1, 1]^2 to the unit disk, squares about the middle to circles."""
    a, b = sides.T
    # The larger coordinate is the radius, the smaller one over it the angle in its quarter.
    wide = np.abs(a) > np.abs(b)
    radius, other = np.where(wide, a, b), np.where(wide, b, a)
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio = np.where(radius != 0, other / radius, 0.0)
    angle = np.where(wide, 0.25 * np.pi * ratio, 0.5 * np.pi - 0.25 * np.pi * ratio)
    return radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
