# SPDX-License-Identifier: BSD-3-Clause
"""The images in a page: what is decoded is what the files hold, to the bound of the
code, whatever the limit.
"""

import zlib
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from airlight.errors import InputError
from airlight.reference.storage.exr import Image, write_exr
from airlight.reports.page.images import (
    DIFFERENCE_BITS,
    INFINITE,
    NAN,
    REFERENCE_BITS,
    Array,
    Codes,
    K,
    S,
    difference_codes,
    pack_planes,
    page_images,
    reference_codes,
    reference_values,
)
from tests.helpers.page import small_report, write_files


def difference_values(codes: Codes) -> Array:
    """Return the relative differences that the codes of `difference_codes`
    stand for, in the same shape.
    """
    values = S * np.sinh(codes / K)
    values = np.where(codes == INFINITE, np.inf, np.where(codes == -INFINITE, -np.inf, values))
    return np.where(codes == NAN, np.nan, values)


def decode_planes(packed: bytes, size: tuple[int, int], bits: int) -> Codes:
    """Return the codes, (height, width, planes); those of 16 bits with their sign."""
    raw = np.frombuffer(zlib.decompress(packed), np.uint8).astype(np.int64)
    raw = raw.reshape(-1, bits // 8, size[1], size[0])
    zigzag = sum(raw[:, place] << 8 * place for place in range(bits // 8))
    planes = np.cumsum(np.where(zigzag & 1, -(zigzag + 1) // 2, zigzag // 2), axis=2)
    planes[1:] += planes[0]
    planes = np.moveaxis(planes % (1 << bits), 0, -1)
    if bits == DIFFERENCE_BITS:
        planes = np.where(planes >> (bits - 1), planes - (1 << bits), planes)
    return planes.astype(np.int32)


@given(st.lists(st.floats(width=32), min_size=1, max_size=12))
@settings(max_examples=150, deadline=None)
def test_any_float_survives_as_a_difference(values):
    """Nothing is clamped: the codes reach beyond float32, infinities and NaN stay."""
    difference = np.array(values, dtype=np.float64)[None, :, None]
    packed = pack_planes(difference_codes(difference), DIFFERENCE_BITS)
    decoded = decode_planes(packed, (len(values), 1), DIFFERENCE_BITS)
    back = difference_values(decoded)
    np.testing.assert_array_equal(np.isnan(back), np.isnan(difference))
    np.testing.assert_array_equal(np.isinf(back), np.isinf(difference))
    finite = np.isfinite(difference)
    # The bound of the module: half a step is 2e-3, its square the next term.
    bound = np.sqrt(S**2 + difference[finite] ** 2) / (2 * K)
    assert np.all(np.abs(back[finite] - difference[finite]) <= 1.01 * bound)


def test_a_reference_keeps_sixteen_binary_digits_and_what_is_not_finite():
    rng = np.random.default_rng(7)
    values = np.concatenate(
        [rng.lognormal(sigma=12, size=5000), -rng.lognormal(size=100), [0.0, 1.0, 2.0**-126]]
    )
    single = values.astype(np.float32)
    back = reference_values(reference_codes(single))
    assert np.all(np.abs(back - single) <= 2.0**-16 * np.abs(single.astype(np.float64)))
    odd = reference_values(reference_codes(np.array([np.nan, np.inf, -np.inf, 0.0])))
    np.testing.assert_array_equal(odd, [np.nan, np.inf, -np.inf, 0.0])


def test_planes_come_back_as_they_went():
    rng = np.random.default_rng(3)
    for bits, low, high in (
        (DIFFERENCE_BITS, -(1 << 15), 1 << 15),
        (REFERENCE_BITS, 0, 1 << REFERENCE_BITS),
    ):
        for size in ((1, 9), (37, 64)):
            codes = rng.integers(low, high, (*size, 3)).astype(np.int32)
            np.testing.assert_array_equal(
                decode_planes(pack_planes(codes, bits), size[::-1], bits), codes
            )


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return write_files(tmp_path_factory.mktemp("images"))


@pytest.fixture
def scene():
    return small_report().scenes[0]


def scene_images(scene, folder, limit):
    return page_images([scene], folder, limit)[0]


def test_limits_are_kept_by_fewer_pixels(scene, folder):
    whole = scene_images(scene, folder, 10**8)
    seen, limit = [], len(whole.data)
    while True:
        try:
            stored = scene_images(scene, folder, limit)
        except InputError as error:
            assert "one pixel in 16" in str(error)  # noqa: PT017 - the loop goes on until one limit is refused
            break
        assert len(stored.data) <= limit
        seen.append(stored.index["stride"])
        limit = int(0.9 * len(stored.data))
    assert seen[0] == 1
    assert seen[-1] > 1
    assert seen == sorted(seen)
    small = replace(scene, methods=scene.methods[:1])
    both = page_images([small, scene], folder, 10**8)
    fitted = page_images([small, scene], folder, sum(len(packed.data) for packed in both) - 1)
    assert fitted[0] == both[0]  # the largest scene gives way first
    assert fitted[1].index["stride"] > both[1].index["stride"]


def test_a_file_that_is_missing_or_of_another_size_is_refused(scene, tmp_path):
    with pytest.raises(InputError, match="cannot read"):
        scene_images(scene, tmp_path, 10**8)
    write_files(tmp_path)
    write_exr(tmp_path / "s" / "flat.exr", Image({"airlight": np.ones((4, 5, 3))}))
    with pytest.raises(InputError, match=r"flat.exr: got 5 x 4 pixels, expected the 32 x 24"):
        scene_images(scene, tmp_path, 10**8)
