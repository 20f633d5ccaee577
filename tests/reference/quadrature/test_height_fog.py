# SPDX-License-Identifier: BSD-3-Clause
"""The reference in height fog: against homogeneous fog, steps that know the density alone,
Mitsuba; injected faults.
"""

from dataclasses import replace

import numpy as np
import pytest

from airlight.analytic.height_fog import HeightFog
from airlight.analytic.phase import HenyeyGreenstein
from airlight.errors import InputError
from airlight.reference.monte_carlo.volpath import volpath_batch
from airlight.reference.quadrature.height_fog import HeightField, fog_of
from airlight.reference.quadrature.image import quadrature_image
from airlight.reference.quadrature.integrate import Paths, Terms
from airlight.reference.quadrature.model_terms import route_of
from airlight.reference.quadrature.replicates import PointPlan
from airlight.reference.scene.homogeneous_medium import ReferenceMedium
from airlight.reference.scene.model import Model
from airlight.reference.scene.read import read_reference
from airlight.reference.scene.shadow_epsilon import measure_shadow_epsilon
from airlight.reference.scene.varying import HeightMedium
from airlight.reference.visibility.planes import rays_at
from airlight.validation.scenes.loading import load_scene
from tests.evidence.injected import Wrap, injected
from tests.helpers.biases import biases
from tests.helpers.height_fog import LAMP, SPOT, SUN, fog_xml

PANEL = """<shape type="rectangle" id="panel">
    <transform name="to_world"><scale value="0.7"/><lookat origin="2, -2, 5" target="0, 0, 1" up="0, 1, 0"/></transform>
    <emitter type="area"><rgb name="radiance" value="11, 9, 7"/></emitter></shape>"""
BATCHES = 40


@pytest.fixture
def scene(variant, tmp_path):
    def load(*lights, size=(24, 18)):
        path = tmp_path / "fog.xml"
        path.write_text(fog_xml(*lights, size=size))
        return load_scene(str(path)).scene

    return load


@pytest.mark.claim(
    "height-fog-reference", tolerance="1e-6 relative: the height of the scene over H = 1e8 m"
)
def test_a_large_scale_height_is_the_image_of_homogeneous_fog(scene):
    reference = read_reference(scene(LAMP, SPOT, PANEL, size=(8, 6)))
    plain = ReferenceMedium(
        np.full(3, 0.06), reference.medium.albedo, reference.medium.phase, reference.medium.plugin
    )
    deep = replace(
        reference.medium, layers=((0.06, 0.0, 1e8),), constant=0.0, floor=-np.inf, cap=np.inf
    )
    how = {"checks": 0, "plan": PointPlan(error=0.0, first=4, most=4)}
    images = [
        quadrature_image(replace(reference, medium=medium), **how) for medium in (plain, deep)
    ]
    for layer in ("airlight", "surface", "emitted"):
        expected, found = (getattr(image, layer) for image in images)
        np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-9 * expected.max())


@pytest.mark.claim(
    "height-fog-reference", tolerance="1e-6 relative: the trapezoidal rule with 2e5 steps"
)
def test_the_sun_by_steps_that_know_the_density_alone(scene):
    reference = read_reference(scene(SUN))
    image = quadrature_image(reference, checks=0)
    fog, sun = fog_of(reference.medium), reference.directional[0]
    heights = np.linspace(fog.cap, reference.origin[2], 200001)
    above = _running_sum(fog.density(heights), -heights)
    for column in (0, 11, 23):  # of the uppermost row, on which nothing casts a shadow
        direction = reference.direction[column]
        x = np.linspace(0, (fog.cap - reference.origin[2]) / direction[2], 200001)
        z = np.minimum(reference.origin[2] + direction[2] * x, fog.cap)
        to_sun = np.interp(z, heights[::-1], above[::-1]) / -sun.direction[2]
        depth = _running_sum(fog.density(z), x) + to_sun
        f = fog.density(z) * np.exp(-depth) * reference.medium.phase(-sun.direction @ direction)
        expected = np.trapezoid(f, x) * reference.medium.albedo * sun.irradiance / (4 * np.pi)
        np.testing.assert_allclose(image.airlight[0, column], expected, rtol=1e-6)


def _running_sum(values, x):
    return np.concatenate([[0], np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(x))])


def test_bounds_are_below_a_millionth_of_the_mean(scene):
    image = quadrature_image(read_reference(scene(LAMP, SPOT, SUN)))
    assert image.airlight_error.max() < 1e-6 * image.airlight.mean()
    assert image.left == 0


#: Faults that the comparison with volpath must find, by name.
FAULTS = {
    "height of the wrong light path": Wrap(
        "airlight.analytic.height_fog:height_fog_segments",
        lambda function, fog, rays, *others, **named: function(
            fog, replace(rays, light=rays.origin), *others, **named
        ),
    ),
    "1/H for H": Wrap(
        "airlight.reference.scene.varying:read_height_fog",
        lambda f, *a: _scale_heights(f(*a), lambda h: 1 / h),
    ),
    "ln 2 left out": Wrap(
        "airlight.reference.scene.varying:read_height_fog",
        lambda f, *a: _scale_heights(f(*a), lambda h: h * np.log(2)),
    ),
    "density at the camera for the mean": Wrap(
        "airlight.analytic.height_fog:HeightFog.optical_depth",
        lambda function, self, start, end, length: self.density(start) * length,
    ),
    "the sun's path without its cosine": Wrap(
        "airlight.analytic.height_fog:height_fog_sun",
        lambda function, fog, *others, sun, **named: function(
            _flat(fog, sun), *others, sun=sun, **named
        ),
    ),
}


def _scale_heights(medium: HeightMedium, change) -> HeightMedium:
    return replace(
        medium,
        layers=tuple((sigma_t, base, change(scale)) for sigma_t, base, scale in medium.layers),
    )


class _Flat(HeightFog):
    """Fog whose light paths to the sun are as long as they are high."""

    sun: float

    def column(self, z):
        return super().column(z) * self.sun


def _flat(fog: HeightFog, sun: float) -> HeightFog:
    flat = _Flat(fog.layers, fog.constant, fog.clamped, fog.floor, fog.cap)
    object.__setattr__(flat, "sun", sun)
    return flat


@pytest.mark.slow
@pytest.mark.claim("height-fog-volpath", tolerance="1 % of the image, 95 % intervals of 40 batches")
def test_volpath_agrees_and_injected_faults_are_found(scene):
    loaded = scene(LAMP, SUN)
    reference = read_reference(loaded)
    batches = [volpath_batch(reference, seed, 256) for seed in range(BATCHES)]

    def outside(changes=()):
        with injected(*changes):
            found = read_reference(loaded) if changes else reference
            image = quadrature_image(found, checks=0, shadow_scale=1 - measure_shadow_epsilon())
        return [abs(bias) + half > 0.01 for bias, half in biases(reference, image, batches)]

    assert not any(outside())
    for name, change in FAULTS.items():
        assert any(outside([change])), name


RISES = (1.0, 0.3, 1e-3, 1e-9, 0.0, -1e-9, -1e-3, -0.3, -1.0)


@pytest.mark.parametrize(("clamped", "constant"), [(False, 0.0), (True, 0.0), (True, 0.02)])
@pytest.mark.parametrize("camera", [1.0, 0.01])
@pytest.mark.claim("models", tolerance="1e-9 relative; 3e-4 where a march sums the depth")
def test_light_paths_of_one_length_under_a_sun(clamped, constant, camera):
    """Against Gauss's rule on logarithmic panels of the same integral."""
    layers, g, length = ((0.05, 1.0, 2.0), (0.003, 0.0, 30.0)), 0.4, 7.0
    medium = HeightMedium(
        albedo=np.array([0.9, 0.8, 0.7]),
        phase=HenyeyGreenstein(g),
        largest=np.full(3, 0.3),
        plugin=None,
        layers=layers,
        constant=constant,
        clamped=clamped,
        floor=-np.inf,
        cap=np.inf,
        up=np.array([0.0, 0.0, 1.0]),
    )
    rise = np.array(RISES)
    direction = np.stack([np.sqrt(1 - rise**2), 0 * rise, rise], axis=1)
    towards, origin = np.array([0.48, 0.36, 0.8]), np.array([0.0, 0.0, 1.7])
    rays, every = rays_at(origin, direction, towards, 0), np.arange(len(rise))
    lit = every, np.zeros(len(rise)), np.full(len(rise), np.inf)
    terms = Terms(paths=Paths(np.full(len(rise), camera), 0.0, length))
    value, error = HeightField(medium).sums(rays, lit, lit[2], terms)
    # The same integral: 50 decades of metres, in panels of 1 % of a distance.
    node, weight = np.polynomial.legendre.leggauss(8)
    edges = np.linspace(np.log(1e-12), np.log(1e12), 5600)
    half = 0.5 * np.diff(edges)[:, None]
    u = (edges[:-1, None] + half * (1 + node)).ravel()
    x, dx = np.exp(u), np.exp(u) * (half * weight).ravel()
    z = 1.7 + rise[:, None] * x
    density, depth = np.full(z.shape, constant), constant * np.broadcast_to(x, z.shape)
    with np.errstate(over="ignore", invalid="ignore"):
        for sigma_t, base, scale in layers:
            here = sigma_t * np.exp(-(np.maximum(z - base, 0.0) if clamped else z - base) / scale)
            k = rise[:, None] * x / scale + 1e-300
            along = sigma_t * np.exp((base - 1.7) / scale) * x * -np.expm1(-k) / k
            # Below its base a clamped layer has one density: by the sum of midpoints there.
            summed = np.cumsum(here * dx, axis=1) - 0.5 * here * dx
            depth = depth + (np.where(z < base, summed, along) if clamped else along)
            density = density + here
        light = np.nan_to_num(density * np.exp(-camera * depth - length * density))
    cosine = direction @ towards
    phase = (1 - g * g) / (1 + g * g - 2 * g * cosine) ** 1.5 / (4 * np.pi)
    expected = (light * dx).sum(axis=1) * phase
    falling = clamped & (rise < 0)  # through a base, in the sum of midpoints
    np.testing.assert_allclose(value[~falling, 0], 0.9 * expected[~falling], rtol=1e-9)
    np.testing.assert_allclose(value[falling, 0], 0.9 * expected[falling], rtol=3e-4)
    assert (error[:, 0] <= 1e-9 * value[:, 0]).all()


def test_a_level_ray_under_a_sun_needs_an_end_where_nothing_attenuates_it(scene):
    model = Model(camera_path="off", light_path="length:3")
    reference, none = read_reference(scene(SUN), model), np.array([np.inf])
    level, rising = np.array([[1.0, 0.0, 0.0]]), np.array([[0.6, 0.0, 0.8]])
    with pytest.raises(InputError, match="adds light without end; expected an end of the fog"):
        route_of(replace(reference, direction=level), none)
    for direction, distance in ((rising, none), (level, np.array([9.0]))):
        assert route_of(replace(reference, direction=direction), distance).end == distance


def test_an_uncertain_edge_is_worth_what_the_light_sends_there(scene):
    """A profile of 10, as a fade has before it begins, makes the effect of an edge ten times as
    large.
    """
    reference = read_reference(scene(LAMP))
    rays = rays_at(reference.origin, reference.direction[:4], reference.lights[0].position)
    lit = np.arange(4), np.full(4, 0.5), np.full(4, 2.5)
    field, far = HeightField(reference.medium), np.full(4, np.inf)
    errors = [
        field.sums(rays, lit, far, Terms(profile, edge=edge))[1]
        for profile in (None, lambda x, ray: np.full_like(x, 10.0))
        for edge in (0.0, 1e-3)
    ]
    assert (errors[1] > 100 * errors[0]).all()
    assert errors[3] - errors[2] == pytest.approx(10 * (errors[1] - errors[0]), rel=1e-6)
