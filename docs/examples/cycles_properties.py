# SPDX-License-Identifier: BSD-3-Clause
"""The description of a scene as properties of `bpy`, Blender's module: all that Cycles
needs besides the meshes.

`render_cycles.py` creates what is listed here and assigns the properties by their names.
Blender 5.0.1 was tried.
"""

import math
from typing import Any

import numpy as np

#: Properties of the scene: one scattering or reflection, no limit on values, means
#: over pixels, linear values.
_SCENE: dict[str, Any] = {
    "render.engine": "CYCLES",
    "unit_settings.scale_length": 1.0,
    "cycles.max_bounces": 0,  # counted after the first scattering or reflection
    "cycles.diffuse_bounces": 0,
    "cycles.volume_bounces": 0,
    # the bounds of media are crossed as transparent surfaces
    "cycles.transparent_max_bounces": 1024,
    "cycles.sample_clamp_direct": 0.0,
    "cycles.sample_clamp_indirect": 0.0,
    "cycles.light_sampling_threshold": 0.0,
    "cycles.use_adaptive_sampling": False,
    "cycles.use_denoising": False,
    "cycles.film_exposure": 1.0,
    "cycles.pixel_filter_type": "BOX",
    "render.film_transparent": False,
    "render.use_motion_blur": False,
    "render.use_border": False,
    "render.resolution_percentage": 100,
    "render.pixel_aspect_x": 1.0,
    "render.pixel_aspect_y": 1.0,
    "display_settings.display_device": "sRGB",
    "view_settings.view_transform": "Raw",
    "view_settings.look": "None",
    "view_settings.exposure": 0.0,
    "view_settings.gamma": 1.0,
}
#: Properties of the rendered file.
_FILE = {"file_format": "OPEN_EXR", "color_mode": "RGB", "color_depth": "32", "exr_codec": "ZIP"}
_LAYERED_FILE = {"media_type": "MULTI_LAYER_IMAGE", "color_depth": "32", "exr_codec": "ZIP"}
_PHASES = {"isotropic": "HENYEY_GREENSTEIN", "hg": "HENYEY_GREENSTEIN", "rayleigh": "RAYLEIGH"}
_KINDS = {"point": "POINT", "spot": "SPOT", "directional": "SUN"}


def cycles_properties(described: dict[str, Any]) -> dict[str, Any]:
    """Return the objects to create in Blender and the properties to assign, from a
    description by `describe_scene`.

    `scene`, `image_settings` and `layered_image_settings` are properties by name. `camera` and each
    of `lights` have `data` (properties) and `matrix_world` (4 x 4, rows); lights also `type`.
    `world` and each of `media`, by mesh, have `phase` and `inputs` of a node "Volume Coefficients",
    None where there is no medium. `materials`, by mesh, have `inputs` of a node "Diffuse BSDF" and
    say whether it is `two_sided`, black from behind otherwise. `objects` are properties of every
    mesh, and `turn` is the matrix (4 x 4, rows) that brings a mesh of the glTF file, as Blender
    imports it, back to the axes of the scene. What Cycles does not have is a dictionary with
    `cannot`, the reason in words.
    """
    camera = described["camera"]
    width, height = camera["size"]
    return {
        "scene": _SCENE | {"render.resolution_x": width, "render.resolution_y": height},
        "image_settings": _FILE,
        "layered_image_settings": _LAYERED_FILE,
        "camera": {
            "data": {
                "type": "PERSP",
                "sensor_fit": "HORIZONTAL",
                "angle": math.radians(camera["fov_horizontal"]),
                "shift_x": 0.0,
                "shift_y": 0.0,
                "clip_start": 1e-6,  # Blender's own, 0.1 m, takes away the medium before it
                "clip_end": 1e6,
                "dof.use_dof": False,
            },
            # Blender's cameras look along -z, with y up in the image.
            "matrix_world": _matrix(
                camera["right"], camera["up"], _negative(camera["forward"]), camera["position"]
            ),
        },
        "lights": [_light(light) for light in described["lights"]],
        "world": _world(described),
        "media": {bounded["name"]: _volume(bounded) for bounded in described["bounded_media"]},
        "materials": {surface["name"]: _material(surface) for surface in described["surfaces"]},
        "objects": {
            "cycles.shadow_terminator_offset": 0.0,
            "cycles.shadow_terminator_geometry_offset": 0.0,
        },
        "turn": _turn(described["up"]),
    }


def _turn(up: str) -> list[list[float]]:
    """Return the matrix from Blender's axes to those of the scene: a glTF file has y for what is up
    in the scene, and Blender turns its y to z.
    """
    upwards = np.eye(3)["xyz".index(up[-1])] * (-1 if up.startswith("-") else 1)
    right = {"x": (0, -1, 0), "-x": (0, 1, 0)}.get(up, (1, 0, 0))
    return _matrix(right, np.cross(upwards, right), upwards, (0, 0, 0))


def _light(light: dict[str, Any]) -> dict[str, Any]:
    """Return a light; its power is that of a point light as bright in all
    directions as on its axis.
    """
    if light["kind"] == "area":
        return {"cannot": "area lights were not tried in Cycles"}
    if light["kind"] == "spot" and light["beam_angle"] < light["cutoff_angle"]:
        return {"cannot": "the edge of Blender's spots is another function of the angle"}
    # Blender would take 1 degree in its place, and not say so.
    if light["kind"] == "spot" and 2 * light["cutoff_angle"] < 1:
        return {"cannot": "Blender's spots are at least a degree wide"}
    directional = light["kind"] == "directional"
    values = light["irradiance" if directional else "intensity"]
    brightest = max(values)
    data: dict[str, Any] = {
        "color": [value / brightest if brightest > 0 else 1.0 for value in values],
        "exposure": 0.0,
        "energy": brightest if directional else 4 * math.pi * brightest,
        "normalize": True,
    }
    if directional:
        data["angle"] = 0.0
    else:
        data |= {"shadow_soft_size": 0.0, "use_soft_falloff": False}
    if light["kind"] == "spot":
        # the whole angle
        data |= {"spot_size": 2 * math.radians(light["cutoff_angle"]), "spot_blend": 0.0}
    backward = _negative(light.get("axis", (0.0, 0.0, -1.0)))
    side = np.cross(backward, np.eye(3)[int(np.argmin(np.abs(backward)))])
    side /= np.linalg.norm(side)
    place = light.get("position", (0.0, 0.0, 0.0))
    matrix = _matrix(side.tolist(), np.cross(backward, side).tolist(), backward, place)
    return {"type": _KINDS[light["kind"]], "data": data, "matrix_world": matrix}


def _world(described: dict[str, Any]) -> dict[str, Any] | None:
    """Return the medium of all space, None for a vacuum."""
    medium = described["medium"]
    if described.get("sky") is not None:
        return {"cannot": "the light of a sky was not tried"}
    if medium is not None and described["bounded_media"] and any(medium["sigma_t"]):
        return {"cannot": "volumes of Blender add up: the fog around would fill bounded media too"}
    return None if medium is None else _volume(medium)


def _volume(medium: dict[str, Any]) -> dict[str, Any]:
    """Return a homogeneous medium by sigma_s and sigma_a [1/m], which no colour picker touches."""
    phase = medium["phase"]
    if "sigma_s" not in medium:
        return {"cannot": "height fog and grids were not tried in Cycles"}
    if phase["name"] not in _PHASES:
        return {"cannot": f"Cycles has no {phase['name']} phase function"}
    inputs = {
        "Scatter Coefficients": medium["sigma_s"],
        "Absorption Coefficients": medium["sigma_a"],
    }
    if phase["name"] != "rayleigh":
        inputs["Anisotropy"] = phase.get("g", 0.0)  # g > 0 scatters forward
    return {"phase": _PHASES[phase["name"]], "inputs": inputs}


def _material(surface: dict[str, Any]) -> dict[str, Any]:
    if surface["textured"] or not surface["diffuse"]:
        return {"cannot": "a surface with one colour that is diffuse is needed"}
    return {
        "inputs": {"Color": [*surface["reflectance"], 1.0], "Roughness": 0.0},
        "two_sided": surface["two_sided"],
    }


def _negative(vector: Any) -> list[float]:
    return [-float(value) + 0.0 for value in vector]


def _matrix(x: Any, y: Any, z: Any, place: Any) -> list[list[float]]:
    """Return the rows of the matrix whose columns are three axes and a place."""
    return [[float(x[i]), float(y[i]), float(z[i]), float(place[i])] for i in range(3)] + [
        [0.0, 0.0, 0.0, 1.0]
    ]
