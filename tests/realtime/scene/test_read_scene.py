# SPDX-License-Identifier: BSD-3-Clause
"""Scenes are read as they are, plans name what is needed, and rays are those of Mitsuba."""

from types import SimpleNamespace

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from airlight.errors import InputError
from airlight.realtime.frame.image import render_frame
from airlight.realtime.numerics.array_types import array_types
from airlight.realtime.scene.camera import (
    pixel_grid,
    ray_directions,
    resized_camera,
    row_and_column,
    sensor_camera,
)
from airlight.realtime.scene.read_scene import describe, read_scene
from airlight.realtime.scene.rounding import check_rounding
from airlight.validation.scenes.height_fog import register_height_fog
from airlight.validation.scenes.loading import load_scene
from airlight.validation.study.configuration import configuration, prepared
from tests.helpers.scenes import bounded_medium, clear_scene, spot, tiny_scene


def read(**changes):
    return read_scene(mi.load_dict(tiny_scene(**changes)))


@pytest.mark.parametrize(
    "names", [("a.b", "a-b"), ("Sphere-2", ""), ("", "Sphere-1"), ("", ""), ("a.b.c", "a-b.c")]
)
def test_every_opaque_shape_stays_whatever_its_name(variant, names):
    """Mitsuba's dictionaries have keys without dots, each once; beside a boundary the
    opaque shapes are a new scene.
    """
    bounded = bounded_medium({"type": "cube"}, 0.3, (0.9, 0.9, 0.9))
    scene = clear_scene(
        first={"type": "sphere"}, second={"type": "sphere", "center": [5.0, 0.0, 0.0]}, box=bounded
    )
    loaded = mi.load_dict(scene)
    opaque = [shape for shape in loaded.shapes() if shape.interior_medium() is None]
    for shape, name in zip(opaque, names, strict=True):
        shape.set_id(name)
    shapes = read_scene(loaded).geometry.shapes()
    assert sorted(float(shape.bbox().min[0]) for shape in shapes) == [-1.0, 4.0]
    # Reading changes nothing of what it reads.
    assert (
        sorted(shape.id() for shape in shapes)
        == sorted(shape.id() for shape in opaque)
        == sorted(names)
    )


@pytest.mark.claim("not-needed-costs-nothing")
def test_plan_names_only_what_is_needed(variant):
    plan = describe(read(ball=None, floor=None))
    assert plan == {
        "surfaces": "none: no ray is cast for the camera",
        "shadows": "none: nothing casts a shadow",
        "extinction": "one for all channels",
        "phase function": "isotropic: left out of the integrand",
        "medium": "unbounded: every ray lies in it whole",
        "lights": "1 point",
        "spot falloff": "none: rays are clipped to cones at most",
    }
    plan = describe(read(spot=spot(beam=20.0)))
    assert (plan["shadows"], plan["lights"]) == ("visibility tests", "1 point and 1 spot")
    assert plan["spot falloff"] == "inside the cone: integrand weighted"
    assert describe(read(spot=spot()))["spot falloff"] == "none: rays are clipped to cones at most"


@pytest.mark.claim("glossy-surfaces-noted")
def test_glossy_surfaces_are_noted(variant):
    notes = read(ball={"type": "sphere", "bsdf": {"type": "roughplastic"}}).features.notes
    assert len(notes) == 1
    assert "not purely diffuse" in notes[0]
    assert read().features.notes == ()


@pytest.mark.claim("first-camera-noted")
def test_a_second_camera_is_noted(variant):
    """The first is used, and anyone who meant the other is told."""
    (note,) = read(
        other={"type": "perspective", "medium": {"type": "ref", "id": "fog"}}
    ).features.notes
    assert "2 cameras: the first is used" in note


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"albedo": -0.5}, r"albedo.* is \[-"),
        ({"albedo": float("nan")}, r"albedo.* is \[nan"),
        ({"scale": -1.0}, "-.*expected (a finite number|finite values) of 0 or more"),
        ({"phase": {"type": "hg", "g": float("nan")}}, "g is nan"),
    ],
)
@pytest.mark.parametrize("kind", ["homogeneous", "grid", "height fog"])
def test_numbers_that_no_medium_has_are_refused_whoever_built_the_scene(
    variant, kind, changes, words
):
    """`validation.scenes.loading` looks at files; a scene from Python comes here at once."""
    register_height_fog()
    box = {"to_world": mi.ScalarTransform4f().translate([-9.0, -9.0, -9.0]).scale(18.0)}
    grid = {"type": "gridvolume", "grid": mi.VolumeGrid(np.ones((2, 2, 2, 1), np.float32))}
    layers = {"type": "heightfog", "sigma_1": 0.1, "H_1": 1.0, "z_1": 0.0}
    volumes = {"grid": grid | box, "height fog": layers | box}
    fog = {"type": "homogeneous", "id": "fog", "sigma_t": 0.3, "albedo": 0.8}
    if kind != "homogeneous":
        fog |= {"type": "heterogeneous", "sigma_t": volumes[kind]}
    assert read(fog=fog).medium.channels == 1
    with pytest.raises(InputError, match=words) as refusal:
        read(fog=fog | changes)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize(("offset", "outcome"), [(0.0, ""), (3e3, "noted"), (4e5, "refused")])
def test_lengths_that_coordinates_lose_are_noted_or_refused(variant, offset, outcome):
    """In map coordinates an image was 10 % off, "known to 2e-11": float32 rounds positions
    before anyone reads them.
    """
    moved = mi.ScalarTransform4f().translate([offset, 0.0, 0.0])
    parts = tiny_scene(floor=None)
    parts["sensor"] = parts["sensor"] | {"to_world": moved @ parts["sensor"]["to_world"]}
    for name, key in (("lamp", "position"), ("ball", "center")):
        x, *others = parts[name][key]
        parts[name] = parts[name] | {key: [x + offset, *others]}
    scene = mi.load_dict(parts)
    notes = read_scene(scene).features.notes
    assert len(notes) == (outcome != "")
    assert all("the scene is 4.79 m large" in note for note in notes if offset < 1e4)
    if outcome != "refused":
        check_rounding(scene)
        return
    with pytest.raises(
        InputError, match=r"subtract an offset, such as \(400000, -4, 1\)"
    ) as refusal:
        check_rounding(scene)
    assert "\n" not in str(refusal.value)


def test_a_scene_without_a_camera_is_refused_for_that_alone(variant):
    check_rounding(mi.load_dict(tiny_scene(sensor=None)))
    with pytest.raises(InputError, match="has no camera"):
        read(sensor=None)


# The camera ---------------------------------------------------------------------------------------


@pytest.mark.claim("pixel-centre", tolerance="5e-7: Mitsuba's float32 matrices")
@pytest.mark.parametrize(
    ("size", "axis", "pixels"),
    [
        ((64, 48), "x", None),
        ((37, 53), "y", None),
        ((37, 53), "smaller", (10, 31)),
        ((64, 48), "smaller", (10, 31)),
    ],
)
def test_rays_are_those_of_mitsuba(variant, size, axis, pixels):
    sensor = {
        "type": "perspective",
        "fov": 47.0,
        "fov_axis": axis,
        "to_world": mi.ScalarTransform4f().look_at(
            [1.3, -2.1, 0.7], [0.2, 0.4, 0.9], [0.1, 0.2, 1.0]
        ),
        "film": {"type": "hdrfilm", "width": size[0], "height": size[1]},
    }
    scene = mi.load_dict({"type": "scene", "sensor": sensor})
    camera, plugin = sensor_camera(scene, array_types("double"))
    if pixels is not None:  # of the same picture, and no squares
        camera, size = resized_camera(camera, *pixels), pixels
    pixel = np.arange(size[0] * size[1])
    direction = np.array(ray_directions(camera, mi.UInt32(pixel.astype(np.uint32)))[0])
    position = mi.Point2f((pixel % size[0] + 0.5) / size[0], (pixel // size[0] + 0.5) / size[1])
    ray, _ = plugin.sample_ray(0.0, 0.5, position, mi.Point2f(0.5))
    assert np.max(np.abs(direction - np.array(ray.d))) < 5e-7  # float32 matrices on Mitsuba's side
    assert np.max(np.abs(np.linalg.norm(direction, axis=0) - 1)) < 1e-14


def test_aim_is_kept_to_twice_the_digits(variant):
    """The aim that a camera of single precision has besides its direction, by
    NumPy: the angle between them.
    """
    matrix = mi.ScalarTransform4f().look_at([1.3, -2.1, 0.7], [0.2, 0.4, 0.9], [0.1, 0.2, 1.0])
    film = {"type": "hdrfilm", "width": 801, "height": 601}
    scene = mi.load_dict(
        {
            "type": "scene",
            "s": {"type": "perspective", "fov": 63.7, "to_world": matrix, "film": film},
        }
    )
    pixel = mi.UInt32(np.arange(0, 801 * 601, 7, dtype=np.uint32))
    camera = sensor_camera(scene, array_types())[0]
    direction, aim = (np.array(part, dtype=np.float64).T for part in ray_directions(camera, pixel))
    forward, left, up = (np.array(axis).ravel() for axis in camera.axes)
    number = np.arange(0, 801 * 601, 7)
    exact = forward + (400 - number % 801)[:, None] * left + (300 - number // 801)[:, None] * up
    exact /= np.linalg.norm(exact, axis=1, keepdims=True)
    plain, kept = (np.linalg.norm(np.cross(part, exact), axis=1) for part in (direction, aim))
    assert plain.max() > 2e-8  # what float32 alone leaves
    assert kept.max() < 1e-13


@pytest.mark.parametrize("width", [1, 3, 641, 65535, 1 << 20, (1 << 31) - 1])
def test_rows_and_columns_are_those_of_a_division(variant, width):
    """Rationale: the division is one of float64, and wrong by one row where rounding shows.

    Setup: pixels next to the ends of rows, where it would show, up to the last that is
    allowed, and random ones.
    """

    most = (1 << 31) - 1
    generator = np.random.default_rng(7)
    rows = np.append(generator.integers(0, most // width + 1, 2000), [0, 1, most // width])
    pixels = np.clip(np.concatenate([rows * width + step for step in (-1, 0, 1)]), 0, most)
    pixels = np.concatenate([pixels, generator.integers(0, most, 2000), [most]])
    camera = SimpleNamespace(grid=pixel_grid(width, 3))
    row, column = row_and_column(camera, mi.UInt32(pixels.astype(np.uint32)))
    assert np.array_equal(np.array(row), pixels // width)
    assert np.array_equal(np.array(column), pixels % width)


def test_one_kernel_serves_images_of_all_sizes(variant):
    """Rationale: a kernel that holds the size of an image is compiled again for each,
    for half a second and more.
    """
    launched = []
    for size in ((64, 48), (96, 80)):
        scene = read_scene(load_scene("sphere-spot", size).scene)
        for method in ("unshadowed", "light-volumes"):
            renderer = prepared(scene, configuration(method))
            with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
                dr.kernel_history_clear()
                render_frame(renderer)
                kernels = dr.kernel_history((dr.KernelType.JIT,))
            largest = max(kernels, key=lambda kernel: kernel["operation_count"])
            launched.append((method, largest["hash"]))
    assert launched[:2] == launched[2:]
