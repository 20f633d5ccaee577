# SPDX-License-Identifier: BSD-3-Clause
"""What shaders do: the midpoint rule, uniform in the distance or in the angle at the light.

* `uniform`: J ~ sum_k dx exp(-sigma_t (x_k + r_k)) p / r_k^2.
* `equiangular`: with x = foot + h tan theta, dx/r^2 = dtheta/h, so J ~ sum_k dtheta/h exp(-sigma_t (x_k + r_k)) p. The
  peak near the light is gone; the end of an endless ray is at theta = pi/2.

Both are of order 2 in the number of steps once the steps resolve the integrand.
"""

import drjit as dr
import mitsuba as mi

from realtime.errors import InputError
from realtime.numerics.array_types import smallest
from realtime.rays.ray_light import RayGeometry, distance_to_light, falloff
from realtime.scene.lights import Light
from realtime.scene.medium import Medium, least_extinction, per_extinction

_REACH = 20.0  # optical depths after which uniform steps end an endless ray: e^-20 = 2e-9


def uniform(geometry: RayGeometry, x0, x1, medium: Medium, light: Light, *, steps: int = 100):
    """Return the airlight integral J by midpoint steps in the distance [1/m].

    Parameters
    ----------
    geometry, x0, x1, medium, light
        See `realtime.kernels`.
    steps
        Number of steps, at least 1.

    Raises
    ------
    InputError
        For `steps` that are no whole number of at least 1.

    Notes
    -----
    Valid where a step is shorter than the distance to the light, everywhere on the ray. An endless ray is cut after 20
    optical depths; through a vacuum it has no step length, and the result means nothing.
    """
    _check(steps)
    thinnest = dr.maximum(least_extinction(medium), smallest(type(x1)))
    x1 = dr.select(dr.isinf(x1), x0 + _REACH / thinnest, x1)

    def term(sigma_t, x):
        r = distance_to_light(geometry, x)
        return _integrand(geometry, medium, light, sigma_t, (x, r)) / dr.square(r)

    width = (x1 - x0) / steps
    return per_extinction(medium, lambda sigma_t: _midpoints(lambda x: term(sigma_t, x), x0, width, steps))


def equiangular(geometry: RayGeometry, x0, x1, medium: Medium, light: Light, *, steps: int = 16):
    """Return the airlight integral J by midpoint steps in the angle at the light [1/m].

    Parameters
    ----------
    geometry, x0, x1, medium, light
        See `realtime.kernels`.
    steps
        Number of steps, at least 1.

    Raises
    ------
    InputError
        For `steps` that are no whole number of at least 1.

    Notes
    -----
    Valid for any ray that does not meet the light (height above 0); thick media need many steps, since a few angles
    hold all the light.

    References
    ----------
    Kulla, Fajardo 2012, *Importance sampling techniques for path tracing in participating media*, section 4.
    """
    _check(steps)
    foot, h = geometry.foot, geometry.height
    theta0 = dr.atan2(x0 - foot, h)
    theta1 = dr.select(dr.isinf(x1), 0.5 * dr.pi, dr.atan2(x1 - foot, h))

    def term(sigma_t, theta):
        x = dr.fma(h, dr.tan(theta), foot)
        return _integrand(geometry, medium, light, sigma_t, (x, distance_to_light(geometry, x)))

    width = (theta1 - theta0) / steps
    return per_extinction(medium, lambda sigma_t: _midpoints(lambda u: term(sigma_t, u), theta0, width, steps) / h)


def _check(steps: int) -> None:
    if not isinstance(steps, int) or steps < 1:
        raise InputError(f"steps: got {steps!r}, wanted a whole number of at least 1")


def _integrand(geometry: RayGeometry, medium: Medium, light: Light, sigma_t, point):
    """Return exp(-sigma_t (x + r)) p times the falloff of a spot, at `point` = (x, r)."""
    x, r = point
    value = dr.exp(-sigma_t * (x + r)) * medium.phase.evaluate((geometry.foot - x) / r)
    return value * falloff(geometry, light, x) if light.varies else value


def _midpoints(term, begin, width, steps: int):
    """Sum the midpoint rule in one loop, so that the kernel does not grow with the number of steps."""
    Float = type(width)
    _, total = dr.while_loop(
        state=(mi.UInt32(0), dr.zeros(Float, dr.width(width))),
        cond=lambda index, total: index < steps,
        body=lambda index, total: (index + 1, total + term(dr.fma(Float(index) + 0.5, width, begin))),
        labels=("index", "total"),
    )
    return total * width
