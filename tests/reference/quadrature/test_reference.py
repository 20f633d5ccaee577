# SPDX-License-Identifier: BSD-3-Clause
"""References of scenes: from the cache, refused where they are infinite."""

from dataclasses import fields, replace

import mitsuba as mi
import numpy as np
import pytest

from airlight.errors import InputError
from airlight.reference.quadrature import area_lights, image
from airlight.reference.quadrature import reference as module
from airlight.reference.quadrature.reference import reference_image, reference_of_pixels
from airlight.reference.quadrature.surface import surface_hits
from airlight.validation.estimates.monte_carlo import monte_carlo_batches
from airlight.validation.scenes.height_fog import register_height_fog
from tests.helpers.area_lights import lamp, lit_scene
from tests.helpers.scenes import spot, tiny_scene


@pytest.fixture
def scene(variant):
    return mi.load_dict(tiny_scene(size=(8, 6)))


@pytest.fixture
def computed(monkeypatch):
    """Count how often a reference image is computed."""
    calls, compute = [], module.quadrature_image

    def counted(*args, **kwargs):
        calls.append(kwargs)
        return compute(*args, **kwargs)

    monkeypatch.setattr(module, "quadrature_image", counted)
    return calls


def assert_same(actual, expected):
    for field in fields(actual):
        np.testing.assert_array_equal(
            getattr(actual, field.name), getattr(expected, field.name), err_msg=field.name
        )
        assert type(getattr(actual, field.name)) is type(getattr(expected, field.name))


def test_second_call_reads_the_same_numbers(scene, own_cache, computed):
    first, second = reference_image(scene, checks=4), reference_image(scene, checks=4)
    assert len(computed) == 1
    assert_same(first, second)
    assert first.airlight.shape == (6, 8, 3)
    assert np.isfinite(first.airlight).all()


def test_camera_rays_are_cast_once(scene, monkeypatch):
    rays = []

    def counted(reference):
        rays.append(len(reference.direction))
        return surface_hits(reference)

    for place in (module, image):
        monkeypatch.setattr(place, "surface_hits", counted)
    reference_of_pixels(scene, np.arange(5))
    assert rays == [5]


def test_the_reference_of_some_pixels_is_that_of_the_image(scene, own_cache):
    pixels = np.array([3, 4, 40, 7])
    some, whole = reference_of_pixels(scene, pixels), reference_image(scene)
    for layer in ("airlight", "surface", "distance", "light_angle"):
        values = getattr(whole, layer)
        np.testing.assert_array_equal(
            getattr(some, layer)[0], values.reshape(-1, *values.shape[2:])[pixels]
        )


@pytest.mark.claim("area-light-goes-on")
def test_reference_of_an_area_light_goes_on_where_it_was_interrupted(own_cache, monkeypatch):
    scene = lit_scene(size=(2, 2), lamp=lamp("sphere", center=[0.3, 0.2, 3.0], radius=0.4))
    done, compute = [], area_lights._scattered

    def some(*arguments):
        if len(done) == 1:
            raise KeyboardInterrupt
        done.append(arguments)
        return compute(*arguments)

    monkeypatch.setattr(area_lights, "_scattered", some)
    with pytest.raises(KeyboardInterrupt):
        reference_image(scene)
    counted = []
    monkeypatch.setattr(
        area_lights, "_scattered", lambda *arguments: (counted.append(1), compute(*arguments))[1]
    )
    again = reference_image(scene)
    went_on = len(counted)
    assert not list(own_cache.glob("**/airlight-*"))
    assert_same(reference_image(scene), again)
    for path in own_cache.glob("**/quadrature-*.npz"):
        path.unlink()
    counted.clear()
    assert_same(reference_image(scene), again)
    assert len(counted) == went_on + 1


def scene_with(position, *, size=(9, 9), **changes):
    """Return a scene whose camera looks along +y, its middle pixel along the axis."""
    scene = tiny_scene(size=size, floor=None, ball=None)
    scene["sensor"]["to_world"] = mi.ScalarTransform4f().look_at([0, -5, 1], [0, 0, 1], [0, 0, 1])
    if position is not None:
        scene["lamp"]["position"] = position
    return mi.load_dict(
        {name: part for name, part in (scene | changes).items() if part is not None}
    )


def references(scene):
    """Return what gives the reference by each estimator."""

    def sampled(estimator):
        return lambda: monte_carlo_batches(scene, estimator, batches=2, samples=1).batches.mean

    return [lambda: reference_image(scene).airlight, sampled("single-scatter"), sampled("volpath")]


@pytest.mark.claim("light-on-a-ray-refused")
@pytest.mark.parametrize("position", [[0.0, -5.0, 1.0], [0.0, 0.0, 1.0], [1e-8, 0.0, 1.0]])
def test_every_estimator_refuses_a_light_at_the_camera_or_on_a_ray(variant, position):
    for reference in references(scene_with(position)):
        with pytest.raises(
            InputError,
            match=r"light 1 at .* is [\d.e-]+ m from the (camera|ray .* column 4 of row 4)",
        ):
            reference()


def test_a_spot_on_a_ray_is_refused_where_the_ray_is_in_its_cone(variant):
    def lamp(target):
        place = mi.ScalarTransform4f().look_at([0, 0, 1], target, [0, 0, 1])
        return spot() | {"to_world": place}

    assert np.isfinite(reference_image(scene_with(None, lamp=lamp([9, 0, 1]))).airlight).all()
    for target in ([0, 9, 1], [0.5, -4, 1]):
        with pytest.raises(InputError, match="light 1"):
            reference_image(scene_with(None, lamp=lamp(target)))


def fog_before_a_lamp(kind):
    """Return fog that ends at y = -2 or in a voxel there; the camera is in it and looks out."""
    place = mi.ScalarTransform4f().translate([-9, -10, -9])
    if kind == "height fog":
        place = place.rotate([1, 0, 0], -90).scale([1, 1, 8])
        density = {"type": "heightfog", "sigma_0": 0.3, "to_world": place}
    else:
        # Voxels of 2 m along y; the grid ends at its box, or with empty voxels.
        values = np.full((2, 8 if kind == "empty voxels" else 4, 2, 1), 0.3, np.float32)
        values[:, 4:] = 0
        place = place.scale([18, 2 * values.shape[1], 18])
        density = {"type": "gridvolume", "grid": mi.VolumeGrid(values), "to_world": place}
    return {"type": "heterogeneous", "id": "fog", "albedo": 0.8, "sigma_t": density}


@pytest.mark.parametrize("kind", ["height fog", "box of a grid", "empty voxels"])
def test_a_light_behind_the_fog_may_lie_on_a_ray(variant, kind):
    """Nothing around it scatters: the airlight is that of a ray beside it."""
    register_height_fog()

    def middle(estimator, x, y):
        scene = scene_with([x, y, 1.0], size=(3, 3), fog=fog_before_a_lamp(kind))
        return references(scene)[estimator]().reshape(-1, 3, 3, 3)[0, 1, 1]

    on, beside = middle(0, 0.0, 0.0), middle(0, 1e-3, 0.0)
    assert on == pytest.approx(beside, rel=1e-5)
    assert on.min() > 0
    sampled = middle(1, 0.0, 0.0)  # by two samples
    assert sampled.min() > 0
    assert np.isfinite(sampled).all()
    with pytest.raises(InputError, match=r"light 1 at .* m from the ray"):
        middle(0, 0.0, -3.0)


def test_the_mean_over_pixels_is_finite_where_a_centre_meets_a_light(variant):
    means = reference_image(scene_with([0.0, 0.0, 1.0], size=(3, 3)), pixel="area").airlight
    assert np.isfinite(means).all()
    assert means[1, 1].min() > means[0, 0].max()
    with pytest.raises(InputError, match="m from the camera"):
        reference_image(scene_with([0.0, -5.0, 1.0], size=(3, 3)), pixel="area")


def test_a_reference_that_is_not_finite_is_refused_and_not_kept(variant, own_cache, monkeypatch):
    scene = scene_with([1.0, 0.0, 1.0], size=(4, 3))
    whole = module.quadrature_image

    def broken(*arguments, **named):
        image = whole(*arguments, **named)
        image.surface[1, 2] = np.nan
        return replace(image, surface=image.surface)

    monkeypatch.setattr(module, "quadrature_image", broken)
    for _ in range(2):
        with pytest.raises(
            InputError,
            match="1 of 12 pixels whose surface is not finite, first in column 2 of row 1",
        ):
            module.reference_image(scene)
