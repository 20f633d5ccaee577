# SPDX-License-Identifier: BSD-3-Clause
"""Small scenes that tests share; arbitrary numbers, each field can be replaced."""

from typing import Any

import mitsuba as mi


def tiny_scene(*, size=(16, 12), **changes: Any) -> dict[str, Any]:
    """Return a sphere over a floor in fog, lit by a point light; `changes` replace or
    (with None) remove entries.
    """
    scene: dict[str, Any] = {
        "type": "scene",
        "fog": {
            "type": "homogeneous",
            "id": "fog",
            "sigma_t": 0.31,
            "albedo": {"type": "rgb", "value": [0.9, 0.8, 0.7]},
            "has_spectral_extinction": False,
        },
        "sensor": {
            "type": "perspective",
            "fov": 49.0,
            "fov_axis": "x",
            "near_clip": 1e-4,
            "to_world": mi.ScalarTransform4f().look_at(
                [0.2, -4.1, 1.3], [0.1, 0.0, 0.6], [0, 0, 1]
            ),
            "medium": {"type": "ref", "id": "fog"},
            "film": {
                "type": "hdrfilm",
                "width": size[0],
                "height": size[1],
                "rfilter": {"type": "box"},
            },
        },
        "lamp": {
            "type": "point",
            "position": [0.9, 0.7, 1.9],
            "intensity": {"type": "rgb", "value": [5.0, 4.0, 3.0]},
        },
        "ball": {
            "type": "sphere",
            "center": [0.1, 0.1, 0.7],
            "radius": 0.41,
            "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.6, 0.5, 0.3]}},
        },
        "floor": {
            "type": "rectangle",
            "to_world": mi.ScalarTransform4f().scale(6.3),
            "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.4, 0.4, 0.5]}},
        },
    }
    scene |= changes
    return {name: entry for name, entry in scene.items() if entry is not None}


def spot(*, cutoff=33.0, beam=33.0) -> dict[str, Any]:
    """Return a spot light above the sphere."""
    return {
        "type": "spot",
        "to_world": mi.ScalarTransform4f().look_at([0.7, -0.3, 2.6], [0.1, 0.1, 0.4], [0, 1, 0]),
        "cutoff_angle": cutoff,
        "beam_width": beam,
        "intensity": {"type": "rgb", "value": [9.0, 7.0, 8.0]},
    }


def bounded_medium(
    shape: dict[str, Any], sigma_t: Any, albedo: tuple[float, float, float], **medium: Any
) -> dict[str, Any]:
    """Return a shape that lets light pass and is filled with a homogeneous medium;
    `sigma_t` is grey or RGB [1/m].
    """
    colour = not isinstance(sigma_t, float)
    inside = {
        "type": "homogeneous",
        "sigma_t": {"type": "rgb", "value": list(sigma_t)} if colour else sigma_t,
        "albedo": {"type": "rgb", "value": list(albedo)},
        "has_spectral_extinction": colour,
    }
    return shape | {"bsdf": {"type": "null"}, "interior": inside | medium}


def clear_scene(*, size=(16, 12), **changes: Any) -> dict[str, Any]:
    """Return the tiny scene without fog and without surfaces: a camera and a lamp in a vacuum."""
    scene = tiny_scene(size=size, fog=None, ball=None, floor=None)
    scene["sensor"] = {key: entry for key, entry in scene["sensor"].items() if key != "medium"}
    return {name: entry for name, entry in (scene | changes).items() if entry is not None}


LAMP = '<emitter type="point" id="lamp"><point name="position" value="0.7, 0.3, 1.9"/></emitter>'
FOG = '<float name="sigma_t" value="0.31"/><float name="albedo" value="0.83"/>'


def scene_xml(
    *parts: str, fog: str = FOG, size: tuple[int, int] = (32, 24), fov: float = 39.3
) -> str:
    """Return a scene file of a ball in fog under a lamp, or with `parts` instead of the lamp."""
    width, height = size
    return f"""<scene version="3.0.0"><medium type="homogeneous" id="fog">{fog}</medium>
<sensor type="perspective"><float name="fov" value="{fov}"/><ref name="medium" id="fog"/><transform name="to_world">
<lookat origin="0.2, -4.1, 1.3" target="0.1, 0, 0.6" up="0, 0, 1"/></transform>
<film type="hdrfilm"><integer name="width" value="{width}"/><integer name="height" value="{height}"/></film></sensor>
<shape type="sphere" id="ball"><float name="radius" value="0.4"/></shape>{"".join(parts or (LAMP,))}</scene>"""


def dense_box(sigma_t: float, size: tuple[int, int]) -> dict[str, Any]:
    """Return a box in thin fog that light enters through a skin: a metre is `sigma_t` mean free
    paths.
    """
    place = mi.ScalarTransform4f().translate([-0.8, 0.4, 0.7]).rotate([0.2, 0.3, 1], 31).scale(0.5)
    box = {"type": "cube", "to_world": place, "exterior": {"type": "ref", "id": "fog"}}
    return tiny_scene(size=size, floor=None, ball=bounded_medium(box, sigma_t, (0.9, 0.4, 0.3)))
