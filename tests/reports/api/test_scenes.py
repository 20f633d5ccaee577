# SPDX-License-Identifier: BSD-3-Clause
"""Scenes from Python: what is loaded stays as it is, and what cannot be a scene says why."""

import html

import mitsuba as mi
import pytest

import airlight
from airlight.validation.scenes.registry import SCENES
from tests.helpers.api import TINY

DARK = {
    "type": "scene",
    "sensor": {"type": "perspective", "film": {"type": "hdrfilm", "width": 16, "height": 12}},
    "floor": {"type": "rectangle"},
}


def test_a_loaded_scene_is_neither_changed_nor_loaded_at_another_size(variant):
    scene = airlight.load_scene("open-fog", TINY)
    with pytest.raises(airlight.InputError, match="change: is for a scene by name or path"):
        airlight.render(scene, "unshadowed", change={"medium.sigma_t": 0.1})
    with pytest.raises(
        airlight.InputError, match=r"size: got 8x6 for a scene that is loaded already, at 16x12"
    ):
        airlight.load_scene(scene, (8, 6))
    with pytest.raises(
        airlight.InputError, match=r"got 8x6 for a scene that is loaded already, at 800x600"
    ):
        airlight.load_scene(mi.load_dict(SCENES["open-fog"].build()), (8, 6))
    assert scene.size == TINY


def test_a_dictionary_has_its_own_size_and_one_that_mitsuba_refuses_says_why(variant):
    assert airlight.load_scene(DARK).size == TINY
    with pytest.raises(
        airlight.InputError, match=r"Mitsuba cannot build the dictionary: .*no_such_shape"
    ) as raised:
        airlight.load_scene(DARK | {"floor": {"type": "no_such_shape"}})
    assert "\n" not in str(raised.value)


LENSES = ({}, {"fov": 40}, *({"fov": 40, "fov_axis": axis} for axis in ("y", "larger")))


@pytest.mark.parametrize("lens", LENSES, ids=str)
def test_a_dictionary_keeps_its_angle_of_view_along_the_axis_that_it_says(variant, lens):
    """Without a film too, whose size Mitsuba chooses then. A camera that is built tells no axis."""

    def angle(size=None, more=None, **film):
        sensor = {"type": "perspective", **lens, **film}
        scene = airlight.load_scene({"type": "scene", **(more or {}), "sensor": sensor}, size=size)
        return float(mi.traverse(scene.scene.sensors()[0])["x_fov"][0])

    expected = angle(film={"type": "hdrfilm", "width": 31, "height": 12})
    assert angle((31, 12)) == angle((31, 12), film=DARK["sensor"]["film"]) == expected
    built = {"first": mi.load_dict({"type": "perspective", "fov": 50.0})}
    assert angle((31, 12), built) == 50


def test_a_scene_of_another_variant_says_when_to_build_it(variant):
    other = type("Scene", (), {"__module__": "mitsuba.scalar_rgb"})()
    with pytest.raises(
        airlight.InputError,
        match=rf"of another variant than {variant}; call airlight\.activate\(\)",
    ):
        airlight.load_scene(other)


def test_a_scene_that_no_method_renders_is_shown_with_the_reason(variant):
    scene = airlight.load_scene(DARK)
    with pytest.raises(airlight.InputError) as raised:
        scene.plan()
    shown = scene._repr_html_()
    assert "refused" in shown
    assert html.escape(str(raised.value)) in shown
