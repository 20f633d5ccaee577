# SPDX-License-Identifier: BSD-3-Clause
r"""Which truths are refused: infinite ones, of rays that meet a light, and what is not finite for any other reason.

With q = (x - t) + r = h E, t the foot of the light and h its distance from the ray (DESIGN section 2),

    h J = int_{q0/h}^{q1/h} exp(-sigma_t (t + h E)) p((1 - E^2)/(1 + E^2)) 2/(1 + E^2) dE.

Let h go to 0. On a ray that passes the light q0 = O(h^2) and q1 > 0, so that the range becomes all E > 0 and the
exponential that of t alone:

    h J -> exp(-sigma_t t) int_0^inf p((1 - E^2)/(1 + E^2)) 2/(1 + E^2) dE > 0,        pi exp(-sigma_t t) for p = 1.

J and the radiance grow like 1/h, without a bound. A ray that ends at the light has E up to 1, one that begins there, at
the camera, E from 1 on: parts of the same integral. A light at the camera is on every ray. That the samples of an
estimator are finite makes no difference: their mean is infinite.

The mean over the area of a pixel is finite, since int 2 pi h dh / h is: `pixel="area"` is refused only where the camera
is at the light.

How near is on the ray? Mitsuba holds positions as float32 numbers, the largest coordinate of camera and light known to
2^-24 of it. A smaller h is not known to be anything but 0.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from analytic.errors import InputError
from analytic.geometry import foot_and_height
from reference.quadrature.ray_values import TruthImage
from reference.scene.convex_bounds import holds
from reference.scene.read import TruthLight, TruthScene

Array = NDArray[np.float64]

_ROUNDING = 2.0**-24


def check_camera(truth: TruthScene) -> None:
    """Refuse a scene whose camera is at a light, whose every pixel is infinite."""
    for number, light in enumerate(truth.lights, 1):
        distance = float(np.linalg.norm(light.position - truth.origin))
        if distance <= _uncertainty(truth, light) and _scatters(truth, light):
            raise InputError(
                f"{_name(number, light)} is {distance:.3g} m from the camera: the airlight, which grows like "
                "1/distance, is infinite in every pixel; move the light or the camera"
            )


def check_rays(truth: TruthScene, distance: Array) -> None:
    """Refuse rays through pixel centres that meet a light before the visible surface, so far away, (rays,) [m]."""
    ends = np.ravel(distance)
    for number, light in enumerate(truth.lights, 1):
        origin = np.broadcast_to(truth.origin, truth.direction.shape)
        foot, height = foot_and_height(origin, truth.direction, light.position)
        known = _uncertainty(truth, light)
        meets = (height <= known) & (foot > 0) & (foot <= ends + known) & _looks_along(light, truth.direction)
        if meets.any() and _scatters(truth, light):
            pixel = int(np.argmax(meets))
            row, column = divmod(pixel, truth.width)
            raise InputError(
                f"{_name(number, light)} is {height[pixel]:.3g} m from the ray through the centre of the pixel in "
                f"column {column} of row {row}: the airlight there, which grows like 1/distance, is infinite; move the "
                "light or the camera, take another size, or the mean over pixels (--pixel area)"
            )


def check_values(truth: TruthScene, image: TruthImage) -> None:
    """Refuse a truth that is not finite, by its first pixel."""
    for what in ("airlight", "airlight_bound", "surface"):
        values: Any = getattr(image, what)
        wrong = ~np.isfinite(values).all(axis=2)
        if wrong.any():
            row, column = np.argwhere(wrong)[0]
            raise InputError(
                f"the truth has {int(wrong.sum())} of {wrong.size} pixels whose {what} is not finite, first in column "
                f"{column} of row {row}; a light may lie on its ray, or a number of the scene be too large: move the "
                "light, or use other units"
            )


def _name(number: int, light: TruthLight) -> str:
    return f"light {number} at ({', '.join(f'{coordinate:g}' for coordinate in light.position)})"


def _uncertainty(truth: TruthScene, light: TruthLight) -> float:
    """Return how well the distance from the camera to a light is known [m]."""
    return _ROUNDING * float(max(np.abs(light.position).max(), np.abs(truth.origin).max()))


def _scatters(truth: TruthScene, light: TruthLight) -> bool:
    """Return whether there is a medium where a light is: beside it the airlight is finite."""
    inside = [medium for medium in truth.media if holds(medium.bounds, light.position)]
    medium = inside[0] if inside else truth.medium
    return bool(np.any(medium.largest * medium.albedo * light.intensity > 0))


def _looks_along(light: TruthLight, direction: Array) -> NDArray[np.bool_]:
    """Return which rays through a light pass its cone, before it or behind it."""
    if light.axis is None:
        return np.ones(len(direction), dtype=bool)
    return np.abs(direction @ light.axis) >= np.cos(light.cutoff)
