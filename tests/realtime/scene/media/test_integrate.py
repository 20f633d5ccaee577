# SPDX-License-Identifier: BSD-3-Clause
"""Claim: a new medium that says its depth, its extinction, its bends and its longest panel
is right to 1e-6 at once.
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from scipy.integrate import quad

from airlight.realtime.numerics.array_types import array_types
from airlight.realtime.rays import ray_geometry
from airlight.realtime.scene.lights import Light, spot_fields
from airlight.realtime.scene.media import integrate
from airlight.realtime.scene.media.medium import Homogeneous, LitRays, VaryingMedium
from airlight.realtime.scene.phase import HenyeyGreenstein
from airlight.realtime.scene.rule_reach import NODES

# extinction below the ramp and above it [1/m], height of the ramp [m]
LOW, HIGH, TOP, G = 0.15, 1.1, 2.5, 0.6
LAMP = np.array([0.7, 1.3, 1.9])


@dataclass(frozen=True)
class Ramp(VaryingMedium):
    """An extinction that is linear in height from 0 to `TOP`, and constant below and above."""

    albedo: Any
    phase: Any

    def extinction(self, rays, x):
        """Return the extinction [1/m]."""
        return (LOW + (HIGH - LOW) / TOP * dr.clip(rays.at(x).z, 0, TOP),)

    def optical_depth(self, rays, x0, x1):
        """Return the optical depth of segments [1]: the mean over heights, in closed form."""
        z0, z1 = rays.at(x0).z, rays.at(x1).z
        level = dr.abs(z1 - z0) < 1e-9
        column = (
            LOW * z1 + (HIGH - LOW) * self._column(z1) - LOW * z0 - (HIGH - LOW) * self._column(z0)
        )
        (here,) = self.extinction(rays, x0)
        return ((x1 - x0) * dr.select(level, here, column / (z1 - z0)),)

    @staticmethod
    def _column(z):
        inside = dr.clip(z, 0, TOP)
        return inside * inside / (2 * TOP) + dr.maximum(z - TOP, 0)

    def bends(self, rays, light):
        """Return where rays pass the ends of the ramp [m]."""
        return tuple((z - rays.origin.z) / rays.direction.z for z in (0, TOP))

    def longest(self, rays, light, x, change):
        """Return the length in which depths and the logarithm of the extinction change
        by so much together [m].
        """
        r = dr.norm(light.toward(rays.at(x)))
        return change / (2 * HIGH + (HIGH - LOW) / TOP * (1 / LOW + r))

    def thicker(self, factor):
        """Return itself."""
        return self


def depth(origin, direction, length):
    """Return the optical depth of a segment: the trapezoidal rule is exact
    between the ends of the ramp.
    """
    ends = [-origin[2] / direction[2], (TOP - origin[2]) / direction[2]]
    x = np.sort([0, *np.clip(ends, 0, length), length])
    return np.trapezoid(np.interp(origin[2] + x * direction[2], [0, TOP], [LOW, HIGH]), x)


def expected(origin, direction, x0, x1, profile):
    """Return the integral by adaptive quadrature of the definition."""

    def integrand(x):
        point = origin + x * direction
        away = LAMP - point
        r = np.linalg.norm(away)
        cos = away @ direction / r
        phase = (1 - G * G) / (1 + G * G - 2 * G * cos) ** 1.5
        sigma = np.interp(point[2], [0, TOP], [LOW, HIGH])
        tau = depth(origin, direction, x) + depth(point, away / r, r)
        return sigma * phase * profile(-away / r) * np.exp(-tau) / r**2

    foot = (LAMP - origin) @ direction
    places = np.clip([foot, -origin[2] / direction[2], (TOP - origin[2]) / direction[2]], x0, x1)
    return quad(integrand, x0, x1, points=sorted({*places}), epsrel=1e-11, epsabs=0, limit=400)[0]


def segments(count):
    random = np.random.default_rng(4)
    origin = np.array([0.3, -4.0, 0.6])
    target = LAMP + random.normal(size=(count, 3)) * 10 ** random.uniform(-2, 0.3, (count, 1))
    direction = (target - origin) / np.linalg.norm(target - origin, axis=1)[:, None]
    x0 = random.uniform(0, 4, count) * (random.random(count) < 0.5)
    return origin, direction, x0, x0 + random.uniform(0.1, 9, count)


def integrals(precision, spot=None, count=40):
    """Return the integrals of rays of the medium, and what they should be."""
    types = array_types(precision)
    origin, direction, x0, x1 = segments(count)
    fields = {} if spot is None else spot_fields(np.array([0.0, 0, -1]), *np.radians(spot), types)
    light = Light(position=types.vector(*map(float, LAMP)), intensity=types.color(1), **fields)
    medium = Ramp(types.color(1), HenyeyGreenstein(types.scalar(G)))
    ways = types.vector(*(types.scalar(column) for column in direction.T))
    aim = mi.Vector3d(*(mi.Float64(column) for column in direction.T))
    rays = medium.rays(types.vector(*map(float, origin)), ways, aim)
    geometry = ray_geometry(rays.origin, rays.aim, light)
    lit = medium.lit(rays, light, geometry)
    found = lit.airlight(types.scalar(x0), types.scalar(x1))
    # The reference integrates what the cone holds.
    x0, x1 = (np.array(x) for x in geometry.lit_segment(types.scalar(x0), types.scalar(x1)))
    cutoff, beam = (np.pi, np.pi) if spot is None else np.radians(spot)

    def profile(way):
        return 1 if spot is None else np.clip((cutoff - np.arccos(-way[2])) / (cutoff - beam), 0, 1)

    values = [
        expected(origin, *ray, profile) if ray[2] > ray[1] else 0.0
        for ray in zip(direction, x0, x1, strict=True)
    ]
    return np.array(found.x, dtype=np.float64), np.array(values)


def test_a_linear_density_ramp(variant, monkeypatch):
    """The rule of float64, that of float32 without its rounding, and float32: its depth is
    a difference of columns.
    """
    found, values = integrals("double")
    assert np.abs(found / values - 1).max() < 1e-9
    monkeypatch.setattr(integrate, "_NODES_DOUBLE", NODES)
    assert np.abs(integrals("double")[0] / values - 1).max() < 1e-6
    errors = np.abs(integrals("single")[0] / values - 1)
    assert np.median(errors) < 1e-6
    assert errors.max() < 3e-5


def test_the_ramp_in_a_soft_spot(variant):
    found, values = integrals("double", spot=(50.0, 20.0))
    lit = values > 1e-6 * values.max()
    assert np.count_nonzero(lit) > 5
    assert np.abs(found[lit] / values[lit] - 1).max() < 1e-6


def test_a_segment_whose_panels_run_out_is_no_number(variant, monkeypatch):
    monkeypatch.setattr(LitRays, "most_panels", 2)
    found, values = integrals("double", count=12)
    finite = np.isfinite(found)
    assert not finite.all()
    np.testing.assert_allclose(found[finite], values[finite], rtol=1e-9)


def test_the_integrand_of_marchers_keeps_the_digits_of_a_sharp_lobe(variant):
    """In float32 1 - cos has lost them: values were wrong by 1.5e-3."""
    values = []
    for precision in ("single", "double"):
        types = array_types(precision)
        phase = HenyeyGreenstein(types.scalar(1 - 2.0**-8))
        medium = Homogeneous((types.scalar(0.125),), types.color(1), phase)
        light = Light(types.vector(10, 3 / 64, 0), types.color(1))
        rays = medium.rays(types.vector(0, 0, 0), types.vector(1, 0, 0))
        lit = medium.lit(rays, light, ray_geometry(rays.origin, rays.aim, light))
        found = lit.source(types.scalar([0.0, 2.0, 5.0, 8.0, 9.5]))
        values.append(np.array(found, dtype=np.float64))
    np.testing.assert_allclose(*values, rtol=5e-6)
