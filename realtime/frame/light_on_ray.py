# SPDX-License-Identifier: BSD-3-Clause
r"""Pixels that a frame refuses: radiance that is not finite, and rays that meet a point light.

With h the distance from the light to the ray, t the distance to the foot, and
theta the angle at the light,

    J = exp(-sigma_t t)/h  int exp(-sigma_t h tan(theta/2 + pi/4)) p(-sin theta) dtheta.

As h goes to 0 the exponential under the integral goes to 1 at every angle below pi/2, so that

    h J -> exp(-sigma_t t) int_{-pi/2}^{pi/2} p(-sin theta) dtheta,            pi exp(-sigma_t t) for p = 1:

J grows like 1/h, and the pixel of a ray that meets the light is infinite; so is a ray that ends at
the light, with half of the integral or more. With the light at the camera every pixel is infinite.
Where nothing is extinguished at the light, nothing is scattered there, and all of it is finite.
A mean over a pixel is finite, since 1/h is integrable over a plane, but a frame holds the radiance
of the centres.

Positions are float32 numbers: the position of a light is known to 2^-24 of the largest coordinate
at best. Below that height, h is noise, and so is 1/h. Such a pixel is refused, by the distance.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from airlight.errors import InputError
from airlight.realtime.scene.camera import HostCamera, read_camera
from airlight.realtime.scene.read_scene import Scene

Array = NDArray[np.float64]

_ROUNDING = 2.0**-24


def check_radiance(scene: Scene, name: str, airlight: Any, surface: Any, distance: Any) -> None:
    """Refuse the frame of a method that is not finite everywhere, or whose airlight is not.

    `scene`: as it was rendered; `name`: the method's; `airlight`, `surface`: radiances, (height,
    width, 3) [W/(m^2 sr)]; `distance`: to the visible surface, (height, width) [m]. Raises
    InputError with the first pixel that is wrong, and why.
    """
    # A cone may look away: there the number says more than the ray.
    points = [pair for pair in enumerate(scene.lights, 1) if pair[1].kind == "point"]
    if points:
        camera = read_camera(scene.camera)
        for number, light in points:
            position = np.array(light.position, dtype=np.float64).ravel()
            fault = _fault(camera, f"light {number}", position, distance)
            if fault and _extinguishes(scene, position - camera.origin):
                raise InputError(fault)
    for what, values in (("airlight", airlight), ("surface radiance", surface)):
        wrong = ~np.isfinite(values).all(axis=2)
        if wrong.any():
            row, column = np.argwhere(wrong)[0]
            medium = scene.medium.summary.partition(":")[0]
            raise InputError(
                f"method {name}: the {what} of {int(wrong.sum())} of {wrong.size} pixels is not "
                "finite, first in "
                f"column {column} of row {row}: "
                f"{', '.join(f'{value:g}' for value in values[row, column])}; a light "
                f"may lie on its ray, a segment of it need more panels than the medium ({medium}) "
                "tries, or a number "
                "of the scene be too large for float32: move the light, or use other units"
            )


def _fault(camera: HostCamera, name: str, position: Array, distance: Any) -> str:
    """Return what to tell of a light on the ray of a pixel; empty where it is on none."""
    away = position - camera.origin
    reach = float(np.linalg.norm(away))
    known = _ROUNDING * max(np.abs(position).max(), np.abs(camera.origin).max())
    if not reach > known:
        return (
            f"{name} is {reach:.3g} m from the camera: the airlight, which grows like 1/distance, "
            "is infinite in every pixel; move the light or the camera"
        )
    # In the plane at distance 1 a pixel has the sides `left` and `up`.
    c, a, b = np.linalg.solve(camera.basis, away)
    if c <= 0:
        return ""
    column, row = 0.5 * (camera.width - 1) - a / c, 0.5 * (camera.height - 1) - b / c
    nearest = np.clip(np.round([column, row]), 0, [camera.width - 1, camera.height - 1]).astype(int)
    across, upward = 0.5 * (camera.width - 1) - nearest[0], 0.5 * (camera.height - 1) - nearest[1]
    ray = camera.basis @ (1.0, across, upward)
    height = float(np.linalg.norm(np.cross(away, ray)) / np.linalg.norm(ray))
    ends = float(distance[nearest[1], nearest[0]])
    if height > max(known, _ROUNDING * reach) or reach > ends * (1 + 4 * _ROUNDING):
        return ""
    return (
        f"{name} is {height:.3g} m from the ray through the centre of the pixel in column "
        f"{nearest[0]} of row {nearest[1]}: the airlight there, which grows like 1/distance, is "
        "infinite; move the light or the camera, or take another size"
    )


def _extinguishes(scene: Scene, away: Array) -> bool:
    """Return whether something is extinguished at a light, so far from the camera [m]."""
    Vector = type(scene.camera.origin)
    reach = float(np.linalg.norm(away))
    # At the camera itself any direction will do.
    way = Vector(*map(float, away / reach)) if reach else scene.camera.forward
    rays = scene.medium.rays(scene.camera.origin, way)
    # On either side of the light: it may lie in the border of the medium.
    places = (reach * (1 + side * 4 * _ROUNDING) for side in (-1, 1))
    return any(
        float(np.max(sigma_t)) > 0
        for place in places
        for sigma_t in scene.medium.extinction(rays, type(way.x)(place))
    )
