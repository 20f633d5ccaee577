# SPDX-License-Identifier: BSD-3-Clause
"""`single-scatter` and `volpath` under area lights, against closed forms
and against one another.
"""

from dataclasses import replace

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from airlight.reference.monte_carlo.batches import merged
from airlight.reference.monte_carlo.single_scatter.area_sampling import emitting
from airlight.reference.monte_carlo.single_scatter.integrator import single_scatter_batch
from airlight.reference.monte_carlo.volpath import volpath_batch
from airlight.reference.scene.read import read_reference
from tests.helpers.area_lights import BLACK, NULL, lamp, lit_scene, ring
from tests.helpers.scenes import tiny_scene

_BATCHES = 24
#: Extinction, height and radius of a sphere light past a ray from -2 to 3 m of its foot, and the
#: integral K: certified by mpmath over directions and by Gauss' rule over the cap; L = sigma_s Le
#: K / (4 pi).
SPHERES = (
    (0.21, 0.83, 0.1, 0.04880854432449),
    (0.21, 0.83, 0.3, 0.4626164168379),
    (0.21, 0.83, 0.6, 2.123635219885),
    (1.3, 0.83, 0.3, 0.02890607888329),
    (0.21, 0.35, 0.3, 1.619271567439),
)


def _at(place, target, scale):
    return mi.ScalarTransform4f().look_at(
        list(place), list(target), [0, 0, 1]
    ) @ mi.ScalarTransform4f().scale(scale)


def _lamp(kind, bsdf, *, in_view=False):
    """Return a light above the ball, or one before the camera that faces it."""
    place, target = (
        ((0.15, -0.9, 1.3), (0.1, -3.0, 0.9)) if in_view else ((0.9, 0.7, 1.9), (0.1, -0.5, 0.4))
    )
    if kind == "mesh":
        return ring(place, size=0.8, radiance=(5.0, 4.0, 3.0), bsdf=bsdf)
    scale = {"rectangle": [0.5, 0.3, 1.0], "disk": [0.4, 0.4, 1.0], "sphere": [0.3, 0.3, 0.3]}[kind]
    return lamp(kind, radiance=(5.0, 4.0, 3.0), bsdf=bsdf, to_world=_at(place, target, scale))


def _reference(**changes):
    scene = tiny_scene(**changes)
    if changes.get("fog", scene) is None:
        scene["sensor"] = {key: entry for key, entry in scene["sensor"].items() if key != "medium"}
    return read_reference(mi.load_dict(scene))


def _run(batch, reference, samples, batches=_BATCHES):
    done = batch(reference, 0, samples)
    for seed in range(1, batches):
        done = merged(done, batch(reference, seed, samples))
    return done


def _pooled(batches, layer):
    """Return the mean of a layer by channel and its standard error, from the
    spread of the batches' totals.
    """
    totals = batches.totals[:, layer]
    return totals.mean(axis=0), totals.std(axis=0, ddof=1) / np.sqrt(len(totals))


@pytest.mark.claim(
    "area-lights-by-samples", tolerance="four standard errors, which are below 0.25 %"
)
@pytest.mark.parametrize(
    "bsdf", [BLACK, pytest.param(NULL, marks=pytest.mark.statistical)], ids=["black", "null"]
)
@pytest.mark.parametrize(
    "sphere",
    [pytest.param(s, marks=[] if s in SPHERES[1::3] else pytest.mark.statistical) for s in SPHERES],
)
def test_sphere_light_has_the_certified_airlight(variant, sphere, bsdf):
    """Rationale: the one shape whose airlight without occluder is known to 13 digits; a black
    one must not hide itself.

    Setup: 30 000 estimates of one ray of 5 m that a small disk ends, 64 samples each.
    """

    sigma_t, height, radius, expected = sphere
    end = mi.ScalarTransform4f().translate([3.0, 0.0, 0.0]).rotate([0, 1, 0], 90).scale(0.01)
    scene = tiny_scene(
        fog={"type": "homogeneous", "id": "fog", "sigma_t": sigma_t, "albedo": 1.0},
        lamp=lamp(
            "sphere", radiance=(1.0, 1.0, 1.0), bsdf=bsdf, center=[0.0, height, 0.0], radius=radius
        ),
        end={"type": "disk", "to_world": end, "bsdf": BLACK},
        ball=None,
        floor=None,
    )
    scene["sensor"]["to_world"] = mi.ScalarTransform4f().look_at(
        [-2.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 1.0]
    )
    count = 30_000
    ways = np.tile([1.0, 0.0, 0.0], (count, 1))
    reference = replace(read_reference(mi.load_dict(scene)), width=count, height=1, direction=ways)
    values = single_scatter_batch(reference, 17, 64).mean[0, :, 0] * 4 * np.pi / sigma_t
    error = values.std() / np.sqrt(count)
    assert error < 2.5e-3 * expected
    assert abs(values.mean() - expected) < 4 * error


_CASES = {
    f"{kind}, {'black' if bsdf is BLACK else 'null'}, {'in view' if in_view else 'above'}": {
        "lamp": (kind, bsdf, in_view)
    }
    for kind in ("rectangle", "disk", "sphere", "mesh")
    for bsdf in (BLACK, NULL)
    for in_view in (False, True)
}
_FAST = ("rectangle, black, in view",)


@pytest.mark.claim("area-lights-by-samples", tolerance="four standard errors, which are below 1 %")
@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=[] if n in _FAST else pytest.mark.statistical) for n in _CASES]
)
def test_both_estimators_agree(variant, name):
    """Rationale: they share no sample of the light: one draws points on it, the other asks Mitsuba.

    Setup: ball and floor, 16 x 12 pixels, 24 batches of 256 samples, the light in the picture or
    not. Around a mesh volpath's batches differ by 5 %: 24 leave 1.1 %. The error of 60 is below 1 %
    even if they differ by 1.5 times that, three standard errors of the spread of 24; around a black
    one 40 do. Expected: airlight and surface pooled within four standard errors, and 0.05 % for the
    shadow-ray epsilon.
    """
    kind, bsdf, in_view = _CASES[name]["lamp"]
    reference = _reference(lamp=_lamp(kind, bsdf, in_view=in_view))
    batches = _BATCHES if kind != "mesh" else 60 if bsdf is NULL else 40
    ours, theirs = (
        _run(batch, reference, 256, batches) for batch in (single_scatter_batch, volpath_batch)
    )
    for layer in (0, 1):
        (mean, error), (other, other_error) = _pooled(ours, layer), _pooled(theirs, layer)
        together = np.hypot(error, other_error)
        assert np.all(together < 0.01 * other)
        assert np.all(np.abs(mean - other) < 4 * together + 5e-4 * other)


@pytest.mark.claim(
    "area-lights-by-samples", tolerance="four standard errors, which are below 0.2 %"
)
@pytest.mark.parametrize(
    "kind",
    ["rectangle", *(pytest.param(k, marks=pytest.mark.statistical) for k in ("disk", "sphere"))],
)
def test_surfaces_are_those_of_mitsubas_direct_integrator(variant, kind):
    """Rationale: without fog, Mitsuba's `direct` is a third way to the light on surfaces."""
    fog = tiny_scene()["fog"] | {"sigma_t": 0.0}
    reference = _reference(lamp=_lamp(kind, BLACK), fog=fog)
    ours = _run(single_scatter_batch, reference, 256)
    pixels, samples = len(reference.direction), 4096
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(3, pixels * samples)
    pixel = dr.arange(mi.UInt32, pixels * samples) // samples
    direction = dr.gather(mi.Vector3f, mi.Vector3f(reference.direction.T), pixel)
    start = mi.Point3f(*(float(c) for c in reference.origin))
    direct = mi.load_dict({"type": "direct", "hide_emitters": True})
    seen, _, _ = direct.sample(
        reference.scene, sampler, mi.RayDifferential3f(mi.Ray3f(start, direction))
    )
    values = np.array(seen, dtype=np.float64).T.reshape(pixels, samples, 3)
    expected, spread = (
        values.mean(axis=(0, 1)),
        np.sqrt((values.var(axis=1) / samples).sum(axis=0)) / pixels,
    )
    mean, error = _pooled(ours, 1)
    together = np.hypot(error, spread)
    assert np.all(together < 2e-3 * expected)
    assert np.all(np.abs(mean - expected) < 4 * together)


@pytest.mark.parametrize(
    "kind",
    ["sphere", *(pytest.param(k, marks=pytest.mark.slow) for k in ("mesh", "rectangle", "disk"))],
)
def test_density_of_points_on_a_light(variant, kind):
    """Rationale: an importance density that is wrong anywhere is a bias.

    Setup: a place that faces it, rays that meet it, pass beside it and along its edge; a million
    points each. Expected: the mean of 1/density over any part of the light that faces the place, or
    all rays, is the area of that part, within four standard errors.
    """

    (light,) = read_reference(lit_scene(lamp=_lamp(kind, BLACK))).area
    shape, count = emitting(light), 1 << 20
    u, v = (mi.Float64(values) for values in np.random.default_rng(5).random((2, count)))
    centre, (across, up, _) = light.centre, light.frame
    place = centre + np.array([0.9, 0.4, -1.3])
    faces, seen = shape.facing(u, v, mi.Point3d(*map(float, place))), np.full(count, True)
    even, drawn = np.array(faces.position).T, [(faces, seen)]
    if kind == "sphere":
        normal = np.random.default_rng(6).normal(size=(count, 3))
        normal /= np.linalg.norm(normal, axis=1)[:, None]
        even = centre + light.radius * normal
        drawn = [(faces, normal @ (place - centre) > light.radius)]
    for aside in (0.0, 0.7, 1.0, -1.0, 3.0):
        through = centre + aside * light.half[0] * across
        direction = np.array([0.31, -0.83, 0.29])
        for origin in (through - 2 * direction, through + 2 * direction):
            direction /= np.linalg.norm(direction)
            to = mi.Point3d(*map(float, origin)), mi.Vector3d(*map(float, direction))
            drawn.append((shape.towards(u, v, *to), seen))
    for point, meant in drawn:
        density = np.array(point.density)
        worth = np.divide(1, density, out=np.zeros(count), where=density > 0)
        for part in (
            lambda place: place @ across > -9,
            lambda place: (place @ across > 0.05) & (place @ up < 0.1),
        ):
            inside = part(np.array(point.position).T - centre)
            fraction = float((part(even - centre) & meant).mean())
            error = (worth * inside).std() / np.sqrt(count) + 2e-3 * light.area * (fraction < 1)
            assert abs((worth * inside).mean() - fraction * light.area) < 4 * error + 1e-9
