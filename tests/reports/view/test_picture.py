# SPDX-License-Identifier: BSD-3-Clause
"""Pictures made on the device have the curve of the previews, within a level."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from reports.plotting.colour_maps import NOT_FINITE
from reports.plotting.pictures import tone_mapped
from reports.view.picture import LAYERS, Pictures

pytestmark = pytest.mark.usefixtures("variant")
SHAPE = (12, 16)


@pytest.fixture
def layers():
    random = np.random.default_rng(3)
    airlight, surface = (10 ** random.uniform(-5, 1, (*SHAPE, 3)) for _ in range(2))
    airlight[0, 0] = 0
    return {"airlight": airlight.astype(np.float32), "surface": surface.astype(np.float32)}


def drawn(layers, layer, factor, order):
    values = {name: mi.Color3f(image.reshape(-1, 3)[order].T) for name, image in layers.items()}
    dr.eval(values)
    picture = Pictures().of_frame(mi.UInt32(order), **values, layer=layer, factor=factor)
    return np.frombuffer(picture, np.uint8).reshape(*SHAPE, 4)


@pytest.mark.parametrize("layer", LAYERS)
def test_picture_of_a_frame_is_the_preview_within_a_level(layers, layer):
    order = np.random.default_rng(1).permutation(SHAPE[0] * SHAPE[1]).astype(np.uint32)
    picture = drawn(layers, layer, 1.7, order)
    radiance = sum(weight * layers[name] for weight, name in zip(LAYERS[layer], ("airlight", "surface"), strict=True))
    expected = tone_mapped(radiance.astype(np.float64), 1.7)
    assert np.abs(picture[..., :3].astype(int) - expected).max() <= 1
    assert (picture[..., 3] == 255).all()
    on_host = np.frombuffer(Pictures().of_image(radiance.astype(np.float64), 1.7), np.uint8).reshape(*SHAPE, 4)
    assert np.abs(on_host.astype(int) - picture).max() <= 1


def test_what_is_not_finite_is_magenta(layers):
    layers["surface"][3, 4, 1] = np.nan
    layers["airlight"][5, 6, 0] = np.inf
    order = np.arange(SHAPE[0] * SHAPE[1], dtype=np.uint32)
    picture = drawn(layers, "total", 1.0, order)
    assert picture[3, 4, :3].tolist() == picture[5, 6, :3].tolist() == list(NOT_FINITE)
