# SPDX-License-Identifier: BSD-3-Clause
import math

import mitsuba as mi
import pytest

from analytic.errors import InputError
from tests.helpers.scenes import spot, tiny_scene
from validation.study.maps import fitted_slope, map_errors, map_flicker

# Steps enough that halving them changes no error below by more than 2 %.
MARCH = {"steps": 1000, "shadow": "map"}


def small_scene(**changes):
    return mi.load_dict(tiny_scene(size=(32, 24), **changes))


def test_what_has_no_logarithm_is_left_out():
    assert fitted_slope([8, 16, 32, 64, 128], [0.5, 0.25, 0.0, math.nan, math.inf]).order == pytest.approx(1)
    assert math.isnan(fitted_slope([8, 16], [0.0, 0.1]).order)


@pytest.mark.slow
@pytest.mark.claim("error-by-size-of-the-map", tolerance="order 1 within 0.2")
@pytest.mark.parametrize("lamp", ["point", "spot"])
def test_errors_of_a_map_are_of_first_order(variant, lamp):
    """The scatter of an order fitted to these 768 pixels is 0.04; grazing rays take up to 0.1 from 1."""
    scene = small_scene(**({"lamp": spot()} if lamp == "spot" else {}))
    study = map_errors(scene, "ray-march", parameters=MARCH, sizes=(16, 32, 64, 128, 256))
    assert study.sizes == (16, 32, 64, 128, 256)
    assert study.slope.order == pytest.approx(1, abs=0.2)
    assert 0 < study.slope.standard_error < 0.1
    assert study.errors[0] < 0.04
    assert all(metrics.nonfinite == 0 for metrics in study.metrics)


@pytest.mark.slow
@pytest.mark.claim("flicker", tolerance="order 1/2 within 0.2")
@pytest.mark.parametrize("lamp", ["point", "spot"])
def test_flicker_of_fractions_of_a_texel_is_of_order_one_half(variant, lamp):
    """A share of the edges jumps a frame: the fits of three steps and two lights scatter by 0.06 about 0.5."""
    scene = small_scene(**({"lamp": spot()} if lamp == "spot" else {}))
    study = map_flicker(scene, "ray-march", parameters=MARCH, sizes=(32, 64, 128, 256), frames=17, step=2e-3)
    assert study.texels == pytest.approx([2e-3 * size / 2 for size in study.sizes], rel=1e-3)
    assert max(study.texels) < 0.3
    assert study.slope.order == pytest.approx(0.5, abs=0.2)
    assert study.nonfinite == 0


def test_what_cannot_be_studied_is_refused(variant):
    scene = small_scene()
    with pytest.raises(InputError, match="method unshadowed: got a parameter 'map'"):
        map_errors(scene, "unshadowed", sizes=(64,))
    with pytest.raises(InputError, match="sizes: got none"):
        map_errors(scene, "ray-march", sizes=())
    with pytest.raises(InputError, match="got map=512, wanted it in `sizes`"):
        map_errors(scene, "ray-march", parameters={"map": 512})
    with pytest.raises(InputError, match="map: got 48, wanted a power of two"):
        map_errors(scene, "ray-march", parameters=MARCH, sizes=(48,))
    with pytest.raises(InputError, match="frames: got 1, wanted at least 2"):
        map_flicker(scene, "ray-march", parameters=MARCH, frames=1)
    with pytest.raises(InputError, match="step: got 0, wanted an angle above 0"):
        map_flicker(scene, "ray-march", parameters=MARCH, step=0.0)
