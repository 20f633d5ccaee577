# SPDX-License-Identifier: BSD-3-Clause
"""Gauss-Legendre quadrature of the airlight integral in theta, the angle at the light (the papers' form).

    J = (1/h) int_{theta0}^{theta1} exp(-sigma_t (x + r)) p(-sin theta) dtheta,   x = foot + h tan theta,   r = h / cos
    theta.

The integrand is bounded, and smooth where the segment ends before theta nears pi/2; there exp(-sigma_t h / cos theta)
has an essential singularity. `realtime.kernels.quadrature` avoids it.
"""

import drjit as dr

from realtime.errors import InputError
from realtime.numerics.gauss_legendre import unit_nodes
from realtime.rays.ray_light import RayGeometry, distance_to_light, falloff
from realtime.scene.lights import Light
from realtime.scene.medium import Medium, per_extinction


def quadrature_theta(geometry: RayGeometry, x0, x1, medium: Medium, light: Light, *, nodes: int = 16):
    """Return the airlight integral J by Gauss-Legendre quadrature in theta [1/m].

    Parameters
    ----------
    geometry, x0, x1, medium, light
        See `realtime.kernels`.
    nodes
        Nodes of each panel, at least 1; the range is split at the foot point unless the phase function is isotropic.

    Raises
    ------
    InputError
        For `nodes` that are no whole number of at least 1.

    Notes
    -----
    Valid for rays that do not meet the light (height above 0). The difference of the angles is taken as one arc
    tangent, so that short segments do not cancel.
    """
    if not isinstance(nodes, int) or nodes < 1:
        raise InputError(f"nodes: got {nodes!r}, wanted a whole number of at least 1")
    split = dr.clip(geometry.foot, x0, x1)
    whole = medium.phase.constant and not light.varies
    panels = [(x0, x1)] if whole else [(x0, split), (split, x1)]
    return per_extinction(
        medium,
        lambda sigma_t: sum(_panel(geometry, a, b, sigma_t, medium, light, nodes) for a, b in panels),
    )


def _panel(geometry: RayGeometry, x0, x1, sigma_t, medium: Medium, light: Light, nodes: int):
    foot, h = geometry.foot, geometry.height
    s0, s1 = x0 - foot, dr.select(dr.isinf(x1), 0, x1 - foot)
    theta0 = dr.atan2(s0, h)
    width = dr.select(dr.isinf(x1), 0.5 * dr.pi - theta0, dr.atan2(h * (s1 - s0), dr.fma(s0, s1, h * h)))
    total = type(h)(0)
    for fraction, weight in unit_nodes(nodes):
        x = dr.fma(h, dr.tan(dr.fma(width, fraction, theta0)), foot)
        r = distance_to_light(geometry, x)
        value = dr.exp(-sigma_t * (x + r)) * medium.phase.evaluate((foot - x) / r)
        if light.varies:
            value *= falloff(geometry, light, x)
        total += weight * value
    return total * (width / h)
