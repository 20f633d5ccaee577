# SPDX-License-Identifier: BSD-3-Clause
import base64

import numpy as np
import pytest

from analytic.errors import InputError
from reference.storage.exr import Image, read_exr, write_exr
from reports.page.image_cache import page_images
from reports.page.image_codec import DIFFERENCE_BITS, REFERENCE_BITS, Packed
from reports.page.image_codec import reference_values as values_of
from reports.page.image_index import DARK, LADDER, relative_difference
from tests.helpers.decoding import decode_planes, difference_values
from tests.helpers.page import HEIGHT, WIDTH, engine_image, images, report_data, write_files


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return write_files(tmp_path_factory.mktemp("images"))


@pytest.fixture
def scene():
    return report_data()["scenes"][0]


def scene_images(scene, folder, limit):
    return page_images([scene], folder, limit)[0]


def planes(stored, entry, bits):
    raw = base64.b64decode(stored.data)[entry["at"] : entry["at"] + entry["bytes"]]
    size = tuple(stored.index["size"])
    return decode_planes(Packed(raw, tuple(map(tuple, entry["planes"]))), size, bits)


def difference(stored, number, layer):
    entry = stored.index["methods"][number]["layers"][layer]
    return difference_values(planes(stored, entry, DIFFERENCE_BITS), entry["k"], stored.index["s"])


def test_page_has_the_reference_and_each_difference_from_it(scene, folder):
    stored = scene_images(scene, folder, 10**8)
    exact = read_exr(folder / "s" / "reference.exr").layers["airlight"].astype(np.float64)
    back = values_of(planes(stored, stored.index["reference"]["airlight"], REFERENCE_BITS))
    np.testing.assert_allclose(back, exact, rtol=2.0**-16)
    floor = DARK * exact.mean()
    assert stored.index["floors"]["airlight"] == pytest.approx(floor, rel=1e-12)
    for number, name in enumerate(("good", "flat")):
        test = read_exr(folder / "s" / f"{name}.exr").layers["airlight"].astype(np.float64)
        wanted = (test - exact) / np.maximum(back, floor)
        got = difference(stored, number, "airlight")
        # Of a large difference 1 / 2000, of a small one 2.5e-8.
        np.testing.assert_allclose(got, wanted, rtol=6e-4, atol=3e-8, equal_nan=True)
    assert np.isnan(difference(stored, 1, "airlight")[5, 7, 1])


def test_error_of_a_good_method_is_its_own(scene, folder):
    """The reference is rounded to 1.5e-5, the method is wrong by 3e-6: the one must not show in the other."""
    stored = scene_images(scene, folder, 10**8)
    lit = slice(2, None)
    assert np.std(difference(stored, 0, "airlight")[lit]) == pytest.approx(3e-6, rel=0.05)


def test_equal_images_are_stored_once(scene, folder):
    stored = scene_images(scene, folder, 10**8)
    twice = scene | {"methods": [*scene["methods"], *scene["methods"]]}
    assert len(scene_images(twice, folder, 10**8).data) == len(stored.data)


def test_image_with_its_total_alone_is_compared_with_the_total(scene, folder):
    stored = scene_images(scene | {"methods": [engine_image()]}, folder, 10**8)
    got = difference(stored, 0, "total")
    lit = np.s_[2:, :]
    np.testing.assert_allclose(got[lit], -0.1, rtol=6e-4)


def test_flip_map_is_kept_to_a_two_hundred_fifty_fifth(scene, folder):
    stored = scene_images(scene, folder, 10**8)
    entry = stored.index["methods"][1]["layers"]["flip"]
    wanted = images()["flat"]["flip"][..., :1]
    np.testing.assert_allclose(planes(stored, entry, 8) / entry["k"], wanted, atol=0.5 / 255 + 1e-7)
    assert "flip" not in stored.index["methods"][0]["layers"]


def test_limit_is_kept_by_coarser_differences_then_fewer_pixels(scene, folder):
    whole = scene_images(scene, folder, 10**8)
    seen = []
    limit = len(whole.data)
    while True:
        try:
            stored = scene_images(scene, folder, limit)
        except InputError as error:
            assert "one pixel in 16" in str(error)  # noqa: PT017 - the loop goes on until one limit is refused
            break
        assert len(stored.data) <= limit
        seen.append((stored.index["stride"], stored.index["of_difference"]))
        limit = len(stored.data) - 1
    strides = [stride for stride, _ in seen]
    assert strides == sorted(strides)
    whole_pixels = [rounding for stride, rounding in seen if stride == 1]
    assert whole_pixels == sorted(whole_pixels)
    assert len(whole_pixels) > 1
    assert seen[-1][0] > 1
    assert LADDER[0][1] == 1


def test_kept_pixels_are_those_of_the_file_and_the_floor_is_that_of_the_whole(scene, folder):
    whole = scene_images(scene, folder, 10**8)
    for limit in range(len(whole.data), 0, -200):
        thin = scene_images(scene, folder, limit)
        if thin.index["stride"] == 2:
            break
    assert thin.index["size"] == [WIDTH // 2, HEIGHT // 2]
    assert thin.index["full"] == [WIDTH, HEIGHT]
    assert thin.index["floors"] == whole.index["floors"]
    names = "reference", "airlight"
    few, all_of_them = (
        values_of(planes(stored, stored.index[names[0]][names[1]], REFERENCE_BITS)) for stored in (thin, whole)
    )
    np.testing.assert_array_equal(few, all_of_them[::2, ::2])


def test_file_that_is_missing_or_of_another_size_is_refused(scene, folder, tmp_path):
    with pytest.raises(InputError, match="cannot read"):
        scene_images(scene, tmp_path, 10**8)
    write_files(tmp_path)
    write_exr(tmp_path / "s" / "flat.exr", Image({"airlight": np.ones((4, 5, 3))}))
    with pytest.raises(InputError, match=r"flat.exr: got 5 x 4 pixels, wanted the 32 x 24"):
        scene_images(scene, tmp_path, 10**8)


def test_black_reference_has_a_floor_of_one():
    zero = np.zeros((2, 2, 3))
    np.testing.assert_array_equal(relative_difference(zero, zero, zero + 0.25, 1.0), zero + 0.25)


def test_reference_that_is_not_finite_leaves_the_value_of_the_method():
    exact = np.array([[[np.nan, np.inf, 1.0]]])
    got = relative_difference(exact, exact, np.full((1, 1, 3), 2.0), 0.5)
    np.testing.assert_array_equal(got, [[[4.0, 4.0, 1.0]]])


def test_packed_images_are_kept_until_a_file_changes(scene, own_cache, tmp_path):
    write_files(tmp_path)
    first = scene_images(scene, tmp_path, 10**8)
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("reports.page.image_cache.packed_scene", None)
        assert scene_images(scene, tmp_path, 10**8) == first  # not packed again
    changed = images()["flat"]
    brighter = Image(changed | {"airlight": 1.01 * changed["airlight"]})
    write_exr(tmp_path / "s" / "flat.exr", brighter, finite=False)  # the fake report has a pixel of NaN
    assert scene_images(scene, tmp_path, 10**8).data != first.data


def test_damaged_entry_is_made_again(scene, tmp_path, own_cache):
    write_files(tmp_path)
    first = scene_images(scene, tmp_path, 10**8)
    (kept,) = own_cache.glob("page-*.npz")
    kept.write_bytes(kept.read_bytes()[:-9])
    assert scene_images(scene, tmp_path, 10**8) == first


def test_largest_scene_gives_way_first(scene, folder):
    small = scene | {"methods": scene["methods"][:1]}
    both = page_images([small, scene], folder, 10**8)
    fitted = page_images([small, scene], folder, sum(len(packed.data) for packed in both) - 1)
    assert fitted[0] == both[0]
    assert fitted[1].index["of_difference"] > both[1].index["of_difference"]
