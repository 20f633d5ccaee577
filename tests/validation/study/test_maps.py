# SPDX-License-Identifier: BSD-3-Clause
r"""Errors fall with the size of maps as they say, their parts by causes add up, and
histories lag by their weight.

**Errors and maps.** With N texels on a side a shadow edge lies within a texel of its place in the
map, an angle of O(1/N) as seen from the light. A camera ray that crosses the edge enters or leaves
the light too early or too late by this angle over the sine of the angle between ray and edge, both
as seen from the light. The airlight of *every* ray that crosses a shadow edge is therefore wrong by
O(1/N), of either sign: the root of the mean square falls as 1/N, order
1. Whether edges are steps or ramps does not matter; smooth depths between edges are known to
   O(1/N^2) where the map is
interpolated, O(1/N) where it is not.

Rays that graze a shadow add to this. At a distance of delta from touching a smooth outline the part
of a ray that is hidden has a length of sqrt(delta), and misplacing the outline by epsilon changes
it by about epsilon / sqrt(delta). The mean square, the integral of epsilon^2 / delta from epsilon
on, is epsilon^2 log(1/epsilon): the root still falls with order 1, except for the root of a
logarithm, and over sizes of N the slope is 1 - 1 / (2 log N): 0.9 at 128. A straight edge that the
camera sees edge-on hides the rays within epsilon of it whole: there the order is 1/2. Occluders
that are thinner than a texel do not converge before the map resolves them.

**Upright walls.** Where rays have found the jumps on the edges of texels
(`realtime.methods.light_volumes.jump_search`) the edge of a shadow is known to epsilon = 1/64 of a
texel, or to O(1/N^2) where it is a smooth outline between two sides. The remaining error of order 1
has a constant that is smaller by as much. Corners of outlines lie within a texel, which has the
wrong shape there: a fraction of O(1/N) of the rays that cross the edge is wrong by O(1/N), a root
mean square of O(N^(-3/2)). The order therefore lies between 1 and 3/2; occluders that are thinner
than a texel and smooth ones that are met at a grazing angle reduce it as above.

**The order of the flicker.** An edge in the map stays where it is while the light moves by less
than a texel, and then jumps by one. Let the light move by m texels a frame, m = N step / 2 at a
step in radians. For m < 1 a fraction m of the edges jumps in a frame, by O(1/N) each: their root
mean square is sqrt(m) / N, and at a given step it falls as N^(-1/2). For m >= 1 the errors of
consecutive frames have nothing to do with each other: the flicker is sqrt(2) times the error of a
frame and falls as 1/N.
"""

import math
from dataclasses import replace

import mitsuba as mi
import numpy as np
import pytest

from airlight.errors import InputError
from airlight.realtime.frame.image import render_frame
from airlight.realtime.scene.read_scene import read_scene
from airlight.reference.quadrature.reference import reference_image
from airlight.validation.metrics.errors import error_metrics
from airlight.validation.scenes.loading import load_scene
from airlight.validation.scenes.registry import Animation
from airlight.validation.statistics.estimate import Answer
from airlight.validation.study import variation
from airlight.validation.study.causes import decompose
from airlight.validation.study.configuration import (
    Configuration,
    configuration,
    named_configurations,
    prepared,
)
from airlight.validation.study.growth import fitted_exponent
from airlight.validation.study.variation import light_references, method_motion
from tests.helpers.scenes import spot, tiny_scene

# Steps enough that halving them changes no error below by more than 2 %.
MARCH = {"steps": 1000, "shadow": "map"}


def small_scene(**changes):
    return mi.load_dict(tiny_scene(size=(32, 24), **changes))


def marches(*sizes):
    return [configuration("ray-march", parameters=MARCH | {"map": size}) for size in sizes]


def test_what_has_no_logarithm_is_left_out():
    assert fitted_exponent([8, 16, 32, 64, 128], [0.5, 0.25, 0.0, math.nan, math.inf])[
        0
    ] == pytest.approx(-1)
    assert math.isnan(fitted_exponent([8, 16], [0.0, 0.1])[0])


@pytest.mark.slow
@pytest.mark.claim("error-by-size-of-the-map", tolerance="order 1 within 0.2")
@pytest.mark.parametrize("lamp", ["point", "spot"])
def test_errors_of_a_map_are_of_first_order(variant, lamp):
    """The scatter of an order fitted to these 768 pixels is 0.04; grazing
    rays take up to 0.1 from 1.
    """
    scene = small_scene(**({"lamp": spot()} if lamp == "spot" else {}))
    sizes = (16, 32, 64, 128, 256)
    read, reference = read_scene(scene), reference_image(scene).airlight
    metrics = [
        error_metrics(reference, render_frame(prepared(read, chosen)).airlight)
        for chosen in marches(*sizes)
    ]
    exponent, standard_error = fitted_exponent(sizes, [each.relative_rmse for each in metrics])
    assert exponent == pytest.approx(-1, abs=0.2)
    assert 0 < standard_error < 0.1
    assert metrics[0].relative_rmse < 0.04
    assert all(each.nonfinite == 0 for each in metrics)


@pytest.mark.slow
@pytest.mark.claim("flicker", tolerance="order 1/2 within 0.2")
@pytest.mark.parametrize("lamp", ["point", "spot"])
def test_flicker_of_fractions_of_a_texel_is_of_order_one_half(variant, lamp):
    """A fraction of the edges jumps a frame: the fits of three steps and two lights
    scatter by 0.06 about 0.5.
    """
    scene = small_scene(**({"lamp": spot()} if lamp == "spot" else {}))
    sizes = (32, 64, 128, 256)
    turn = round(2 * np.pi / 2e-3)  # so that a shadow moves by 0.03 to 0.26 texels a frame
    found = method_motion(scene, Animation(), marches(*sizes), frames=17, turn=turn)
    assert fitted_exponent(sizes, [row.measures.flicker.value for row in found])[
        0
    ] == pytest.approx(-0.5, abs=0.2)
    assert all(row.measures.nonfinite == 0 for row in found)


def split(method, kernel=None, *, size=(24, 20), render=None, **parameters):
    cube = {
        "type": "cube",
        "to_world": mi.ScalarTransform4f().translate([0.1, 0.1, 0.7]).scale(0.3),
    }
    lamp = {
        "type": "point",
        "position": [0.3, 0.4, 3.1],
        "intensity": {"type": "rgb", "value": [5.0, 4.0, 3.0]},
    }
    scene = mi.load_dict(tiny_scene(size=size, ball=cube, lamp=lamp))
    read, reference = read_scene(scene), reference_image(scene).airlight
    render = render or (lambda chosen: render_frame(prepared(read, chosen)).airlight)
    return decompose(read, configuration(method, kernel, parameters), reference, render)


def causes(parts):
    return [(part.cause, part.without) for part in parts[1:]]


@pytest.mark.claim("error-by-cause", tolerance="1e-6 of the mean of the reference, pixel by pixel")
@pytest.mark.parametrize(
    ("method", "kernel", "parameters"),
    [
        ("ray-march", None, {"steps": 9, "shadow": "map", "map": 64}),
        *(
            pytest.param(*case, marks=pytest.mark.slow)
            for case in (
                ("unshadowed", "taylor", {}),
                ("shadow-planes-2006", "taylor", {"order": "none"}),
                ("light-volumes", None, {"map": 64}),
                ("min-max", None, {"map": 64}),
                ("froxel-fog", None, {"width": 8, "height": 6, "slices": 8, "map": 64}),
            )
        ),
    ],
)
def test_the_parts_add_up_to_the_whole(variant, method, kernel, parameters):
    whole, *parts = split(method, kernel, **parameters)
    mean = whole.image.mean() / whole.relative_bias  # of the reference
    np.testing.assert_allclose(
        np.sum([part.image for part in parts], axis=0), whole.image, atol=1e-6 * mean
    )
    assert sum(part.fraction for part in parts) == pytest.approx(1, abs=1e-9)
    assert whole.relative_rmse > 1e-4


def test_a_cause_that_is_gone_takes_its_part_along(variant):
    coarse = split("ray-march", steps=9, shadow="map", map=16)
    better = split("ray-march", steps=9)
    assert causes(coarse) == [("map", "shadow=ray"), ("steps", "reference")]
    assert causes(better) == [("steps", "reference")]
    np.testing.assert_array_equal(coarse[2].image, better[1].image)
    np.testing.assert_allclose(coarse[1].image, coarse[0].image - better[0].image, atol=1e-15)


def test_a_method_of_ones_own_is_rendered_by_its_caller(variant):
    asked = []

    def render(chosen):
        asked.append(chosen.method)
        return np.ones((20, 24, 3))

    whole = split("tests.helpers.veil:Veil", render=render)
    assert asked == ["tests.helpers.veil:Veil"]
    assert causes(whole) == [("rest", "reference")]


USUAL = named_configurations("motion")


@pytest.mark.claim("history-lag", tolerance="0.01 frames: float32 beside the light")
def test_a_history_lags_by_its_weight_and_planes_do_not(variant):
    loaded = load_scene("open-fog", (32, 24))
    before = np.array(loaded.scene.emitters()[0].world_transform().matrix)
    averaged = Configuration("unshadowed+history", "exact", (("alpha", 0.1),))
    rows = method_motion(loaded.scene, loaded.animation, [USUAL[0], averaged], frames=16, turn=240)
    planes, late = (row.measures for row in rows)
    assert planes.relative_rmse.value < 1e-5  # float32 beside the light
    assert abs(planes.lag.lag.value) < 1e-4
    assert late.lag.lag.value == pytest.approx(9, abs=0.01)
    assert late.lag.persistence.exceeds(0.0, 4.0) is Answer.YES
    assert late.flicker_beside_lag.value < late.flicker.value
    np.testing.assert_array_equal(
        np.array(loaded.scene.emitters()[0].world_transform().matrix), before
    )


def test_a_noisy_march_with_history_is_measured_in_several_runs(variant):
    loaded = load_scene("open-fog", (32, 24))
    (row,) = method_motion(loaded.scene, loaded.animation, [USUAL[3]], frames=16, turn=240, runs=3)
    # Of 0.1 for the newest frame 9 frames are expected; errors are those of three
    # runs, Student's 2 degrees.
    lag, bias = row.measures.lag.lag, row.measures.bias
    assert abs(lag.value - 9) < 0.5 + 10 * lag.error
    assert 0 < bias.error < row.measures.relative_rmse.value


def test_a_sweep_of_more_frames_than_a_turn_goes_round_again(variant):
    """There were as many places as frames of a turn: the next frame was an IndexError."""
    loaded = load_scene("open-fog", (8, 6))
    (row,) = method_motion(
        loaded.scene, loaded.animation, [configuration("unshadowed")], frames=5, turn=3
    )
    assert len(row.measures.rmse_by_frame) == 5
    assert row.measures.relative_rmse.value < 1e-4


def test_an_error_of_the_reference_is_no_noise_of_frames(variant, monkeypatch):
    """An exact method under a sky, whose references have random errors, was said to be noisy."""
    loaded, exact = load_scene("open-fog", (8, 6)), variation.reference_image
    random = np.random.default_rng(5)

    def noisy(scene):
        image = exact(scene)
        own = np.full(image.airlight.shape, 0.01 * image.airlight.mean())
        airlight = image.airlight + own * random.normal(size=own.shape)
        return replace(image, airlight=airlight, airlight_se=own, surface_se=0 * own)

    monkeypatch.setattr(variation, "reference_image", noisy)
    (row,) = method_motion(
        loaded.scene, loaded.animation, [configuration("unshadowed")], frames=3, turn=240
    )
    assert row.verdict.startswith("exact")


def test_what_does_not_move_is_refused(variant):
    loaded = load_scene("penumbra-plane", (16, 12))
    with pytest.raises(InputError, match="area lights"):
        method_motion(loaded.scene, loaded.animation, USUAL[:1])
    with pytest.raises(InputError, match="stimulus: got 'Sweep', expected sweep or step"):
        method_motion(loaded.scene, loaded.animation, USUAL[:1], stimulus="Sweep")
    with pytest.raises(InputError, match="expected at least 10 for a step"):
        method_motion(loaded.scene, loaded.animation, USUAL[:1], stimulus="step", frames=9)
    dark = replace(read_scene(loaded.scene), lights=(), area_lights=())
    with pytest.raises(InputError, match="no light that could circle"):
        light_references(loaded.scene, [dark], loaded.animation)
