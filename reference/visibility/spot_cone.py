# SPDX-License-Identifier: BSD-3-Clause
"""Where camera rays cross the cones of a spot light, in float64.

The cosine between the axis of the spot and the direction to the point at angle theta on the ray (see
`analytic.geometry`) is

    c(theta) = axial sin(theta) + across cos(theta) = m cos(theta - theta_m),
    m = sqrt(axial^2 + across^2),   theta_m = atan2(axial, across),

with `axial` = axis . direction and `across` = axis . n, n the unit vector from the light to the foot point. The point
lies in the cone of half angle b where c >= cos b, hence |theta - theta_m| <= acos(cos b / m), nowhere if m < cos b. In
theta a cone is one interval: no nappes, no cases. (`realtime.rays.ray_light` solves a quadratic equation in the
distance instead.)
"""

import numpy as np
from numpy.typing import NDArray

from reference.scene.read import TruthLight

Array = NDArray[np.float64]


def perpendicular(origin: Array, direction: Array, light: TruthLight) -> Array:
    """Return the unit vectors from the light to the foot points; any normal if a ray meets the light.

    Parameters
    ----------
    origin
        Where all rays begin [m], (3,).
    direction
        Unit vectors, (rays, 3).
    light
        The light.

    Returns
    -------
    numpy.ndarray
        (rays, 3).
    """
    offset = origin - light.position
    foot = -(direction @ offset)
    n = offset + foot[:, None] * direction
    length = np.linalg.norm(n, axis=1, keepdims=True)
    helper = np.cross(direction, np.where(np.abs(direction[:, :1]) < 0.5, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]]))
    return np.where(length > 0, n / np.maximum(length, np.finfo(float).tiny), helper)


def cone_interval(direction: Array, normal: Array, light: TruthLight, angle: float) -> tuple[Array, Array]:
    """Return the interval of theta inside a cone about the light's axis.

    Parameters
    ----------
    direction, normal
        Unit vectors along the rays, and from the light to the foot points, (rays, 3) each.
    light
        The light; for a point light the interval is that of the whole line.
    angle
        Half angle of the cone [rad].

    Returns
    -------
    low, high
        (rays,) each [rad]; low > high where the ray misses the cone.
    """
    if light.axis is None:
        half_pi = np.full(len(direction), 0.5 * np.pi)
        return -half_pi, half_pi
    axial, across = direction @ light.axis, normal @ light.axis
    magnitude = np.hypot(axial, across)
    middle = np.arctan2(axial, across)
    ratio = np.cos(angle) / np.maximum(magnitude, np.finfo(float).tiny)
    half = np.where(ratio < 1, np.arccos(np.minimum(ratio, 1.0)), -1.0)
    return middle - half, middle + half


def falloff(theta: Array, direction: Array, normal: Array, light: TruthLight) -> Array:
    """Return Mitsuba's spot profile: one in the beam, then linear in the angle down to the cut-off; or the cosine.

    Parameters
    ----------
    theta
        Angles at the light, (rays, angles) [rad].
    direction, normal
        Unit vectors along the rays, and from the light to the foot points, (rays, 3) each.
    light
        The light.

    Returns
    -------
    numpy.ndarray
        Intensity over that on the axis [1], (rays, angles).
    """
    if light.axis is not None and light.cosine:
        axial, across = (direction @ light.axis)[:, None], (normal @ light.axis)[:, None]
        return np.maximum(axial * np.sin(theta) + across * np.cos(theta), 0.0)
    if light.axis is None or light.beam >= light.cutoff:
        return np.ones_like(theta)
    axial, across = (direction @ light.axis)[:, None], (normal @ light.axis)[:, None]
    angle = np.arccos(np.clip(axial * np.sin(theta) + across * np.cos(theta), -1.0, 1.0))
    return np.clip((light.cutoff - angle) / (light.cutoff - light.beam), 0.0, 1.0)
