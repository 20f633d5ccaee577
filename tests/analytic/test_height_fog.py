# SPDX-License-Identifier: BSD-3-Clause
"""Airlight in height fog: certified rays, the laws, and quadratures that know no closed
form of an optical depth.
"""

import itertools
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from scipy.integrate import quad

from airlight.analytic.geometry import foot_and_height
from airlight.analytic.height_fog import (
    HeightFog,
    HeightRays,
    Layer,
    height_fog_segments,
    height_fog_sun,
    phi,
)
from airlight.analytic.panels import airlight_segments
from airlight.analytic.phase import Isotropic
from airlight.errors import InputError
from tests.helpers.height_fog import drawn, rows

# Height, foot and exponents are rounded: 1e-11 where heights are tens of scale
# heights, as among these rays.
LAW = 1e-10


def close(a, b, relative=LAW):
    return abs(a - b) <= relative * max(abs(a), abs(b))


@pytest.mark.claim(
    "height-fog-certified", tolerance="1e-12 relative under the sun, 1e-10 under lights at places"
)
def test_certified_rays():
    certified = rows()
    assert len(certified) == 400
    for row in certified:
        assert close(row.airlight(), row.value, 1e-12 if row.sun else 1e-10), row


def test_the_estimate_covers_the_error():
    for row in rows():
        # there the rounding of foot and height counts, which are given
        if not row.sun and row.tag != "near-light":
            foot, height = foot_and_height(row.origin, row.direction, row.light)
            rays = HeightRays(row.origin[2], row.direction[2], foot, height, row.light[2])
            for rtol in (1e-3, 1e-10):
                value, error = height_fog_segments(
                    row.fog, rays, row.x0, row.x1, row.phase, rtol=rtol
                )
                assert abs(value[0] - row.value) <= error[0], (row, rtol)


def test_optical_depths_against_quadrature_of_the_density():
    random = np.random.default_rng(4)
    for ray in drawn(1, 60):
        fog = replace(ray.fog, floor=-4.0, cap=5.0) if random.random() < 0.5 else ray.fog
        rise, origin = ray.direction[2], ray.origin[2]
        marks = sorted((z - origin) / rise for z in fog.kinks)
        ends = [ray.x0, *(x for x in marks if ray.x0 < x < ray.x1), ray.x1]
        density = partial(_density, fog, origin, rise)
        parts = [quad(density, a, b, epsrel=1e-11)[0] for a, b in itertools.pairwise(ends)]
        depth = fog.optical_depth(origin + rise * ray.x0, origin + rise * ray.x1, ray.x1 - ray.x0)
        assert close(depth, sum(parts), 1e-9) or abs(depth - sum(parts)) < 1e-13  # of quad
        assert close(fog.column(-2.0), quad(fog.density, -2.0, 5.0)[0], 1e-7) or fog.cap > 5
    assert np.isinf(HeightFog((), 0.1).column(0.0))


def _density(fog, origin, rise, x):
    return fog.density(origin + rise * x)


def test_phi_near_zero_and_far_out():
    # (1 - e^-u)/u = 1 - u/2 + u^2/6 - ..., and 1/u
    u = np.array([0.0, 1e-300, 1e-12, 1e-4, 800.0, 1e300])
    np.testing.assert_allclose(
        phi(u), [1, 1, 1 - 5e-13, 1 - 5e-5 + 1e-8 / 6, 1 / 800, 1e-300], rtol=1e-12
    )


@pytest.mark.claim(
    "height-fog-laws", tolerance="1e-8 at H = 1e9 m, the difference from homogeneous fog"
)
def test_a_large_scale_height_is_homogeneous_fog():
    for ray in (each for each in drawn(2) if not each.sun):
        foot, height = foot_and_height(ray.origin, ray.direction, ray.light)
        sigma_t = 0.13
        expected = (
            sigma_t * airlight_segments(foot, height, ray.x0, ray.x1, sigma_t, ray.phase)[0][0]
        )
        deep = replace(ray, fog=HeightFog((Layer(sigma_t, 0.0, 1e9),)))
        assert close(deep.airlight(), expected, 1e-7)
        assert close(replace(ray, fog=HeightFog((), sigma_t)).airlight(), expected, 3e-10)


@pytest.mark.claim("height-fog-laws", tolerance="3e-10 relative, three integrals to 1e-10")
def test_intervals_add_up_and_layers_have_two_degrees_of_freedom():
    for ray in drawn(4):
        value, middle = ray.airlight(), 0.37 * ray.x0 + 0.63 * ray.x1
        parts = replace(ray, x1=middle).airlight() + replace(ray, x0=middle).airlight()
        assert close(value, parts, 3e-10)
        layers = ray.fog.layers
        halves = tuple(replace(each, sigma_t=each.sigma_t / 2) for each in layers for _ in range(2))
        assert close(value, replace(ray, fog=replace(ray.fog, layers=halves)).airlight(), 3e-10)
        if not ray.fog.clamped:
            moved = tuple(
                Layer(e.sigma_t * np.exp(0.7), e.base - 0.7 * e.scale_height, e.scale_height)
                for e in layers
            )
            assert close(value, replace(ray, fog=replace(ray.fog, layers=moved)).airlight(), 3e-10)


@pytest.mark.claim("height-fog-laws", tolerance="3e-10 relative, two integrals to 1e-10")
def test_scaling_turning_about_the_vertical_and_moving():
    turn = np.array([[0.6, -0.8, 0.0], [0.8, 0.6, 0.0], [0.0, 0.0, 1.0]])
    for ray in drawn(5):
        value, k = ray.airlight(), 3.7
        layers = tuple(Layer(e.sigma_t / k, e.base * k, e.scale_height * k) for e in ray.fog.layers)
        fog = replace(ray.fog, layers=layers, constant=ray.fog.constant / k)
        light = ray.light if ray.sun else k * ray.light
        scaled = replace(
            ray, fog=fog, origin=k * ray.origin, light=light, x0=k * ray.x0, x1=k * ray.x1
        )
        assert close(scaled.airlight() * (1 if ray.sun else k * k), value, 3e-10)
        for matrix in (turn, np.diag([1.0, -1.0, 1.0])):
            turned = [matrix @ part for part in (ray.origin, ray.direction, ray.light)]
            assert close(
                replace(ray, origin=turned[0], direction=turned[1], light=turned[2]).airlight(),
                value,
                3e-10,
            )
        moved = tuple(replace(each, base=each.base + 1.9) for each in ray.fog.layers)
        by = np.array([4.0, -3.0, 1.9])
        light = ray.light if ray.sun else ray.light + by
        lifted = replace(
            ray, fog=replace(ray.fog, layers=moved), origin=ray.origin + by, light=light
        )
        assert close(lifted.airlight(), value, 3e-10)


@pytest.mark.claim("height-fog-laws", tolerance="1e-8 relative, of the quadrature")
def test_the_sun_by_quadrature_of_depths():
    for ray in (each for each in drawn(6) if each.sun):
        fog, rise, mu = ray.fog, ray.direction[2], ray.light[2]

        def integrand(x, fog=fog, z0=ray.origin[2], rise=rise, mu=mu):
            z = z0 + rise * x
            return fog.density(z) * np.exp(-fog.optical_depth(z0, z, x) - fog.column(z) / mu)

        marks = sorted((z - ray.origin[2]) / rise for z in fog.kinks)
        ends = [ray.x0, *(x for x in marks if ray.x0 < x < ray.x1), ray.x1]
        sums = sum(
            quad(integrand, a, b, epsrel=1e-11, limit=200)[0] for a, b in itertools.pairwise(ends)
        )
        assert close(ray.airlight(), sums * ray.phase(ray.light @ ray.direction), 1e-8)


@pytest.mark.claim("height-fog-laws", tolerance="1e-6 relative for steps of 1e-8 in the direction")
def test_the_sun_is_continuous_through_the_horizon_and_through_the_suns_own_height():
    fog = HeightFog((Layer(0.11, 1.3, 4.1), Layer(0.02, -0.7, 19.0)))
    for rise in (0.0, 0.3):
        for end in (7.0, np.inf):
            nearby = height_fog_sun(
                fog, 0.4, rise + np.array([-1e-8, 0.0, 1e-8]), 0.0, end, sun=0.3, phase=1.0
            )
            assert np.ptp(nearby) < 1e-6 * nearby[1]
    down = np.linspace(-1, 0, 21)
    bound = 0.3 / (0.3 - down)
    assert (height_fog_sun(fog, 0.4, down, 0.0, np.inf, sun=0.3, phase=1.0) <= bound).all()


@pytest.mark.claim("height-fog-laws", tolerance="3e-10 relative, two integrals to 1e-10")
def test_a_high_cap_an_empty_layer_and_a_low_clamp_change_nothing():
    for ray in (each for each in drawn(7) if not each.fog.constant):
        fog = replace(ray.fog, clamped=False)
        value = replace(ray, fog=fog).airlight()
        top = max(each.base + 60 * each.scale_height for each in fog.layers)
        for same in (
            replace(fog, cap=top),
            replace(fog, layers=(*fog.layers, Layer(0.0, 1.0, 2.0))),
            replace(fog, clamped=True, layers=tuple(_lowered(each) for each in fog.layers)),
        ):
            assert close(replace(ray, fog=same).airlight(), value, 3e-9)


def test_a_base_above_the_cap_is_a_constant_up_to_it():
    far, none = HeightFog((Layer(0.01, 150.0, 0.05),), 0.0, True, 0.0, 100.0), HeightFog((), 0.01)
    heights = np.array([-3.0, 0.0, 40.0, 100.0, 120.0])
    assert far.column(heights) == pytest.approx(replace(none, floor=0.0, cap=100.0).column(heights))


def _lowered(layer: Layer) -> Layer:
    """The same layer by a base below everything."""
    return Layer(
        layer.sigma_t * np.exp((layer.base + 60) / layer.scale_height), -60.0, layer.scale_height
    )


def test_a_light_in_the_interval_and_lights_beyond_the_cap():
    fog, phase = HeightFog((Layer(0.1, 0.0, 2.0),), floor=-1.0, cap=3.0), Isotropic()
    rays = HeightRays(*(np.array(v) for v in (1.0, 0.0, 5.0, 0.0, 1.0)))
    assert np.isposinf(height_fog_segments(fog, rays, 0.0, 9.0, phase)[0][0])
    assert np.isfinite(height_fog_segments(fog, rays, 0.0, 4.0, phase)[0][0])
    # The light above the cap, the camera below the floor: both ways are cut.
    outside = HeightRays(*(np.array(v) for v in (-4.0, 0.6, 9.0, 3.0, 8.0)))

    def integrand(x):
        z, r = -4.0 + 0.6 * x, np.hypot(3.0, x - 9.0)
        to_cap = r * (3.0 - z) / (8.0 - z)
        depth = fog.optical_depth(-1.0, z, (z + 1.0) / 0.6) + fog.optical_depth(z, 3.0, to_cap)
        return fog.density(z) * np.exp(-depth) / r**2

    expected = quad(integrand, 5.0, 7 / 0.6, epsrel=1e-12)[0]
    assert close(height_fog_segments(fog, outside, 0.0, 50.0, phase)[0][0], expected, 1e-9)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: HeightFog((Layer(-0.1, 0.0, 1.0),)), "extinction of 0 or more"),
        (lambda: HeightFog((Layer(0.1, 0.0, 0.0),)), "scale height"),
        (lambda: HeightFog(floor=1.0, cap=1.0), "cap"),
        (
            lambda: height_fog_sun(HeightFog(), 0, 0, 0, 1, sun=0.0, phase=1),
            "at or below the horizon",
        ),
        (lambda: height_fog_sun(HeightFog((), 0.1), 0, 0, 0, 1, sun=0.5, phase=1), "no cap"),
    ],
)
def test_refusals(make, message):
    with pytest.raises(InputError, match=message):
        make()
