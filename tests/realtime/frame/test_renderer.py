# SPDX-License-Identifier: BSD-3-Clause
"""A frame's airlight is the integral of the reference; marching, maps and
several rays a pixel converge.
"""

import re
from dataclasses import dataclass

import mitsuba as mi
import numpy as np
import pytest
from scipy.integrate import quad

from airlight.errors import InputError
from airlight.realtime.frame.image import render_frame
from airlight.realtime.frame.renderer import frame_renderer
from airlight.realtime.frame.samples import render_samples
from airlight.realtime.methods.interface.method import Layers, Method
from airlight.realtime.methods.registry import FOG_METHODS
from airlight.realtime.scene.read_scene import read_scene
from airlight.reference.quadrature.reference import reference_image
from airlight.validation.scenes.loading import load_scene
from airlight.validation.study.configuration import configuration, prepared
from tests.helpers import frames
from tests.helpers.frames import frame, reference_of, relative_rmse
from tests.helpers.height_fog import FOG, fog_xml
from tests.helpers.scenes import bounded_medium, clear_scene, spot, tiny_scene

SCENES = {
    "grey": dict,
    "hard spot": lambda: {"lamp": spot()},
    "soft spot": lambda: {"lamp": spot(cutoff=37.0, beam=19.0)},
    "two lights, colour, HG": lambda: {
        "spot": spot(beam=11.0),
        "fog": {
            "type": "homogeneous",
            "id": "fog",
            "sigma_t": {"type": "rgb", "value": [0.1, 0.4, 0.9]},
            "albedo": 0.83,
            "phase": {"type": "hg", "g": 0.53},
        },
    },
    "tabulated": lambda: {
        "fog": tiny_scene()["fog"]
        | {"phase": {"type": "tabphase", "values": "0.3, 0.2, 0.4, 0.9, 2.0"}}
    },
}


def render(method, *, scene=None, **options):
    return frame(scene or tiny_scene(), method, **options)


def without_shadows(name):
    return tiny_scene(ball=None, floor=None, **SCENES[name]())


@pytest.mark.claim("unshadowed-integral")
@pytest.mark.parametrize(
    ("name", "kernel"), [*((name, "exact") for name in SCENES), ("grey", "quadrature")]
)
def test_integral_without_shadows_is_that_of_the_reference(variant, name, kernel):
    """Two routes that share no code."""
    scene = without_shadows(name)
    integral = render("unshadowed", kernel=kernel, precision="double", scene=scene).airlight
    # Kernels promise 1e-6. Sixteen nodes a panel know nothing of the kinks of a
    # coarse phase table: 1e-3.
    assert relative_rmse(integral, reference_of(scene).airlight) < (
        1e-3 if name == "tabulated" else 1e-6
    )


# Uniform steps see their order later: an unbounded ray is 65 m long, and the light 4 m away.
@pytest.mark.slow
@pytest.mark.claim("march-orders", tolerance="order 2 within 0.15")
@pytest.mark.parametrize(("spacing", "first"), [("equiangular", 32), ("uniform", 512)])
def test_marching_is_of_second_order_without_shadows(variant, spacing, first):
    # Away from the light, where few steps are enough to see the order.
    scene = tiny_scene(ball=None, lamp=tiny_scene()["lamp"] | {"position": [2.9, 1.3, 3.7]})
    exact = render("unshadowed", kernel="quadrature", precision="double", scene=scene).airlight
    steps = first * np.array([1, 2, 4, 8])
    errors = [
        relative_rmse(
            render(
                "ray-march",
                precision="double",
                scene=scene,
                steps=int(n),
                spacing=spacing,
                shadow="none",
            ).airlight,
            exact,
        )
        for n in steps
    ]
    slope = np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert slope == pytest.approx(-2, abs=0.15)  # the midpoint rule


@pytest.mark.claim("march-maps", tolerance="2e-3 at the largest map")
def test_shadow_map_converges_to_shadow_rays(variant):
    scene = tiny_scene(size=(48, 36), spot=spot(beam=20.0))
    rays = render("ray-march", scene=scene, steps=200).airlight
    errors = [
        relative_rmse(
            render("ray-march", scene=scene, steps=200, shadow="map", map=size).airlight, rays
        )
        for size in (16, 128, 1024)
    ]
    assert errors == sorted(errors, reverse=True)
    assert errors[-1] < 2e-3
    assert render("ray-march", scene=scene, shadow="none").airlight.sum() > rays.sum()


# Several rays a pixel -----------------------------------------------------------------------------


@pytest.mark.parametrize("method", ["shadow-planes", "froxel-fog"])
def test_one_ray_is_the_frame_itself(variant, method):
    renderer = prepared(
        read_scene(load_scene("sphere-spot", (16, 12)).scene), configuration(method)
    )
    np.testing.assert_array_equal(
        render_samples(renderer, 1).airlight, render_frame(renderer).airlight
    )


@pytest.mark.claim("anti-aliased")
def test_the_mean_converges_to_that_over_the_pixels(variant):
    """16 rays err a quarter as much as the centre alone, by the quadrature
    of the means over pixels.
    """
    loaded = load_scene("sphere-spot", (16, 12))
    reference = reference_image(loaded.scene, pixel="area").airlight
    renderer = prepared(read_scene(loaded.scene), configuration("shadow-planes"))
    fractions = []

    def error(samples):
        frame = render_samples(renderer, samples, fractions.append)
        return np.sqrt(np.mean((frame.airlight - reference) ** 2)) / reference.mean()

    assert error(16) < error(1) / 4
    assert fractions == [number / 16 for number in range(1, 17)]


def test_further_layers_are_means_too(variant):
    @dataclass(frozen=True)
    class Twice(Method):
        name = "twice"
        at_once = True
        uses_kernel = False

        def render(self, view, state, kernel):
            shown = view.medium.albedo * view.direction.x
            return Layers(shown, extra={"twice": 2 * shown})

    made = frame_renderer(frames.read(tiny_scene()), Twice, extra_layers=True)
    frame = render_samples(made, 4)
    np.testing.assert_allclose(frame.extra["twice"], 2 * frame.airlight, rtol=1e-6)
    assert np.ptp(frame.airlight) > 0


# Lights on rays, by their distance ----------------------------------------------------------------


def render_along(method, *, position, size=(9, 9), changes=None, **parameters):
    """Render a scene whose camera looks along +y, its middle pixel along the axis."""
    scene = tiny_scene(size=size, floor=None)
    scene["sensor"]["to_world"] = mi.ScalarTransform4f().look_at([0, -5, 1], [0, 0, 1], [0, 0, 1])
    scene["lamp"]["position"] = position
    scene |= {
        "ball": {"type": "cube", "to_world": mi.ScalarTransform4f().translate([2, 3, 0]).scale(0.3)}
    } | (changes or {})
    return frames.render(scene, method, **parameters)


@pytest.mark.claim("light-on-a-ray-refused")
@pytest.mark.parametrize("method", FOG_METHODS)
@pytest.mark.parametrize("position", [[0.0, -5.0, 1.0], [0.0, 0.0, 1.0], [1e-8, 0.0, 1.0]])
def test_a_light_at_the_camera_or_on_a_ray_is_refused_by_its_distance(variant, method, position):
    with pytest.raises(
        InputError, match=r"light 1 is [\d.e-]+ m from the (camera|ray .* column 4 of row 4)"
    ):
        render_along(method, position=position)


@pytest.mark.parametrize(
    "position", [[0.0, -9.0, 1.0], [0.0, 9.0, 1.0], [1e-4, 0.0, 1.0], [0.0, -4.999, 1.03]]
)
def test_a_light_on_the_line_of_a_ray_but_not_on_it_is_rendered(variant, position):
    """Behind the camera, behind a wall, a little aside."""
    wall = {"type": "cube", "to_world": mi.ScalarTransform4f().translate([0, 4, 1]).scale(0.5)}
    frame = render_along("unshadowed", position=position, changes={"wall": wall})
    assert np.isfinite(frame.airlight).all()
    assert frame.airlight[4, 4].min() > 0


@pytest.mark.parametrize("method", ["unshadowed", "ray-march"])
@pytest.mark.parametrize(("lamp", "meets"), [((-12, 3, 8), 0), ((-14, 3, 9), 0), ((0, 3, 2), 1)])
def test_a_light_on_a_ray_above_height_fog_is_rendered(variant, tmp_path, method, lamp, meets):
    """Nothing is scattered around it: the integral is finite, also with the camera at the lamp."""
    fog = fog_xml(
        f'<emitter type="point"><point name="position" value="{str(lamp)[1:-1]}"/></emitter>',
        size=(9, 7),
        fog=FOG.replace('z="43"', 'z="3"'),
    )
    down = 'origin="-14, 3, 9" target="-8, 3, 6"'
    (tmp_path / "fog.xml").write_text(re.sub('origin="-13.*2.9"', down, fog))
    scene = load_scene(str(tmp_path / "fog.xml")).scene
    if meets:
        with pytest.raises(InputError, match=r"light 1 is .* column 4 of row 3"):
            frames.render(scene, method)
    else:
        assert frames.render(scene, method).airlight[3, 4].min() > 0


@pytest.mark.parametrize(("lamp", "meets"), [(0.0, True), (-2.0, False), (-5.0, False)])
def test_a_light_on_a_ray_is_refused_within_a_body_of_fog_alone(variant, lamp, meets):
    body = bounded_medium({"type": "sphere", "center": [0, 0, 1], "radius": 0.5}, 1.0, (0.9,) * 3)
    scene = clear_scene(size=(9, 9), ball=body)
    scene["sensor"]["to_world"] = mi.ScalarTransform4f().look_at([0, -5, 1], [0, 0, 1], [0, 0, 1])
    scene["lamp"]["position"] = [0.0, lamp, 1.0]
    if meets:
        with pytest.raises(InputError, match=r"light 1 is .* column 4 of row 4"):
            frames.render(scene, "unshadowed")
    else:
        assert frames.render(scene, "unshadowed").airlight[4, 4].min() > 0


@pytest.mark.parametrize(
    ("method", "parameters"),
    [
        ("ray-march", {}),
        ("ray-march", {"sum": "transitions"}),
        ("soft-shafts", {"spacing": "equiangular", "steps": 100, "filter": "none"}),
    ],
)
def test_a_ray_straight_away_from_a_light_has_its_airlight(variant, method, parameters):
    """All angles at the light are 90 degrees there, and equal steps in them had no length."""
    J, _ = quad(lambda x: np.exp(-0.31 * (2 * x + 4)) / (x + 4) ** 2, 0, np.inf)
    wanted = J * 0.31 * np.array([0.9 * 5, 0.8 * 4, 0.7 * 3]) / (4 * np.pi)
    for away in (0.0, 1e-7, 1e-4):
        found = render_along(method, position=[away, -9.0, 1.0], **parameters).airlight[4, 4]
        # Both ends of an angle of 1/1024 are rounded to 2^-24: 1.2e-4, and as much for
        # the places of its steps.
        np.testing.assert_allclose(found, wanted, rtol=3e-4)
