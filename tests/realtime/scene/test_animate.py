# SPDX-License-Identifier: BSD-3-Clause
"""Lights and shapes that moved are those of the scene that is read again with them there."""

import mitsuba as mi
import numpy as np
import pytest

from airlight.realtime.frame.image import render_frame
from airlight.realtime.scene.animate import (
    coloured_light,
    read_objects,
    turned_light,
    turned_objects,
)
from airlight.realtime.scene.read_scene import read_scene
from airlight.validation.scenes.meshes import grid, icosphere, rotation
from airlight.validation.scenes.parts import mitsuba_mesh
from airlight.validation.study.configuration import configuration, prepared
from airlight.validation.study.growth import bumpy
from tests.helpers.clouds import cloud, cloud_scene, ring
from tests.helpers.scenes import tiny_scene


def host(array) -> np.ndarray:
    return np.array(array, dtype=np.float64).ravel()


def leaves(light) -> dict[str, np.ndarray]:
    """All numbers of a light, by the names of its fields."""
    found = {}
    for name, part in vars(light).items():
        if hasattr(part, "__dataclass_fields__"):
            found |= {f"{name}.{inner}": host(value) for inner, value in vars(part).items()}
        elif part is not None:
            found[name] = host(part)
    return found


def in_sun_and_sky(turn: float, colour: list[float]):
    """The scene with a light of each kind, read again with all of them turned and
    coloured; a sky does not turn.
    """

    def world(first, second):
        about = (
            mi.ScalarTransform4f()
            .translate([0.1, 0.2, 0])
            .rotate([0, 0, 1], turn)
            .translate([-0.1, -0.2, 0])
        )
        return about @ mi.ScalarTransform4f().look_at(first, second, [0, 1, 0])

    def rgb():
        return {"type": "rgb", "value": colour}

    lights = {
        "point": {
            "type": "point",
            "to_world": world([0.9, 0.7, 190.0], [0, 0, 0]),
            "intensity": rgb(),
        },
        "soft": {
            "type": "spot",
            "to_world": world([7.1, -3.0, 260.0], [0.1, 0.1, 0.4]),
            "cutoff_angle": 33.0,
            "beam_width": 21.0,
            "intensity": rgb(),
        },
        "sun": {
            "type": "directional",
            "to_world": world([0, 0, 0], [0.7, -0.3, -0.6]),
            "irradiance": rgb(),
        },
        "sky": {"type": "constant", "radiance": rgb()},
    }
    # A sky beside a lamp is a background, which lights nothing.
    scenes = [
        {name: lights[name] for name in names} for names in (("point", "soft"), ("sun", "sky"))
    ]
    built = [mi.load_dict(cloud_scene(ring=cloud("ring", ring()), **each)) for each in scenes]
    return [light for scene in built for light in read_scene(scene).lights]


def test_moved_lights_of_every_kind_are_those_of_the_scene_read_fresh(variant):
    colour = [3.0, 2.0, 0.5]
    before = in_sun_and_sky(0.0, colour)
    assert {light.kind for light in before} == {"point", "spot", "directional"}
    assert sum(light.sky is not None for light in before) == 1
    turned, coloured = in_sun_and_sky(71.0, colour), in_sun_and_sky(0.0, [0.5, 3.0, 2.0])
    for old, after, other in zip(before, turned, coloured, strict=True):
        by_turn = leaves(turned_light(old, np.array([0.1, 0.2, 0.0]), rotation((0, 0, 1), 71.0)))
        for moved, fresh in (
            (by_turn, leaves(after)),
            (leaves(coloured_light(old, 1 / 3)), leaves(other)),
        ):
            assert moved.keys() == fresh.keys()
            for name, values in fresh.items():
                # what float32 took from the other part, which may round the other way
                if not name.endswith("_low"):
                    # float32, and Mitsuba's matrices, which have a few roundings of their own.
                    np.testing.assert_allclose(
                        moved[name], values, rtol=1e-5, atol=3e-6 * abs(values).max(), err_msg=name
                    )


TURN = rotation((0.3, -0.2, 1), 71.0)


def bumpy_ball(turn=None, *, normals: bool):
    """A closed mesh that no turn maps to itself, turned about the middle of
    its bounding box as it was.

    Its normals, if it has any, are arbitrary and not those that Mitsuba would compute.
    """

    sphere, faces = icosphere(3)
    vertices = 0.31 * bumpy(sphere, np.full(3, -1.0), 3.5) * (1.0, 0.6, 1.3) + np.array(
        [0.13, -0.07, 0.73]
    )
    vertices = vertices.astype(np.float32).astype(np.float64)
    turn = np.eye(3) if turn is None else turn
    middle = 0.5 * (vertices.min(axis=0) + vertices.max(axis=0))
    mesh = mi.Mesh("ball", len(vertices), len(faces), has_vertex_normals=normals)
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = (
        ((vertices - middle) @ turn.T + middle).astype(np.float32).ravel()
    )
    parameters["faces"] = faces.astype(np.uint32).ravel()
    if normals:
        parameters["vertex_normals"] = (sphere @ turn.T).astype(np.float32).ravel()
    parameters.update()
    return mesh


def floor():
    return mitsuba_mesh(
        "floor", grid((-3.1, -3.3, -0.03), (6.7, 0, 0), (0, 6.1, 0), (2, 2)), (0.5, 0.6, 0.4)
    )


def read_turned(turn=None, *, normals: bool = False):
    parts = {"ball": bumpy_ball(turn, normals=normals), "floor": floor()}
    return read_scene(mi.load_dict(tiny_scene(size=(48, 36), **parts)))


def image(scene, method: str, parameters):
    return render_frame(prepared(scene, configuration(method, None, parameters)))


@pytest.mark.parametrize(
    ("method", "parameters", "normals"),
    [("shadow-planes", {}, True), ("light-volumes", {"map": 64}, False)],
)
def test_moved_objects_are_those_of_a_file_with_the_object_moved(
    variant, method, parameters, normals
):
    """Rays, normals, shadows on surfaces and in the fog."""
    scene = read_turned(normals=normals)
    before = image(scene, method, parameters)  # moved vertices move in this scene too
    objects = read_objects(scene, ["ball"])
    moved, loaded = turned_objects(scene, objects, TURN), read_turned(TURN, normals=normals)
    here, there = (image(each, method, parameters) for each in (moved, loaded))
    for name in ("airlight", "surface"):
        old, ours, theirs = (getattr(frame, name) for frame in (before, here, there))
        scale = theirs.mean()
        # what moved is seen
        assert np.mean(np.abs(old - theirs).max(axis=-1) > 1e-2 * scale) > 0.02
        # Rays and vertices are rounded to float32: 1e-6 of a distance. At an edge of the object or
        # of its shadow, a ray or a sample of it is on the other side, in a few pixels.
        same = np.isclose(ours, theirs, rtol=1e-4, atol=1e-4 * scale).all(axis=-1)
        assert np.mean(~same) < 0.01
