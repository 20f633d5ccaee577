# SPDX-License-Identifier: BSD-3-Clause
"""The integrator `single-scatter` against everything that leads to the same radiance without its code."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from scipy.stats import t

from analytic.errors import InputError
from reference.monte_carlo.batches import merged
from reference.monte_carlo.single_scatter.estimator import ray_light
from reference.monte_carlo.single_scatter.integrator import single_scatter_batch
from reference.monte_carlo.single_scatter.scene_data import read_task
from reference.monte_carlo.single_scatter.stretches import double_ray
from reference.quadrature.image import quadrature_image
from reference.scene.read import read_reference
from tests.helpers import airlight_sum
from tests.helpers.scenes import spot, tiny_scene

_BATCHES = 32


def _load(**changes):
    return mi.load_dict(tiny_scene(**changes))


def _run(scene, *, samples=64, first_seed=0, batches=_BATCHES):
    reference = read_reference(scene)
    done = single_scatter_batch(reference, first_seed, samples)
    for seed in range(first_seed + 1, first_seed + batches):
        done = merged(done, single_scatter_batch(reference, seed, samples))
    return done


def _along(scene, origin, direction, *, samples, seed, medium=None):
    """Return airlight and surface along rays, (rays, 3) each."""
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(seed, len(direction))
    ray = double_ray(mi.Point3d(np.broadcast_to(origin, direction.shape).T), mi.Vector3d(direction.T))
    task = read_task(scene, medium, samples)
    layers = ray_light(task, sampler, ray, medium, dr.full(mi.Bool, True, len(direction)))
    return [np.array(layer, dtype=np.float64).T for layer in layers]


def _mean_and_error(scene, origin, direction, *, medium=None, batches=24, samples=64):
    runs = [_along(scene, origin, direction, samples=samples, seed=seed, medium=medium)[0] for seed in range(batches)]
    return np.mean(runs, axis=0), np.std(runs, axis=0, ddof=1) / np.sqrt(batches)


def _assert_agrees(mean, error, expected, *, batches, largest_error):
    """Assert that no value is off by more than chance, family level 1e-4, and that the run could have seen a bias."""
    lit = expected > 0
    assert np.all(mean[~lit] == 0)
    # Rounding in single precision: 3e-6 of a value, to be seen where the sampling error is smaller still.
    score = (mean - expected)[lit] / np.hypot(error[lit], 3e-6 * expected[lit])
    assert np.abs(score).max() < t.isf(0.5e-4 / lit.sum(), batches - 1)
    assert np.median(error[lit] / expected[lit]) < largest_error


FOG = {"type": "homogeneous", "id": "fog", "sigma_t": 0.31, "albedo": 0.8}
COLOURED = {"sigma_t": {"type": "rgb", "value": [0.1, 0.3, 0.7]}, "has_spectral_extinction": True}
CASES = {
    "sphere and floor": {},
    "no surface": {"ball": None, "floor": None},
    "spot": {"lamp": "hard spot"},
    "soft spot": {"lamp": "soft spot"},
    "two lights": {"second": "soft spot"},
    "forward lobe": {"fog": FOG | {"phase": {"type": "hg", "g": 0.8}}},
    "backward lobe": {"fog": FOG | {"phase": {"type": "hg", "g": -0.5}}},
    "rayleigh": {"fog": FOG | {"phase": {"type": "rayleigh"}}},
    "coloured": {"fog": FOG | COLOURED},
    "dense": {"fog": FOG | {"sigma_t": 2.3}},
}


def _case(name):
    spots = {"hard spot": spot(), "soft spot": spot(beam=11.0)}
    return {key: spots[value] if isinstance(value, str) else value for key, value in CASES[name].items()}


_FAST = ("sphere and floor", "soft spot", "coloured")


@pytest.mark.claim("single-scatter-agrees", tolerance="family level 1e-4; bias within four errors below 0.1 %")
@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[] if name in _FAST else pytest.mark.statistical) for name in CASES]
)
def test_agrees_with_the_quadrature(variant, name):
    """Rationale: the certified integral over lit intervals and this estimator share no derivation.

    Setup: 16 x 12 pixels, 32 batches of 64 stratified distances, fixed seeds.
    Expected: each pixel within its error at a family level of 1e-4, pooled bias within four standard errors, and those
    below 0.1 %; surfaces, which need no sampling, to the rounding of single precision.
    """
    scene = _load(**_case(name))
    reference = quadrature_image(read_reference(scene))
    batches = _run(scene)
    expected = reference.airlight.reshape(-1, 3)
    mean, error = batches.mean[0], batches.standard_error[0]
    _assert_agrees(mean, error, expected, batches=_BATCHES, largest_error=0.01)
    for channel in range(3):
        total = expected[:, channel].sum()
        pooled = np.sqrt(np.sum(error[:, channel] ** 2)) / total
        assert pooled < 1e-3
        assert abs(mean[:, channel].sum() / total - 1) < 4 * pooled + 1e-6
    # A pixel at the terminator or on an edge of a shadow may fall on either side: none does in these scenes.
    assert batches.mean[1] == pytest.approx(reference.surface.reshape(-1, 3), rel=5e-6, abs=1e-12)
    assert np.all(batches.standard_error[1] == 0)


def _box_and_sphere(lamp):
    """Return a scene of two bounded media, coloured fog in a box and grey fog in a sphere, over a wall, with a lamp."""
    transform = mi.ScalarTransform4f()
    return mi.load_dict(
        {
            "type": "scene",
            "box": {
                "type": "cube",
                "to_world": transform.scale(_HALF),
                "bsdf": {"type": "null"},
                "interior": {
                    "type": "homogeneous",
                    "sigma_t": {"type": "rgb", "value": list(_BOX_SIGMA)},
                    "has_spectral_extinction": True,
                    "albedo": 0.8,
                    "phase": {"type": "hg", "g": 0.5},
                },
            },
            "ball": {
                "type": "sphere",
                "center": list(_CENTRE),
                "radius": _RADIUS,
                "bsdf": {"type": "null"},
                "interior": {"type": "homogeneous", "sigma_t": _SPHERE_SIGMA, "albedo": 0.6},
            },
            "wall": {
                "type": "rectangle",
                "to_world": transform.translate([0, 0, -3]).scale(9),
                "bsdf": {"type": "diffuse", "reflectance": 0.5},
            },
            "lamp": {"type": "point", "position": list(lamp), "intensity": 5.0},
        }
    )


_HALF, _BOX_SIGMA = np.array([1.1, 0.9, 0.8]), np.array([0.9, 0.4, 0.2])
_CENTRE, _RADIUS, _SPHERE_SIGMA = np.array([2.6, 0.2, 0.0]), 0.7, 0.5
_LAMPS = {"in vacuum": np.array([1.7, 0.4, 1.5]), "in the box": np.array([0.31, 0.23, 0.11])}


_BODIES = [
    airlight_sum.Body(airlight_sum.box((0, 0, 0), _HALF), _BOX_SIGMA, 0.8, airlight_sum.henyey_greenstein(0.5)),
    airlight_sum.Body(
        airlight_sum.ball(_CENTRE, _RADIUS), np.full(3, _SPHERE_SIGMA), 0.6, airlight_sum.henyey_greenstein(0.0)
    ),
]


def _plain_airlight(lamp, origin, direction):
    light = airlight_sum.Light(lamp, 1.0, np.full(3, 5.0))
    return airlight_sum.airlight_sum(origin, direction, light, _BODIES, steps=4000)


def _optical_depth(start, end):
    """Return the optical depth between points, (rays, 3)."""
    way = end - start
    length = np.linalg.norm(way, axis=-1)
    depth = np.zeros((len(way), 3))
    for body in _BODIES:
        near, far = body.chord(start, way / length[:, None])
        depth += np.maximum(np.minimum(far, length) - np.maximum(near, 0), 0)[:, None] * body.sigma_t
    return depth


@pytest.mark.claim("bounded-media", tolerance="family level 1e-4, errors below 1e-3")
@pytest.mark.parametrize("place", _LAMPS)
def test_bounded_media_against_a_plain_sum(variant, place):
    """Rationale: boundaries are walked on both legs; slabs and spheres have crossings in closed form.

    Setup: coloured fog in a box, grey in a sphere, camera in vacuum, a wall behind; 40 rays, 4000 midpoints
    each, whose own error is below 1e-6.
    """
    lamp = _LAMPS[place]
    scene = _box_and_sphere(lamp)
    rng = np.random.default_rng(0)
    origin = np.array([-4.0, -1.0, 0.6])
    direction = rng.uniform([-1, -0.8, -0.7], [3, 0.8, 0.7], (40, 3)) - origin
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    expected = np.array([_plain_airlight(lamp, origin, towards) for towards in direction])
    mean, error = _mean_and_error(scene, origin, direction, batches=16, samples=128)
    assert np.count_nonzero(expected[:, 0]) > 30
    _assert_agrees(mean, error, expected, batches=16, largest_error=1e-3)

    surface = _along(scene, origin, direction, samples=1, seed=0)[1]
    reach = (-3 - origin[2]) / direction[:, 2]
    wall = origin + reach[:, None] * direction
    hit = (reach > 0) & (np.abs(wall[:, :2]).max(axis=1) < 9)
    away = wall - lamp
    r = np.linalg.norm(away, axis=1)
    depth = _optical_depth(np.broadcast_to(origin, wall.shape), wall) + _optical_depth(lamp, wall)
    lit = (0.5 / np.pi * 5.0 * -away[:, 2] / r**3)[:, None] * np.exp(-depth)
    assert hit.sum() > 3
    assert surface[hit] == pytest.approx(lit[hit], rel=5e-6)
    assert np.all(surface[~hit] == 0)


@pytest.mark.claim("enclosed-light")
def test_enclosed_light_gives_exactly_zero(variant):
    closed = {"type": "sphere", "center": [0.9, 0.7, 1.9], "radius": 0.21}
    batches = _run(_load(shell=closed), batches=2, samples=16)
    assert np.all(batches.mean == 0)


@pytest.mark.claim("scenes-refused-by-name")
@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (
            {"ball": {"type": "sphere", "id": "ball", "bsdf": {"type": "mask", "nested": {"type": "diffuse"}}}},
            "shape 'ball' has a material that is transparent in part",
        ),
        (
            {"ball": {"type": "sphere", "id": "ball", "bsdf": {"type": "dielectric"}, "interior": FOG | {"id": "in"}}},
            "shape 'ball' bounds a medium with a material that stops or bends light",
        ),
    ],
)
def test_unsupported_scenes_are_refused_by_name(variant, changes, words):
    with pytest.raises(InputError, match=words):
        read_task(_load(**changes), None, 1)
