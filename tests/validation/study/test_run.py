# SPDX-License-Identifier: BSD-3-Clause
from dataclasses import replace

import mitsuba as mi
import pytest

from realtime.scene.features import SceneFeatures
from realtime.scene.read_scene import read_scene
from tests.helpers.scenes import tiny_scene
from validation.scenes.loading import LoadedScene
from validation.study.configuration import STANDARD, Configuration
from validation.study.run import configurations_for, measure

MARCH = Configuration("ray-march", None, (("steps", 200),))
UNSHADOWED = Configuration("unshadowed", "quadrature")
FEATURES = SceneFeatures(
    shadows=True,
    surfaces=True,
    extinctions=1,
    isotropic=True,
    bounded=False,
    vacuum=False,
    point_lights=1,
    spot_lights=0,
    soft_spots=False,
)


@pytest.fixture(scope="module")
def loaded(variant):
    return LoadedScene("tiny", mi.load_dict(tiny_scene(size=(16, 12))), "A tiny scene.", "")


@pytest.fixture(scope="module")
def measured(loaded):
    from validation.estimates.quadrature import truth_image

    scene, truth = read_scene(loaded.scene), truth_image(loaded.scene)
    return {chosen: measure(scene, chosen, truth=truth, seconds=0.01) for chosen in (MARCH, UNSHADOWED)}


def test_marching_with_visibility_is_near_the_truth(measured):
    error = measured[MARCH].error
    # Every step that straddles the edge of a shadow is wrong by up to half of itself: 200 steps leave a few per mille.
    assert error.relative_rmse < 0.02
    assert error.nonfinite == error.negative == 0
    assert error.pixels == 16 * 12


def test_method_without_shadows_is_too_bright_by_what_shadows_take_away(measured):
    error = measured[UNSHADOWED].error
    assert error.relative_bias > 0.003
    assert error.relative_rmse > 3 * measured[MARCH].error.relative_rmse


@pytest.mark.claim("refusals-stand-in-the-report")
def test_refusal_is_kept_and_not_raised(variant):
    """What a method cannot do is a line of the table; one bad configuration must not end a report."""
    from validation.estimates.quadrature import truth_image

    scene = mi.load_dict(
        tiny_scene(
            size=(4, 3), fog=tiny_scene()["fog"] | {"phase": {"type": "tabphase", "values": "0.3, 0.2, 0.4, 0.9, 2.0"}}
        )
    )
    measurement = measure(
        read_scene(scene), Configuration("unshadowed", "taylor"), truth=truth_image(scene, samples=16)
    )
    assert measurement.frame is None
    assert measurement.times is None
    assert measurement.error is None
    assert "tab" in measurement.refused
    assert "\n" not in measurement.refused


def test_variants_of_shadows_are_left_out_where_nothing_casts_one():
    lamp = replace(FEATURES, area_lights=("disk",))
    assert configurations_for(replace(lamp, bounded=True, clear=True)) == STANDARD
    unbounded = configurations_for(lamp)
    (left_out,) = (configuration for configuration in STANDARD if configuration not in unbounded)
    assert dict(left_out.parameters) == {"media": "paper"}
    without_points = configurations_for(FEATURES)
    assert set(unbounded) - set(without_points) == {given for given in STANDARD if "points" in dict(given.parameters)}
    left = configurations_for(replace(lamp, shadows=False))
    assert 0 < len(left) < len(STANDARD)
    assert all(not {"shadow", "map"} & set(dict(configuration.parameters)) for configuration in left)
    assert {configuration.method for configuration in left} == {configuration.method for configuration in STANDARD}


class Clock:
    """A clock that goes on only where a test says so."""

    now = 0.0

    def perf_counter(self):
        return self.now


def probed(loaded, monkeypatch, chosen, *, seconds, limit, clock=None):
    """Measure a configuration whose small frame takes so long."""
    clock = clock or Clock()
    from validation.estimates.quadrature import truth_image
    from validation.study import run as module

    monkeypatch.setattr(module, "_DOUBTFUL", -1.0)
    render = module.render_frame

    def slowed(renderer):
        if renderer.scene.camera.width == 8:
            clock.now += seconds
        return render(renderer)

    monkeypatch.setattr(module, "time", clock)
    monkeypatch.setattr(module, "render_frame", slowed)
    scene, truth = read_scene(loaded.scene), truth_image(loaded.scene)
    small = read_scene(mi.load_dict(tiny_scene(size=(8, 6))))
    return measure(scene, chosen, truth=truth, seconds=0.01, limit=limit, probe=lambda: small)


def test_what_would_take_too_long_is_left_out_with_what_it_would_take(loaded, monkeypatch):
    # 16 x 12 pixels are four times 8 x 6: 0.15 s there, of which little is preparation, are at least 0.4 s here.
    measurement = probed(loaded, monkeypatch, MARCH, seconds=0.15, limit=0.3)
    assert measurement.left_out
    assert measurement.frame is measurement.times is measurement.error is None
    assert "by a frame of 8 x 6 pixels" in measurement.refused
    assert "more than the limit of 0.3 s" in measurement.refused
