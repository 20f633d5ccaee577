# SPDX-License-Identifier: BSD-3-Clause
"""Scenes and frames for the tests of light volumes."""

import mitsuba as mi
import numpy as np

from airlight.realtime.shadow_maps.shadow_map import cast_shadow_map
from airlight.reference.scene.read import read_reference
from tests.evidence.oracles.light_volume import oracle_airlight, traced_walls
from tests.helpers.frames import read, render
from tests.helpers.scenes import spot, tiny_scene

SIZE = (48, 36)
#: The same height field walked and drawn, by methods and their parameters.
VOLUMES = {"light-volumes": {"walls": "slanted"}, "light-volumes-2010": {}}


def lamp(*position):
    return {
        "type": "point",
        "position": list(position),
        "intensity": {"type": "rgb", "value": [5.0, 4.0, 3.0]},
    }


def camera(origin, target, *, size=SIZE, up=(0, 0, 1)):
    look = mi.ScalarTransform4f().look_at(list(origin), list(target), list(up))
    return {"sensor": tiny_scene(size=size)["sensor"] | {"to_world": look}}


def bars(count=14):
    """Bars between the light and the rays of a camera that looks along them."""

    def bar(number):
        place = mi.ScalarTransform4f().translate([-1.6 + 0.25 * number, 0.9, 1.0])
        return {"type": "cube", "to_world": place.scale([0.05, 0.03, 2.0])}

    return {f"bar{number}": bar(number) for number in range(count)}


def fence():
    return (
        camera((-3.9, 1.7, 1.4), (2.3, 1.43, 0.9), size=(28, 20))
        | {"lamp": lamp(0.1, -0.9, 1.2), "ball": None}
        | bars()
    )


def coloured_fog():
    colours = {"type": "rgb", "value": [0.1, 0.4, 0.9]}
    return {
        "type": "homogeneous",
        "id": "fog",
        "sigma_t": colours,
        "albedo": 0.8,
        "phase": {"type": "hg", "g": 0.5},
    }


#: Changes of the tiny scene by name, and the size of the map. Cameras on the grid
#: have a column in the middle.
GRID = (33, 25)
SCENES = {
    "light beside the view": (dict, 64),
    "light in view": (lambda: camera((-2.5, -2.2, 0.3), (0.9, 0.7, 1.9)), 64),
    "looking away": (lambda: camera((0.9, -4.7, 1.9), (0.9, -9.7, 1.9)), 64),
    "camera close to the light": (lambda: camera((0.9, 0.7001, 1.9), (0, 0, 0.9)), 64),
    "camera in shadow": (lambda: camera((-0.5, -0.5, 0.1), (2, 1.5, 0.9)), 64),
    "fence": (fence, 256),
    "spot in view": (lambda: {"lamp": spot()} | camera((-2.5, -2.2, 0.3), (0.5, 0.0, 1.5)), 64),
    "soft spot": (lambda: {"lamp": spot(cutoff=37.0, beam=19.0)}, 64),
    "colour, HG": (lambda: {"fog": coloured_fog()}, 64),
    "three lights": (lambda: {"second": lamp(-1, 1.4, 0.6), "third": spot(beam=11.0)}, 64),
    "along a column of texels": (
        lambda: camera((0, -4, 2), (0, 0, 2), size=GRID) | {"lamp": lamp(0, 0, 2.5)},
        16,
    ),
    "along diagonals": (
        lambda: camera((-3, -3, 2), (0, 0, 2), size=GRID) | {"lamp": lamp(0, 0, 2.5)},
        4,
    ),
}


def loaded_scene(name="light beside the view", **changes):
    return mi.load_dict(tiny_scene(size=changes.pop("size", SIZE), **(SCENES[name][0]() | changes)))


def render_both(loaded, precision="single", **parameters):
    """Render the same height field, as published, by both methods."""
    return [
        render(loaded, method, precision=precision, **own, **parameters)
        for method, own in VOLUMES.items()
    ]


def differ(image, expected):
    """Return the largest difference, relative to the largest value."""
    return np.max(np.abs(image - expected)) / np.max(expected)


def twin_of(loaded, frame, size, precision="single", *, walls="slanted"):
    """Return the airlight of the map that a frame was rendered with, by another route."""
    scene = read(loaded, precision)
    maps = [cast_shadow_map(scene.geometry, light, size) for light in scene.lights]
    numbers = traced_walls(scene, maps) if walls == "upright" else None
    return oracle_airlight(read_reference(loaded), maps, distance=frame.distance, walls=numbers)
