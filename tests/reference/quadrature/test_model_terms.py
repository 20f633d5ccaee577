# SPDX-License-Identifier: BSD-3-Clause
"""The terms of a model in the quadrature: against a march in NumPy, closed forms and limits."""

import mitsuba as mi
import numpy as np
import pytest

from airlight.errors import InputError
from airlight.reference.monte_carlo.single_scatter.integrator import single_scatter_batch
from airlight.reference.quadrature.image import quadrature_image
from airlight.reference.quadrature.light_airlight import worth_of_doubt
from airlight.reference.quadrature.reference import reference_image
from airlight.reference.scene.model import Model
from airlight.reference.scene.read import read_reference
from airlight.reference.visibility.certificate import LitIntervals
from airlight.reference.visibility.planes import rays_at
from airlight.validation.scenes.loading import load_scene
from tests.helpers.model_march import marched
from tests.helpers.scenes import tiny_scene

#: Every term, each alone.
TERMS = (
    {"light_path": "off"},
    {"light_path": "0.3", "camera_path": "0.5"},
    {"light_path": "length:4"},
    # A march of a sun without attenuation needs an end.
    {"light_path": "off", "camera_path": "off", "ends": "spheres:0:60"},
    {"law": "softened:1:16"},
    {"law": "clamped:2"},
    {"law": "clamped:1:1"},
    {"law": "power:1"},
    {"law": "sphere:1.5"},
    {"range": "quartic:6"},
    {"range": "fourth:6"},
    {"range": "square:6"},
    {"range": "linear:9"},
    {"spot": "cosine-smooth"},
    {"spot": "cosine-squared"},
    {"spot": "rim:2"},
    {"phase": "none"},
    {"phase": "hg:0.6"},
    {"phase": "cornette-shanks"},
    {"depth": "axis"},
    {"depth": "axis-ends"},
    {"depth": "axis-lookup"},
    {"ends": "planes:1:12"},
    {"ends": "spheres:2:9"},
    {"ends": "planes:0:12", "fade": "4:12"},
    {"ambient": "0.1,0.2,0.3"},
    {"source": "constant:1,2,3", "cap": "0.7", "lobe": "8:2"},
    {
        "lit": "0.01",
        "light_path": "off",
        "camera_path": "off",
        "range": "quartic:8",
        "ends": "spheres:0:60",
    },
    # Lamps are dense, ambient light is not.
    {"lit": "0.5", "light_path": "off", "ambient": "0.1,0.2,0.3", "range": "quartic:8"},
    {"lamps": "3", "suns": "2", "depth": "axis", "ends": "planes:1:20", "law": "sphere:1"},
)


@pytest.fixture
def lamp_ahead(variant):
    """A lamp in the middle of the image, without anything else."""
    to_world = mi.ScalarTransform4f().look_at([0, 0, 0], [0, 0, 1], [0, 1, 0])
    scene = tiny_scene(size=(7, 5), ball=None, floor=None)
    scene["sensor"] |= {"to_world": to_world}
    scene["lamp"] |= {"position": [0, 0, 2.5]}
    return mi.load_dict(scene)


@pytest.fixture
def scaled_scenes(variant):
    """A scene, and the same with lengths times 2, extinction halved and intensity times 4."""
    scenes = []
    for scale in (1.0, 2.0):
        scene = tiny_scene(size=(8, 6), ball=None, floor=None)
        scene["fog"] |= {"sigma_t": 0.32 / scale}
        places = [[scale * x for x in each] for each in ([0.2, -4.1, 1.3], [0.1, 0.0, 0.6])]
        to_world = mi.ScalarTransform4f().look_at(*places, [0, 0, 1])
        scene["sensor"] |= {"to_world": to_world}
        intensity = {"type": "rgb", "value": [scale**2 * each for each in (5.0, 4.0, 3.0)]}
        scene["lamp"] |= {
            "position": [scale * x for x in (0.9, 0.7, 1.9)],
            "intensity": intensity,
        }
        scenes.append(mi.load_dict(scene))
    return scenes


@pytest.fixture
def sun_without_bounds(variant):
    """A sun over the tiny scene's sphere, in fog without bounds, where no shadow is seen."""
    sun = {
        "type": "directional",
        "direction": [0.3, 0.5, -0.7],
        "irradiance": {"type": "rgb", "value": [3.0, 2.0, 1.0]},
    }
    fog = tiny_scene()["fog"] | {"phase": {"type": "hg", "g": 0.4}}
    return mi.load_dict(tiny_scene(size=(8, 6), ball=None, floor=None, lamp=sun, fog=fog))


def image_of(scene, **terms):
    return quadrature_image(read_reference(scene, Model(**terms)), checks=0)


def agrees(loaded, tolerance, steps=4096, **terms):
    """Check the airlight of a scene against a march, relative to the largest pixel."""
    reference = read_reference(loaded.scene, Model(**terms))
    image = quadrature_image(reference, checks=0)
    expected = marched(reference, image.distance.ravel(), steps)
    found = image.airlight.reshape(-1, 3)
    assert np.abs(found - expected).max() <= tolerance * np.abs(expected).max()
    # The march is not what states the error: that is far below it.
    assert image.airlight_error.max() < 1e-7 * np.abs(expected).max()


@pytest.mark.parametrize("terms", TERMS, ids=lambda terms: ",".join(terms.values()))
@pytest.mark.claim("models", tolerance="2e-6 of the largest: midpoints of 4096 steps")
def test_terms_without_shadows(variant, terms):
    agrees(load_scene("open-fog", (8, 6)), 2e-6, **terms)


@pytest.mark.slow
@pytest.mark.parametrize("terms", TERMS, ids=lambda terms: ",".join(terms.values()))
@pytest.mark.parametrize("scene", ["street", "meadow", "sphere-spot"])
@pytest.mark.claim("models", tolerance="1e-3 of the largest: edges of shadows fall between steps")
def test_terms_among_shadows_and_in_height_fog(variant, scene, terms):
    # A march of logarithmic steps meets edges of shadows far from a lamp by chance.
    agrees(load_scene(scene, (8, 6)), 1e-3, 16384, **terms)


@pytest.mark.claim("models", tolerance="1e-12: float64 of an arctangent")
def test_a_softened_law_without_attenuation_is_an_arctangent(variant, lamp_ahead):
    """Also where the light lies on the ray."""
    softened = {"law": "softened:0.7:3", "light_path": "off", "camera_path": "off"}
    image = image_of(lamp_ahead, **softened)
    reference = read_reference(lamp_ahead)
    light, e = reference.lights[0], 0.7
    foot = reference.direction @ (light.position - reference.origin)
    away = reference.origin + foot[:, None] * reference.direction - light.position
    width = np.sqrt(np.sum(away**2, axis=1) + e)
    whole = 3 * (0.5 * np.pi + np.arctan(foot / width)) / width
    albedo_sigma = reference.medium.albedo * reference.medium.sigma_t
    expected = albedo_sigma * light.intensity / (4 * np.pi) * whole[:, None]
    np.testing.assert_allclose(image.airlight.reshape(-1, 3), expected, rtol=1e-12)


def test_an_infinite_law_on_the_ray_is_refused_and_a_finite_one_is_not(variant, lamp_ahead):
    with pytest.raises(InputError, match="infinite"):
        reference_image(lamp_ahead, model=Model(light_path="off"))
    soft = reference_image(lamp_ahead, model=Model(law="softened:0.01"))
    assert np.isfinite(soft.airlight).all()
    assert soft.airlight_error.max() < 1e-9 * soft.airlight.max()


def test_laws_become_the_physical_one(variant):
    scene = load_scene("open-fog", (8, 6)).scene
    physical = image_of(scene).airlight
    errors = {
        name: [
            np.abs(image_of(scene, **{term: f"{kind}:{value:g}"}).airlight - physical).max()
            for value in values
        ]
        for name, (term, kind, values) in {
            "softened": ("law", "softened", (1e-3, 1e-4)),
            "range": ("range", "quartic", (80, 160)),
        }.items()
    }
    # e to the first power, R to the minus fourth.
    assert 8 < errors["softened"][0] / errors["softened"][1] < 12
    assert 14 < errors["range"][0] / errors["range"][1] < 18


def test_a_fraction_of_the_light_path_lies_between(variant):
    scene = load_scene("sphere-spot", (8, 6)).scene
    none, half, whole = (image_of(scene, light_path=path) for path in ("off", "0.5", "on"))
    for layer in ("airlight", "surface"):
        low, middle, high = (getattr(each, layer) for each in (whole, half, none))
        assert np.all(low <= middle)
        assert np.all(middle <= high)
        assert low.sum() < high.sum()


def test_units_scale_with_the_lengths_of_a_model(variant, scaled_scenes):
    """Lengths times 2, extinction halved and intensity times 4: lengths of a model are in metres."""
    one, two = scaled_scenes
    small = image_of(one, law="softened:0.5", range="quartic:6", ends="spheres:1:9").airlight
    large = image_of(two, law="softened:2", range="quartic:12", ends="spheres:2:18").airlight
    np.testing.assert_allclose(large, small, rtol=1e-6, atol=1e-9 * small.max())


def test_a_sun_in_fog_without_bounds_has_light_where_its_way_does_not_attenuate(
    variant, sun_without_bounds
):
    with pytest.raises(InputError, match="nothing of it arrives"):
        read_reference(sun_without_bounds)
    image = image_of(sun_without_bounds, light_path="off")
    reference = read_reference(sun_without_bounds, Model(light_path="off"))
    sun = reference.directional[0]
    phase = reference.medium.phase(reference.direction @ -sun.direction)[:, None]
    # p E Omega (1 - exp(-sigma D))/(4 pi), D to the surface or infinite.
    opacity = -np.expm1(-reference.medium.sigma_t * image.distance.reshape(-1, 1))
    expected = phase * sun.irradiance * reference.medium.albedo * opacity / (4 * np.pi)
    np.testing.assert_allclose(image.airlight.reshape(-1, 3), expected, rtol=1e-9)


def test_a_sun_without_an_end_is_refused(variant, sun_without_bounds):
    with pytest.raises(InputError, match="without end"):
        image_of(sun_without_bounds, light_path="off", camera_path="off")


@pytest.mark.claim("models", tolerance="2e-5: depths are those of float32 rays")
def test_surfaces_of_a_model(variant):
    """By the law, the paths and the factor; the physical surface has the material."""
    scene = load_scene("sphere-spot", (12, 9)).scene
    terms = {
        "law": "softened:1:16",
        "range": "quartic:30",
        "light_path": "off",
        "surface_factor": "3",
        "surface_camera_path": "0.5",
    }
    physical, image = image_of(scene), image_of(scene, **terms)
    reference = read_reference(scene)
    distance = np.where(np.isfinite(physical.distance), physical.distance, 0.0)
    point = reference.origin + distance.reshape(-1, 1) * reference.direction
    r = np.linalg.norm(point - reference.lights[0].position, axis=1).reshape(distance.shape)
    sigma_t = reference.medium.sigma_t
    lit = physical.surface > 0
    ratio = 3 * 16 * r**2 / (r**2 + 1) * (1 - np.minimum(r / 30, 1) ** 4) ** 2
    factor = ratio[..., None] * np.exp(sigma_t * (r + 0.5 * distance)[..., None])
    assert lit.mean() > 0.1
    np.testing.assert_allclose(image.surface[lit], (factor * physical.surface)[lit], rtol=2e-5)


@pytest.mark.statistical
@pytest.mark.parametrize(
    "terms",
    [
        {"light_path": "0.5", "camera_path": "0.6"},
        {"light_path": "off", "law": "softened:0.5:2"},
        {"light_path": "length:0.4", "range": "quartic:5"},
    ],
    ids=lambda terms: ",".join(terms.values()),
)
@pytest.mark.claim("models", tolerance="4 standard errors of the other estimator")
def test_density_grids_agree_with_samples(variant, terms):
    reference = read_reference(load_scene("smoke", (8, 6)).scene, Model(**terms))
    image = quadrature_image(reference, checks=0)
    batches = [single_scatter_batch(reference, seed, 128) for seed in range(16)]
    means = np.array([batch.mean[0].mean() for batch in batches])
    error = means.std(ddof=1) / np.sqrt(len(means))
    assert abs(image.airlight.mean() - means.mean()) < 4 * error
    assert error < 0.01 * means.mean()  # half a fraction of a path would be 10 %


@pytest.mark.parametrize("terms", [{"lamps": "0"}, {"source": "constant:1,2,3"}])
def test_a_lamp_on_the_ray_that_the_equation_leaves_out_is_no_matter(variant, lamp_ahead, terms):
    """0 times an infinite airlight is no number."""
    image = reference_image(lamp_ahead, model=Model(**terms))
    assert np.isfinite(image.airlight).all()
    assert np.isfinite(image.airlight_error).all()


def layers_of(estimator, scene, **terms):
    """Return airlight and surface of a scene by an estimator, (pixels, 3) each."""
    reference = read_reference(scene, Model(**terms))
    if estimator == "single-scatter":
        return single_scatter_batch(reference, 1, 16).mean
    image = quadrature_image(reference, checks=0)
    return np.stack([image.airlight, image.surface]).reshape(2, -1, 3)


@pytest.mark.parametrize("estimator", ["quadrature", "single-scatter"])
@pytest.mark.claim("models", tolerance="1e-6: float32 of surfaces")
def test_a_source_covers_no_more_of_a_surface_than_its_cap(variant, estimator):
    """As Filament and O3DE blend: opacity times the colour over 1 - opacity of what is behind."""
    scene, source = mi.load_dict(tiny_scene(size=(8, 6))), {"source": "constant:1,2,3"}
    bare = layers_of(estimator, scene, **source, surface_camera_path="off")[1]
    seen = layers_of(estimator, scene, **source)[1]
    covered = layers_of(estimator, scene, **source, cap="0.2")
    lit = bare > 0
    left = np.maximum(seen[lit] / bare[lit], 0.8)
    assert left.max() > 0.81 or (left == 0.8).all()
    assert (left == 0.8).any()
    np.testing.assert_allclose(covered[1][lit] / bare[lit], left, rtol=1e-6)
    np.testing.assert_allclose(covered[0].max(axis=0), 0.2 * np.array([1, 2, 3]), rtol=1e-6)


@pytest.mark.parametrize("estimator", ["quadrature", "single-scatter"])
@pytest.mark.parametrize(("near", "length"), [(3, 4), (0.5, 4), (6, 0)])
@pytest.mark.claim("models", tolerance="1e-5: float32 of a distance in a sphere")
def test_a_lobe_begins_at_its_own_start(variant, estimator, near, length):
    """From 1 m to a wall 5 m away, whether the fog begins before or behind that; on no ray that
    does not reach the fog.
    """
    sun = {
        "type": "directional",
        "direction": [0.3, -0.9, -0.3],
        "irradiance": {"type": "rgb", "value": [3.0, 2.0, 1.0]},
    }
    wall = {"type": "sphere", "center": [0.2, -4.1, 1.3], "radius": 5.0, "flip_normals": True}
    scene = mi.load_dict(tiny_scene(size=(8, 6), ball=wall, floor=None, lamp=sun))
    terms = {"source": "constant:0,0,0", "lobe": "2:1", "ends": f"spheres:{near}:inf"}
    reference = read_reference(scene, Model(**terms, light_path="off"))
    (light,) = reference.directional
    cosine = -reference.direction @ light.direction
    opacity = 1 - np.exp(-reference.medium.sigma_t * length)
    expected = (np.maximum(cosine, 0) ** 2)[:, None] * light.irradiance * opacity
    found = layers_of(estimator, scene, **terms, light_path="off")[0]
    assert cosine.max() > 0.5
    np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-9)


@pytest.mark.parametrize("other", [1e-3, 1e-8])
def test_channels_of_very_different_extinction_each_have_their_light_of_a_sun(variant, other):
    """Without the light's path int sigma_t exp(-sigma_t x) dx = 1 in every channel: dense fog is
    not missed by panels that thin fog makes long.
    """
    fog = tiny_scene()["fog"] | {
        "sigma_t": {"type": "rgb", "value": [1.0, other, other]},
        "has_spectral_extinction": True,
    }
    sun = {"type": "directional", "direction": [-0.3, 0.5, -0.7], "irradiance": 4.0}
    scene = tiny_scene(size=(3, 2), fog=fog, lamp=sun, ball=None, floor=None)
    image = quadrature_image(read_reference(mi.load_dict(scene), Model(light_path="off")))
    expected = np.array([0.9, 0.8, 0.7]) * 4.0 / (4 * np.pi)
    assert image.airlight == pytest.approx(np.broadcast_to(expected, (2, 3, 3)), rel=1e-6)


def test_a_fade_that_begins_above_1_makes_doubt_worth_more(variant):
    """A fade from 9 m to 10 m is 10 at the camera: so is the most that a part in doubt can send."""
    reference = read_reference(mi.load_dict(tiny_scene()), Model(fade="9:10"))
    light = reference.lights[0]
    rays = rays_at(reference.origin, reference.direction, light.position)
    lit = LitIntervals(
        np.array([5]), np.zeros(1), np.ones(1), doubt=(np.array([5]), np.array([1e-3]))
    )
    physical = worth_of_doubt(read_reference(mi.load_dict(tiny_scene())), rays, lit)
    assert worth_of_doubt(reference, rays, lit) == pytest.approx(10 * physical)


def test_numbers_without_a_meaning_are_read_as_what_they_are():
    assert Model(range="cut:inf").is_physical
    assert Model(lamps="-0", ambient="-0").terms == "lamps=0"
    assert Model(lamps="1e300", suns="1.0").factors == (1e300, 1.0, 1.0)
    # Without a range light that falls as 1/r adds up without end.
    with pytest.raises(InputError, match="it has no sum"):
        Model(law="power:1", light_path="off", camera_path="off", range="cut:inf")
