# SPDX-License-Identifier: BSD-3-Clause
from dataclasses import fields

import numpy as np
import pytest

from reference.storage.cache import cache_folder
from tests.helpers.scenes import tiny_scene
from validation.estimates.monte_carlo import monte_carlo_batches
from validation.estimates.quadrature import truth_image, truth_of_pixels


@pytest.fixture
def scene(variant):
    import mitsuba as mi

    return mi.load_dict(tiny_scene(size=(8, 6)))


@pytest.fixture
def computed(monkeypatch):
    """Count how often a truth image is computed."""
    import validation.estimates.quadrature

    calls = []
    compute = validation.estimates.quadrature.quadrature_image

    def counted(*args, **kwargs):
        calls.append(kwargs)
        return compute(*args, **kwargs)

    monkeypatch.setattr(validation.estimates.quadrature, "quadrature_image", counted)
    return calls


def assert_same(actual, expected):
    for field in fields(actual):
        np.testing.assert_array_equal(getattr(actual, field.name), getattr(expected, field.name), err_msg=field.name)
        assert type(getattr(actual, field.name)) is type(getattr(expected, field.name))


def test_second_call_reads_the_same_numbers(scene, own_cache, computed):
    first, second = truth_image(scene, samples=32), truth_image(scene, samples=32)
    assert len(computed) == 1
    assert_same(first, second)
    assert first.airlight.shape == (6, 8, 3)
    assert np.isfinite(first.airlight).all()


def test_same_scene_loaded_again_is_found(scene, own_cache, computed):
    import mitsuba as mi

    truth_image(scene, samples=32)
    truth_image(mi.load_dict(tiny_scene(size=(8, 6))), samples=32)
    assert len(computed) == 1


@pytest.mark.parametrize(
    "changes",
    [{"samples": 33}, {"samples": 32, "shadow_scale": 0.99}],
)
def test_other_settings_are_computed(scene, own_cache, computed, changes):
    truth_image(scene, samples=32)
    truth_image(scene, **changes)
    assert len(computed) == 2


def test_other_phase_function_has_another_truth(scene, own_cache, computed):
    """The phase function has no parameters that a key could see; an isotropic truth would pass for it."""
    import mitsuba as mi

    fog = tiny_scene()["fog"] | {"phase": {"type": "rayleigh"}}
    plain = truth_image(scene, samples=32)
    rayleigh = truth_image(mi.load_dict(tiny_scene(size=(8, 6), fog=fog)), samples=32)
    assert len(computed) == 2
    assert np.abs(rayleigh.airlight / plain.airlight - 1).max() > 0.05


@pytest.mark.parametrize("damage", ["truncated", "bit flipped", "other arrays"])
def test_damaged_file_is_recomputed(scene, own_cache, computed, damage):
    from reference.storage.cache import store_arrays

    first = truth_image(scene, samples=32)
    (path,) = cache_folder().glob("quadrature-*.npz")
    content = bytearray(path.read_bytes())
    if damage == "truncated":
        path.write_bytes(content[: len(content) // 2])
    elif damage == "bit flipped":
        content[len(content) // 2] ^= 4
        path.write_bytes(content)
    else:
        store_arrays(path.stem, {"airlight": first.airlight})
    assert_same(truth_image(scene, samples=32), first)
    assert len(computed) == 2
    truth_image(scene, samples=32)
    assert len(computed) == 2  # and what was damaged has been replaced


def test_the_truth_of_some_pixels_is_that_of_the_image(scene, own_cache):
    pixels = np.array([3, 4, 40, 7])
    some, whole = truth_of_pixels(scene, pixels), truth_image(scene)
    for layer in ("airlight", "surface", "distance", "light_angle"):
        values = getattr(whole, layer)
        np.testing.assert_array_equal(getattr(some, layer)[0], values.reshape(-1, *values.shape[2:])[pixels])


def test_progress_is_told(scene, own_cache):
    told = []
    truth_image(scene, samples=16, progress=lambda *args: told.append(args))
    assert told == [(1, 1, "quadrature")]


@pytest.fixture
def loaded(scene):
    from validation.scenes.loading import LoadedScene

    return LoadedScene("tiny", scene, "A tiny scene.", "")


@pytest.mark.claim("area-light-goes-on")
def test_truth_of_an_area_light_goes_on_where_it_was_interrupted(own_cache, monkeypatch):
    from reference.quadrature import area_airlight
    from tests.helpers.area_lights import lamp, lit_scene
    from validation.estimates.images import layered_truth

    scene = lit_scene(size=(2, 2), lamp=lamp("sphere", center=[0.3, 0.2, 3.0], radius=0.4))
    done, compute = [], area_airlight._sums_over

    def some(*arguments):
        if len(done) == 5:
            raise KeyboardInterrupt
        done.append(arguments)
        return compute(*arguments)

    monkeypatch.setattr(area_airlight, "_sums_over", some)
    with pytest.raises(KeyboardInterrupt):
        truth_image(scene)
    counted = []
    monkeypatch.setattr(area_airlight, "_sums_over", lambda *arguments: (counted.append(1), compute(*arguments))[1])
    again = truth_image(scene)
    went_on = len(counted)
    assert not list(own_cache.glob("**/airlight-*"))
    assert_same(truth_image(scene), again)
    for path in own_cache.glob("**/quadrature-*.npz"):
        path.unlink()
    counted.clear()
    assert_same(truth_image(scene), again)
    assert len(counted) == went_on + 5
    image = layered_truth("lamp", again)
    assert {"emitted", "airlight_se", "surface_se", "airlight_bound"} <= set(image.layers)
    assert image.attributes["airlight:batches"] == 8


def test_quadrature_reference_is_the_truth_in_layers(loaded, own_cache):
    from validation.estimates.images import quadrature_reference

    told = []
    image = quadrature_reference(loaded, progress=lambda *args: told.append(args))
    truth = truth_image(loaded.scene)
    assert set(image.layers) == {"airlight", "airlight_bound", "surface"}
    for name, layer in image.layers.items():
        np.testing.assert_array_equal(layer, getattr(truth, name))
    np.testing.assert_array_equal(image.depth, truth.distance)
    assert image.attributes["airlight:estimator"] == "quadrature"
    assert told[-1] == (1.0, "quadrature")


def test_volpath_reference_has_layers_with_standard_errors(loaded, own_cache):
    from validation.estimates.images import volpath_reference

    image = volpath_reference(loaded, samples=3, seed=5)
    batches = monte_carlo_batches(loaded.scene, "volpath", batches=3, samples=1, first_seed=5).batches
    assert set(image.layers) == {"airlight", "airlight_se", "surface", "surface_se"}
    np.testing.assert_array_equal(image.layers["surface"].reshape(-1, 3), batches.mean[1])
    np.testing.assert_array_equal(image.layers["airlight_se"].reshape(-1, 3), batches.standard_error[0])
    attributes = image.attributes
    assert [attributes[f"airlight:{name}"] for name in ("estimator", "spp", "batches", "seed")] == ["volpath", 3, 3, 5]
    np.testing.assert_array_equal(image.depth, truth_image(loaded.scene, samples=16).distance)


@pytest.mark.parametrize("samples", [1, 2, 31, 64, 100, 8192, 8193, 100_000])
def test_samples_are_split_into_batches_that_have_at_least_as_many(loaded, monkeypatch, samples):
    import validation.estimates.images

    asked = {}

    def split(scene, estimator, **kwargs):
        asked.update(kwargs)
        raise KeyboardInterrupt  # the split is all that this test wants

    monkeypatch.setattr(validation.estimates.images, "monte_carlo_batches", split)
    with pytest.raises(KeyboardInterrupt):
        validation.estimates.images.volpath_reference(loaded, samples=samples)
    batches, each = asked["batches"], asked["samples"]
    assert batches >= min(32, max(2, samples))  # 32 give a standard error that is known to 13 %
    assert 1 <= each <= 256
    # Never less than asked for, and not a whole batch more, but for the two that a standard error needs.
    assert samples <= batches * each < samples + max(each, 2)


@pytest.mark.statistical
def test_volpath_reference_compares_with_the_quadrature_by_its_standard_errors(loaded, own_cache):
    """The two references go through the comparison of image files as a user's would."""
    from validation.comparison.images import compare_images
    from validation.estimates.images import quadrature_reference, volpath_reference

    comparison = compare_images(quadrature_reference(loaded), volpath_reference(loaded, samples=512), layer="surface")
    assert comparison.statistics is not None
    # 32 batches: the standard deviation of z is sqrt(31/29) = 1.03; some 60 values, so +-0.1.
    assert comparison.statistics.z_std == pytest.approx(1.03, abs=0.35)
    assert comparison.statistics.rejected == 0
