# SPDX-License-Identifier: BSD-3-Clause
import mitsuba as mi
import numpy as np

from realtime.scene.animate import coloured_light, turned_light
from realtime.scene.read_scene import read_scene
from tests.helpers.clouds import cloud, cloud_scene, ring
from validation.scenes.meshes import rotation


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
    """The scene with a light of each kind, read anew with all of them turned and coloured; a sky does not turn."""

    def world(first, second):
        about = mi.ScalarTransform4f().translate([0.1, 0.2, 0]).rotate([0, 0, 1], turn).translate([-0.1, -0.2, 0])
        return about @ mi.ScalarTransform4f().look_at(first, second, [0, 1, 0])

    def rgb():
        return {"type": "rgb", "value": colour}

    lights = {
        "point": {"type": "point", "to_world": world([0.9, 0.7, 190.0], [0, 0, 0]), "intensity": rgb()},
        "soft": {
            "type": "spot",
            "to_world": world([7.1, -3.0, 260.0], [0.1, 0.1, 0.4]),
            "cutoff_angle": 33.0,
            "beam_width": 21.0,
            "intensity": rgb(),
        },
        "sun": {"type": "directional", "to_world": world([0, 0, 0], [0.7, -0.3, -0.6]), "irradiance": rgb()},
        "sky": {"type": "constant", "radiance": rgb()},
    }
    # A sky beside a lamp is a background, which lights nothing.
    scenes = [{name: lights[name] for name in names} for names in (("point", "soft"), ("sun", "sky"))]
    built = [mi.load_dict(cloud_scene(ring=cloud("ring", ring()), **each)) for each in scenes]
    return [light for scene in built for light in read_scene(scene).lights]


def test_moved_lights_of_every_kind_are_those_of_the_scene_read_anew(variant):
    colour = [3.0, 2.0, 0.5]
    before = in_sun_and_sky(0.0, colour)
    assert {light.kind for light in before} == {"point", "spot", "directional"}
    assert sum(light.sky is not None for light in before) == 1
    turned, coloured = in_sun_and_sky(71.0, colour), in_sun_and_sky(0.0, [0.5, 3.0, 2.0])
    for old, after, other in zip(before, turned, coloured, strict=True):
        by_turn = leaves(turned_light(old, np.array([0.1, 0.2, 0.0]), rotation((0, 0, 1), 71.0)))
        for moved, anew in ((by_turn, leaves(after)), (leaves(coloured_light(old, 1 / 3)), leaves(other))):
            assert moved.keys() == anew.keys()
            for name, values in anew.items():
                if not name.endswith("_low"):  # what float32 took from the other part, which may round the other way
                    # float32, and Mitsuba's matrices, which have a few roundings of their own.
                    np.testing.assert_allclose(
                        moved[name], values, rtol=1e-5, atol=3e-6 * abs(values).max(), err_msg=name
                    )
