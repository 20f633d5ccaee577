# SPDX-License-Identifier: BSD-3-Clause
"""Small scenes that hold what the built-in scenes lack, for checks of the checks.

`many-lights` has several lights, one of them a soft spot and one behind the camera, in coloured,
backward scattering fog. Each built-in scene has one light, without a soft edge and before the
camera, and no fog scatters backward. Only this scene can therefore reveal a fault in the formula
for soft spots or in the sum over lights.

`wide-lights`, in `WIDE_PROBES`, has area lights of each shape, black ones and one of material
`null`, some in view, before occluders. Plates before the disk hide the corners of a square around
it, whose light would nearly be that of the disk. Its reference takes many points of each light, so
it is tried with faults of such lights alone.

`sun` has a directional light on two bounded media, a box and a sphere of coloured fog,
with occluders before them.
"""

from typing import Any

import mitsuba as mi

from airlight.validation.scenes.parts import area_lamp, camera, fog, point_light


def many_lights() -> dict[str, Any]:
    """Return a sphere over a floor in coloured, backward scattering fog, with a soft
    spot and two point lights.
    """
    return {
        "type": "scene",
        "fog": fog((0.113, 0.149, 0.187), (0.91, 0.83, 0.74), {"type": "hg", "g": -0.41}),
        "sensor": camera((0.23, -4.13, 1.37), (0.11, 0.07, 0.83), fov=49.7, size=(48, 36)),
        "spot": {
            "type": "spot",
            "to_world": mi.ScalarTransform4f().look_at(
                [0.73, -0.31, 3.17], [0.13, 0.11, 0.43], [0, 1, 0]
            ),
            "cutoff_angle": 37.3,
            "beam_width": 11.9,
            "intensity": {"type": "rgb", "value": [31.0, 27.0, 29.0]},
        },
        "lamp": point_light((-1.37, 1.29, 2.03), (7.3, 8.9, 6.1)),
        "behind": point_light((0.83, -5.39, 2.11), (13.7, 11.3, 12.9)),
        "sphere": {
            "type": "sphere",
            "center": [0.17, 0.13, 0.79],
            "radius": 0.43,
            "bsdf": {
                "type": "diffuse",
                "reflectance": {"type": "rgb", "value": [0.61, 0.53, 0.37]},
            },
        },
        "floor": {
            "type": "rectangle",
            "to_world": mi.ScalarTransform4f().scale(7.1),
            "bsdf": {
                "type": "diffuse",
                "reflectance": {"type": "rgb", "value": [0.41, 0.43, 0.53]},
            },
        },
    }


def sun() -> dict[str, Any]:
    """Return a slab and a sphere that shadow two bounded media, a box and a sphere,
    under a directional light.
    """
    transform = mi.ScalarTransform4f()
    grey = {"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.43, 0.47, 0.53]}}
    clear = {"type": "null"}
    return {
        "type": "scene",
        "sensor": camera(
            (0.31, -4.07, 1.43), (0.07, 0.11, 0.73), fov=41.3, size=(48, 36), in_fog=False
        ),
        "sun": {
            "type": "directional",
            "direction": [0.613, 0.371, -0.697],
            "irradiance": {"type": "rgb", "value": [19.3, 17.1, 14.7]},
        },
        "box": {
            "type": "cube",
            "to_world": transform.translate([-0.57, 0.17, 0.67])
            .rotate([0.1, 0.2, 1], 17)
            .scale([0.37, 0.53, 0.47]),
            "bsdf": clear,
            "interior": fog((0.71, 0.97, 1.31), (0.93, 0.84, 0.71), {"type": "hg", "g": 0.43})
            | {"id": "in-box"},
        },
        "pearl": {
            "type": "sphere",
            "center": [0.61, 0.13, 0.59],
            "radius": 0.49,
            "bsdf": clear,
            "interior": fog((1.37, 1.13, 0.83), (0.67, 0.79, 0.91), {"type": "hg", "g": -0.29})
            | {"id": "in-pearl"},
        },
        "slab": {
            "type": "cube",
            "to_world": transform.translate([-1.13, -0.11, 1.43])
            .rotate([0, 0, 1], 31)
            .scale([0.19, 0.23, 0.037]),
            "bsdf": grey,
        },
        "sphere": {"type": "sphere", "center": [-0.19, -0.27, 1.31], "radius": 0.17, "bsdf": grey},
        "floor": {"type": "rectangle", "to_world": transform.scale(7.1), "bsdf": grey},
    }


def wide_lights() -> dict[str, Any]:
    """Return a rectangle, a disk and a sphere of constant radiance about a box over
    a floor, in forward fog.
    """
    transform = mi.ScalarTransform4f()
    grey = {"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.43, 0.47, 0.53]}}
    panel = area_lamp(
        "rectangle", (0.93, 0.61, 2.07), (0.17, 0.13, 0.31), (0.43, 0.27), (5.3, 4.7, 3.9)
    )
    disk = area_lamp("disk", (-0.57, -1.61, 1.33), (-0.31, 1.07, 0.83), 0.37, (7.1, 6.3, 5.9))
    ball = area_lamp("sphere", (0.31, -0.41, 1.67), (0.0, 0.0, 0.0), 0.19, (6.7, 7.3, 8.9))
    # Plates before what a square around the disk would have more than the disk: they hide
    # its corners, not the disk.
    corners = {
        f"plate-{turn}": {
            "type": "rectangle",
            "to_world": disk["to_world"]
            @ transform.rotate([0, 0, 1], turn).translate([1.24, 0, 0.027]).scale([0.22, 0.47, 1]),
            "bsdf": grey,
        }
        for turn in (45, 135, 225, 315)
    }
    return {
        "type": "scene",
        "fog": fog(0.173, (0.91, 0.83, 0.74), {"type": "hg", "g": 0.41}),
        "sensor": camera((0.23, -4.13, 1.37), (0.11, 0.07, 0.93), fov=49.7, size=(24, 18)),
        "panel": panel,
        "disk": disk | {"material": {"type": "null"}},
        **corners,
        "ball": ball,
        "box": {
            "type": "cube",
            "to_world": transform.translate([0.37, 0.29, 0.83])
            .rotate([0.1, 0.2, 1], 23)
            .scale([0.29, 0.23, 0.31]),
            "bsdf": grey,
        },
        "floor": {"type": "rectangle", "to_world": transform.scale(7.1), "bsdf": grey},
    }


#: Scenes of this module by name, as in `validation.scenes.registry.SCENES`.
PROBES = {"many-lights": many_lights, "sun": sun}
#: The same of area lights.
WIDE_PROBES = {"wide-lights": wide_lights}
