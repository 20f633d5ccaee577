# SPDX-License-Identifier: BSD-3-Clause
"""A small scene with everything in it that the built-in scenes lack, for checks of the checks.

The built-in scenes have one light each, none of them soft and none behind the camera; their fog is grey but for
`two-pens`, and forward scattering but for Rayleigh's symmetric law. What only such a scene can show, a formula for soft
spots or a sum over lights, is shown here.
"""

from typing import Any

from validation.scenes.parts import camera, fog, point_light


def many_lights() -> dict[str, Any]:
    """Return a ball over a floor in coloured, backward scattering fog under a soft spot, a lamp, and one behind."""
    import mitsuba as mi

    return {
        "type": "scene",
        "fog": fog((0.113, 0.149, 0.187), (0.91, 0.83, 0.74), {"type": "hg", "g": -0.41}),
        "sensor": camera((0.23, -4.13, 1.37), (0.11, 0.07, 0.83), fov=49.7, size=(48, 36)),
        "spot": {
            "type": "spot",
            "to_world": mi.ScalarTransform4f().look_at([0.73, -0.31, 3.17], [0.13, 0.11, 0.43], [0, 1, 0]),
            "cutoff_angle": 37.3,
            "beam_width": 11.9,
            "intensity": {"type": "rgb", "value": [31.0, 27.0, 29.0]},
        },
        "lamp": point_light((-1.37, 1.29, 2.03), (7.3, 8.9, 6.1)),
        "behind": point_light((0.83, -5.39, 2.11), (13.7, 11.3, 12.9)),
        "ball": {
            "type": "sphere",
            "center": [0.17, 0.13, 0.79],
            "radius": 0.43,
            "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.61, 0.53, 0.37]}},
        },
        "floor": {
            "type": "rectangle",
            "to_world": mi.ScalarTransform4f().scale(7.1),
            "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.41, 0.43, 0.53]}},
        },
    }


#: Scenes of this module by name, as in `validation.scenes.SCENES`.
PROBES = {"many-lights": many_lights}
