# SPDX-License-Identifier: BSD-3-Clause
"""Area lights in frames: every method renders their points, frames follow moves, and
spheres have their closed form.
"""

from dataclasses import dataclass, replace
from typing import ClassVar

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

import airlight.realtime.frame.light_groups as groups_module
import airlight.realtime.scene.light_table as module
from airlight.realtime.area_lights.points import LightSamples
from airlight.realtime.area_lights.shape import turned_area_light
from airlight.realtime.frame.image import image_frame, render_frame
from airlight.realtime.frame.incremental import next_frame
from airlight.realtime.frame.renderer import run_stages
from airlight.realtime.methods.interface.method import Layers, Method
from airlight.realtime.methods.registry import METHODS
from airlight.realtime.scene.animate import with_area_lights
from airlight.realtime.scene.light_table import light_choice, light_tables, sampled_lights
from airlight.validation.scenes.meshes import rotation
from tests.evidence.closed_forms import sphere_airlight
from tests.helpers import frames
from tests.helpers.area_lights import BLACK, NULL, fog, lamp, lit_scene, ring
from tests.helpers.frames import read, relative_rmse, render
from tests.helpers.lamps import area_lamp, lit_by
from tests.helpers.scenes import clear_scene, tiny_scene
from tests.helpers.sunlit import fog_sphere, shaded

SIZE = (32, 24)
#: Methods with what brings them close to the reference, and the relative RMSE
#: of airlight that remains.
CLOSE = {
    "ray-march": ({"steps": 600}, 1e-3),
    "shadow-planes": ({}, 1e-3),
    "light-volumes": ({"map": 1024}, 3e-3),
    "min-max": ({"map": 1024, "sampling": "pixels", "slices": 400}, 2e-2),
}


def scene_of(precision="single", **changes):
    return read(lit_by(**({"changes": {"size": SIZE}} | changes)), precision)


@pytest.fixture(scope="module", params=["rectangle", "folded mesh"])
def one_by_one(variant, request):
    """Frames of each of five points as the only light, added up: what every
    method must come close to.
    """
    airlight = surface = 0.0
    scene = scene_of(
        **(
            {}
            if request.param == "rectangle"
            else {"changes": {"size": SIZE, "lamp": ring((0.9, 0.7, 1.9), size=0.6)}}
        )
    )
    points, _ = sampled_lights(scene.area_lights, LightSamples(5, "sobol"), mi.Float)
    for point in points:
        alone = replace(scene, lights=(replace(point, source=None),), area_lights=())
        frame = frames.render(alone, "ray-march", steps=1200)
        airlight, surface = airlight + frame.airlight, surface + frame.surface
    return scene, airlight, surface


@pytest.mark.parametrize("name", CLOSE)
def test_every_method_renders_the_points_of_a_light(variant, one_by_one, name):
    parameters, bound = CLOSE[name]
    scene, airlight, surface = one_by_one
    frame = frames.render(scene, name, points=5, pattern="sobol", **parameters)
    assert relative_rmse(frame.airlight, airlight) < bound
    assert relative_rmse(frame.surface, surface) < (0.1 if name == "light-volumes" else 1e-4)


def test_a_folded_lamp_alone_shadows_itself_and_another_does_not(variant):
    """A speck far behind the camera, which makes any scene one with shadows, changes nothing."""
    speck = {"type": "sphere", "center": [3.0, 1.0, -500.0], "radius": 1e-3}
    alone, beside = (
        read(lit_scene(size=(8, 6), lamp=ring(), **more)) for more in ({}, {"speck": speck})
    )
    airlight, expected = (
        render(scene, "ray-march", points=2, steps=50).airlight for scene in (alone, beside)
    )
    np.testing.assert_allclose(airlight, expected, rtol=1e-5)
    assert not read(lit_scene(lamp=lamp("sphere", center=[0.3, 0.4, 2.9]))).features.shadows


def _two_spots():
    """Return a scene with a hard and a soft spot in bounded media."""
    spot = {
        "type": "spot",
        "to_world": mi.ScalarTransform4f().look_at([1.3, -0.7, 2.1], [0.1, 0.2, 0.3], [0, 0, 1]),
    }
    bright = {"intensity": {"type": "rgb", "value": [9.1, 7.3, 5.9]}, "cutoff_angle": 37.0}
    lamps = {
        "hard": spot | bright | {"beam_width": 37.0},
        "soft": spot | bright | {"beam_width": 11.0},
    }
    turned = mi.ScalarTransform4f().translate([0.63, 0.47, 1.63]).rotate([1, 2, 3], 37).scale(0.07)
    solid = {"type": "cube", "to_world": turned}
    return read(shaded(size=(16, 12), lamp=None, pearl=fog_sphere(), solid=solid, **lamps))


def test_many_lights_one_by_one_are_all_at_once(variant):
    """Each light has code of its own in one kernel, or kernels of their own: the sum
    is the same to rounding.
    """
    scene = _two_spots()
    method = METHODS["unshadowed"]
    apart = frames.renderer(scene, method)
    assert len(apart.groups) == len(scene.lights) == 2
    one = frames.renderer(scene, at_once(method))
    assert len(one.groups) == 1
    wanted, frame = render_frame(one), render_frame(apart)
    np.testing.assert_allclose(
        frame.airlight, wanted.airlight, rtol=1e-5, atol=1e-5 * wanted.airlight.mean()
    )
    np.testing.assert_allclose(frame.surface, wanted.surface, rtol=1e-5, atol=1e-6)
    still = {"camera_moved": False, "geometry_moved": False, "light_moved": False}
    stages, cache = next_frame(apart, scene, None, **still)
    np.testing.assert_array_equal(image_frame(apart, stages).airlight, frame.airlight)
    stages, _ = next_frame(apart, scene, cache, **still)
    np.testing.assert_array_equal(image_frame(apart, stages).airlight, frame.airlight)


@dataclass(frozen=True)
class Prepared(Method):
    """A method that counts how often it prepares a light."""

    name = "prepared"
    uses_kernel = False
    prepared_from = frozenset({"geometry", "light"})
    made: ClassVar[list[int]] = []

    def prepare(self, scene, light):
        self.made.append(1)
        return light.position

    def airlight(self, view, light, state, kernel):
        return light.intensity + 0 * view.distance


def test_states_are_kept_for_all_lights_that_fit_and_samples_made_once_a_frame(
    variant, monkeypatch
):
    """Where nothing moved nothing is prepared again, however many lights there are; the samples are
    the same in all stages of a frame."""
    scene = scene_of(changes={"size": (16, 12)})
    placed = []
    place_points = module.place_points
    monkeypatch.setattr(
        module, "place_points", lambda *which: (placed.append(1), place_points(*which))[1]
    )
    drawn = frames.renderer(scene, Prepared, points=40)
    still = {"camera_moved": False, "geometry_moved": False, "light_moved": False}
    _, cache = next_frame(drawn, scene, None, **still)
    assert len(Prepared.made) == 40
    placed.clear()
    next_frame(drawn, scene, cache, **still)
    assert len(Prepared.made) == 40
    assert len(placed) == 1
    # A state beyond the room for all is made when it is needed.
    monkeypatch.setattr(groups_module, "_ROOM", 3 * 12)
    assert [state is None for state in drawn.prepare(scene)] == [False] * 3 + [True] * 37


@pytest.mark.parametrize("Float", ["Float", "Float64"])
def test_the_table_of_a_light_has_its_samples_bit_by_bit(variant, Float):
    """Methods read the table or the samples: images of both belong to one light."""
    lights, (table,) = sampled_lights(
        scene_of().area_lights, LightSamples(7, "sobol"), getattr(mi, Float)
    )
    (stacked,) = light_tables(lights)
    made, read_back = dr.width(table.rows), dr.width(stacked.rows)
    assert (table.count, made) == (stacked.count, read_back) == (7, 7)
    for one, other in zip(_numbers(table.rows), _numbers(stacked.rows), strict=True):
        assert one.dtype == other.dtype
        np.testing.assert_array_equal(one, other)


def _numbers(light):
    facing = light.facing
    return map(
        np.array, (light.position, light.intensity, facing.exact_normal, facing.lift, facing.chord)
    )


def test_the_power_of_a_light_is_its_intensity_times_its_solid_angle(variant):
    """By these numbers a method draws lights: a wrong one is noise, and no error."""
    spot = {
        "type": "spot",
        "to_world": mi.ScalarTransform4f().look_at([1, 2, 3], [0, 0, 0], [0, 0, 1]),
    }
    lamps = {
        f"spot-{n}": spot | {"cutoff_angle": angle, "beam_width": angle / 2, "intensity": power}
        for n, (angle, power) in enumerate([(30.0, 2.0), (60.0, 1.0), (80.0, 4.0)])
    }
    (table,) = light_tables(read(shaded(size=(16, 12), lamp=None, **lamps)).lights)
    power = np.array([2.0, 1.0, 4.0]) * (1 - np.cos(np.radians([30.0, 60.0, 80.0])))
    np.testing.assert_allclose(
        np.array(light_choice(table).fractions), power / power.sum(), rtol=1e-6
    )


def test_a_black_lamp_shadows_others_and_not_itself(variant):
    """A disk before the point light of the scene: what is behind it gets its own light alone."""

    def drawn(material):
        screen = area_lamp("disk", size=0.3, material=material) | {
            "to_world": mi.ScalarTransform4f()
            .look_at([0.75, 0.6, 1.5], [0.1, 0.1, -3.0], [0, 1, 0])
            .scale(0.3)
        }
        scene = read(
            lit_by(changes={"size": SIZE}) | {"lamp": tiny_scene()["lamp"], "screen": screen}
        )
        return [
            frames.render(scene, name, points=2, **parameters)
            for name, parameters in (("shadow-planes", {}), ("ray-march", {"steps": 1000}))
        ]

    planes, marched = drawn(None)
    assert relative_rmse(planes.airlight, marched.airlight) < 4e-3  # a polygon stands for the disk
    clear, _ = drawn({"type": "null"})
    assert planes.airlight.mean() < 0.97 * clear.airlight.mean()


@dataclass(frozen=True)
class Veil(Method):
    """A method of the tests."""

    name = "veil"
    uses_kernel = False

    def render(self, view, state, kernel):
        light = sum(light.intensity for light in view.lights)
        light = light + 0 * view.distance * light
        return Layers(
            light, transmittance=type(view.distance)(0.5), background=type(view.medium.albedo)(0.25)
        )


def at_once(method):
    """Return a method that is given all lights together."""
    return dataclass(frozen=True)(type("AtOnce", (method,), {"at_once": True}))


def test_what_a_method_shows_of_no_light_is_added_once(variant):
    method = Veil
    scene = scene_of(changes={"size": (16, 12), "ball": None, "floor": None})
    frame = frames.render(scene, method, points=4)
    np.testing.assert_allclose(frame.surface, 0.125, rtol=1e-6)
    light = scene.area_lights[0]
    np.testing.assert_allclose(frame.airlight[0, 0], light.radiance * light.area, rtol=1e-5)
    again = frames.render(scene, at_once(method), points=4)
    np.testing.assert_allclose(again.surface, frame.surface, rtol=1e-6)
    np.testing.assert_allclose(again.airlight, frame.airlight, rtol=1e-6)


@pytest.mark.parametrize(
    ("name", "material"),
    [("ray-march", {"type": "null"}), ("shadow-planes", None), ("light-volumes", None)],
)
def test_the_next_frame_is_that_of_the_moved_light(variant, name, material):
    parameters = (
        {"steps": 20} if name == "ray-march" else {"map": 64} if name == "light-volumes" else {}
    )
    scene = scene_of(kind="disk", size=0.31, material=material, changes={"size": SIZE})
    drawn = frames.renderer(scene, name, points=3, **parameters)
    about = np.array([0.1, 0.1, 0.0])
    still = {"camera_moved": False, "geometry_moved": False, "light_moved": False}
    stages, cache = next_frame(drawn, scene, None, **still)
    np.testing.assert_array_equal(image_frame(drawn, stages).airlight, render_frame(drawn).airlight)
    again, cache = next_frame(drawn, scene, cache, **still)
    np.testing.assert_array_equal(np.array(again[2]), np.array(stages[2]))
    turned = turned_area_light(scene.area_lights[0], about, rotation((0, 0, 1), 40.0))
    moved = with_area_lights(scene, [turned])
    stages, cache = next_frame(drawn, moved, cache, **(still | {"light_moved": True}))
    afresh = frames.renderer(moved, name, points=3, **parameters)
    wanted = run_stages(afresh, afresh.prepare(moved))
    for got, expected in zip(stages, wanted, strict=True):
        np.testing.assert_allclose(np.array(got), np.array(expected), rtol=1e-5, atol=1e-6)
    assert not np.allclose(np.array(stages[2]), np.array(again[2]), rtol=1e-2)
    with_area_lights(scene, scene.area_lights)


# Right beside a sphere light in fog ---------------------------------------------------------------


SIGMA_T, RADIUS, FAR, END, SPHERE_SIZE = 0.21, 0.41, 5.0, 20.0, (24, 18)


def beside_a_sphere(**shapes):
    light = lamp("sphere", radiance=(1, 1, 1), center=[0.0, 0.0, FAR], radius=RADIUS)
    wall = {
        "type": "rectangle",
        "to_world": mi.ScalarTransform4f().translate([0, 0, END]).scale([-50, 50, 50]),
        "bsdf": BLACK,
    }
    return read(
        lit_scene(size=SPHERE_SIZE, medium=fog(SIGMA_T, 1.0), lamp=light, wall=wall, **shapes)
    )


@pytest.mark.claim(
    "sphere-light-beside", tolerance="of the midpoint rule with 32 places a ray, 2e-3"
)
def test_fog_beside_a_sphere_light_has_the_closed_form(variant):
    """By 64 samples without it 9 %, by 16 27 %."""
    scene = beside_a_sphere()
    frame = render(scene, "shadow-planes", points=16)
    tangent = np.tan(np.radians(30.0)) * 2 / SPHERE_SIZE[0]
    column, row = np.meshgrid(*(np.arange(count) - 0.5 * (count - 1) for count in SPHERE_SIZE))
    slope = tangent * np.hypot(column, row)
    height, foot, end = (
        FAR * slope / np.hypot(1, slope),
        FAR / np.hypot(1, slope),
        END * np.hypot(1, slope),
    )
    beside = height > RADIUS
    rays = zip(height[beside], foot[beside], end[beside], strict=True)
    closed = np.array(
        [sphere_airlight(SIGMA_T, h, RADIUS, foot=f, x0=0.0, x1=x1) for h, f, x1 in rays]
    )
    expected = np.repeat(closed[:, None], 3, axis=1) * SIGMA_T / (4 * np.pi)
    assert relative_rmse(frame.airlight[beside], expected) < 2e-3
    # Before the lamp circles end at the ray, where the rule is of second order:
    # samples without it err by 30 %.
    many = render(scene, "unshadowed", points=1024)
    assert relative_rmse(frame.airlight[~beside], many.airlight[~beside]) < 0.05


def test_a_ray_through_the_middle_of_a_sphere_light_is_as_bright_as_those_beside_it(variant):
    """Nothing says which way is across such a ray: its pixel was 13 times too bright."""

    def airlight(aside):
        light = lamp("sphere", radiance=(1, 1, 1), center=[aside, 0.0, FAR], radius=RADIUS)
        scene = read(lit_scene(size=(1, 1), medium=fog(SIGMA_T, 1.0), lamp=light))
        return render(scene, "unshadowed", points=16).airlight

    assert airlight(0.0) == pytest.approx(airlight(1e-3), rel=1e-3)


def test_what_is_in_the_shadow_of_a_sphere_light_stays_dark(variant):
    box = {
        "type": "cube",
        "to_world": mi.ScalarTransform4f().translate([0, 0, FAR]).scale(1.0),
        "bsdf": BLACK,
    }
    assert render(beside_a_sphere(box=box), "shadow-planes", points=16).airlight.max() < 1e-6


def test_a_sphere_light_over_a_body_of_fog_is_that_of_its_samples(variant):
    """A body lies on one side of a ray: places on half of the sphere are wrong by 91 %."""
    light = lamp("sphere", bsdf=NULL, center=[-0.8, 0.4, 2.3], radius=0.7)
    body = fog_sphere((-0.8, 0.4, 0.7), 0.6, sigma_t=3.0)
    made = frames.renderer(clear_scene(size=(8, 6), lamp=light, body=body), "unshadowed", points=64)
    samples = render_frame(replace(made, sphere_scales=None)).airlight
    assert samples.max() > 0
    assert relative_rmse(render_frame(made).airlight, samples) < 0.03
