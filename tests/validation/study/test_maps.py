# SPDX-License-Identifier: BSD-3-Clause
import math

import mitsuba as mi
import pytest

from analytic.errors import InputError
from realtime.frame.renderer import render_frame
from realtime.scene.read_scene import read_scene
from tests.helpers.scenes import spot, tiny_scene
from validation.estimates.quadrature import truth_image
from validation.metrics.errors import error_metrics
from validation.study.configuration import configuration, prepared
from validation.study.maps import fitted_slope, map_flicker

# Steps enough that halving them changes no error below by more than 2 %.
MARCH = {"steps": 1000, "shadow": "map"}


def small_scene(**changes):
    return mi.load_dict(tiny_scene(size=(32, 24), **changes))


def marches(*sizes):
    return [configuration("ray-march", parameters=MARCH | {"map": size}) for size in sizes]


def test_what_has_no_logarithm_is_left_out():
    assert fitted_slope([8, 16, 32, 64, 128], [0.5, 0.25, 0.0, math.nan, math.inf])[0] == pytest.approx(1)
    assert math.isnan(fitted_slope([8, 16], [0.0, 0.1])[0])


@pytest.mark.slow
@pytest.mark.claim("error-by-size-of-the-map", tolerance="order 1 within 0.2")
@pytest.mark.parametrize("lamp", ["point", "spot"])
def test_errors_of_a_map_are_of_first_order(variant, lamp):
    """The scatter of an order fitted to these 768 pixels is 0.04; grazing rays take up to 0.1 from 1."""
    scene = small_scene(**({"lamp": spot()} if lamp == "spot" else {}))
    sizes = (16, 32, 64, 128, 256)
    read, truth = read_scene(scene), truth_image(scene).airlight
    metrics = [error_metrics(truth, render_frame(prepared(read, chosen)).airlight) for chosen in marches(*sizes)]
    order, standard_error = fitted_slope(sizes, [each.relative_rmse for each in metrics])
    assert order == pytest.approx(1, abs=0.2)
    assert 0 < standard_error < 0.1
    assert metrics[0].relative_rmse < 0.04
    assert all(each.nonfinite == 0 for each in metrics)


@pytest.mark.slow
@pytest.mark.claim("flicker", tolerance="order 1/2 within 0.2")
@pytest.mark.parametrize("lamp", ["point", "spot"])
def test_flicker_of_fractions_of_a_texel_is_of_order_one_half(variant, lamp):
    """A share of the edges jumps a frame: the fits of three steps and two lights scatter by 0.06 about 0.5."""
    scene = small_scene(**({"lamp": spot()} if lamp == "spot" else {}))
    sizes = (32, 64, 128, 256)
    found = map_flicker(scene, marches(*sizes), frames=17, step=2e-3)
    assert found["texels"] == pytest.approx([2e-3 * size / 2 for size in sizes], rel=1e-3)
    assert max(found["texels"]) < 0.3
    assert fitted_slope(sizes, found["flicker"])[0] == pytest.approx(0.5, abs=0.2)
    assert found["nonfinite"] == 0


def test_what_cannot_be_studied_is_refused(variant):
    scene = small_scene()
    with pytest.raises(InputError, match="frames: got 1, wanted at least 2"):
        map_flicker(scene, marches(32), frames=1)
    with pytest.raises(InputError, match="step: got 0, wanted an angle above 0"):
        map_flicker(scene, marches(32), step=0.0)
