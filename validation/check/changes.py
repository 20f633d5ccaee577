# SPDX-License-Identifier: BSD-3-Clause
"""Changes of a scene that change nothing of its image, or scale it: descriptions of
built-in scenes, changed.

A description is the dictionary that `mi.load_dict` takes. Meshes in it are Mitsuba's, and are
changed in place: each change builds its scene again.
"""

from collections.abc import Callable, Sequence
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from airlight.errors import InputError
from airlight.validation.scenes.meshes import box, placed
from airlight.validation.scenes.parts import medium_boundary, mitsuba_mesh
from airlight.validation.scenes.registry import SCENES

Array = NDArray[np.float64]
Description = dict[str, Any]

SIZE = (16, 12)  # of the images [pixels]
#: How far behind the camera a speck is, and how large [m]: out of sight, and as small as dust.
FAR, DUST = 64.0, 0.002
_LIGHTS = ("point", "spot", "directional", "constant")
_POWERS = ("intensity", "irradiance", "radiance")
_ENDS = ("scale", "value")  # of parameters of meshes that are numbers or colours
_CAMERA_LIKE = ("perspective", "spot")  # what has a place and a direction, and no size


def description(name: str, size: tuple[int, int] = SIZE) -> Description:
    """Return a built-in scene with an image of a size, a small one by default.

    Raises InputError for another scene: what a file holds cannot be changed as a whole.
    """
    if name not in SCENES:
        raise InputError(f"{name}: expected a built-in scene, which can be changed as a whole")
    scene: Description = dict(SCENES[name].build())
    scene["sensor"]["film"] |= {"width": size[0], "height": size[1]}
    return scene


def lights(scene: Description) -> list[str]:
    """Return the names of the lights of a scene; an area light has the name of its shape."""
    parts = {name: part for name, part in scene.items() if isinstance(part, dict)}
    return [name for name, part in parts.items() if part["type"] in _LIGHTS or "emitter" in part]


def only(scene: Description, names: Sequence[str]) -> Description:
    """Return a scene with these lights alone; other area lights stay where
    they are, and send nothing.
    """
    dark = set(lights(scene)) - set(names)
    kept = {name: part for name, part in scene.items() if name not in dark or "emitter" in part}
    for name in dark & kept.keys():
        kept[name] = _brighter(kept[name], 0.0)
    return kept


def brighter(scene: Description, factor: float) -> Description:
    """Return a scene whose lights send so many times as much light."""
    names = lights(scene)
    return {
        name: _brighter(part, factor) if name in names else part for name, part in scene.items()
    }


def _brighter(part: Description, factor: float) -> Description:
    part = dict(part)
    for key in part.keys() & {*_POWERS}:
        part[key] = {"type": "rgb", "value": [factor * value for value in part[key]["value"]]}
    if "emitter" in part:
        part["emitter"] = _brighter(part["emitter"], factor)
    return part


def dark(light: Description) -> Description:
    """Return a light that sends nothing."""
    return _brighter(light, 0.0)


def larger(scene: Description, factor: float) -> Description:
    """Return a scene with all lengths times a factor that looks the same: irradiance
    and optical depths stay.
    """
    scene = moved(scene, np.diag([factor, factor, factor, 1.0]))
    return {
        name: _brighter(part, factor**2) if isinstance(part, dict) and "intensity" in part else part
        for name, part in scene.items()
    }


def moved(scene: Description, matrix: Array) -> Description:
    """Return a scene moved, turned and scaled with its camera by a matrix, (4, 4) [m].

    An extinction is a number by length, and scales with the lengths.
    """
    return {name: _moved(part, matrix, _scale(matrix)) for name, part in scene.items()}


def _scale(matrix: Array) -> float:
    return float(np.cbrt(np.linalg.det(matrix[:3, :3])))


def _moved(part: Any, matrix: Array, scale: float) -> Any:
    if isinstance(part, mi.Mesh):
        return _moved_mesh(part, matrix, scale)
    if not isinstance(part, dict):
        return part
    part = {key: _moved(value, matrix, scale) for key, value in part.items()}
    if "position" in part:
        part["position"] = list(matrix[:3, :3] @ part["position"] + matrix[:3, 3])
    if "direction" in part:
        part["direction"] = list(matrix[:3, :3] @ part["direction"] / scale)
    if "to_world" in part:
        place = matrix @ np.array(part["to_world"].matrix, dtype=np.float64)
        if part["type"] in _CAMERA_LIKE:
            place[:3, :3] /= scale
        part["to_world"] = mi.ScalarTransform4f(place)
    for clip in part.keys() & {"near_clip", "far_clip"}:
        part[clip] *= scale
    if part.get("type") == "heightfog":
        return _moved_layers(part, float(matrix[2, 3]), scale)
    if _has_scale(part):
        part["scale"] = part.get("scale", 1.0) / scale
    return part


def _moved_layers(fog: Description, up: float, scale: float) -> Description:
    """Return layers of height fog moved up: sigma is by length, z a height, H a length."""
    for key in fog.keys() - {"type", "to_world"}:
        factor = 1 / scale if key.startswith("sigma") else scale
        fog[key] = factor * fog[key] + (up if key.startswith("z") else 0.0)
    return fog


def _moved_mesh(mesh: Any, matrix: Array, scale: float) -> Any:
    parameters = mi.traverse(mesh)
    points = np.reshape(parameters["vertex_positions"], (-1, 3)).astype(np.float64)
    points = points @ matrix[:3, :3].T + matrix[:3, 3]
    medium = mesh.interior_medium()
    if medium is not None and medium.class_name() == "HeterogeneousMedium":
        corners = np.reshape(parameters["faces"], (-1, 3))
        return medium_boundary(mesh.id(), (points, corners), _moved_grid(medium, matrix, scale))
    parameters["vertex_positions"] = mi.Float(points.astype(np.float32).ravel())
    parameters.update()
    if medium is not None:
        inside = mi.traverse(medium)
        inside["scale"] = float(inside["scale"]) / scale
        inside.update()
    return mesh


def _moved_grid(medium: Any, matrix: Array, scale: float) -> Description:
    """Return a medium of a density grid, moved: the place of a grid is no parameter, and it is made
    again. Those of built-in scenes lie along the axes, and belong to one shape.
    """
    inside = mi.traverse(medium)
    box = next(part for part in inside.hierarchy if part.class_name() == "GridVolume").bbox()
    low, high = (np.array(corner, dtype=np.float64).ravel() for corner in (box.min, box.max))
    place = np.diag([*(high - low), 1.0])
    place[:3, 3] = low
    return {
        "type": "heterogeneous",
        "sigma_t": {
            "type": "gridvolume",
            "grid": mi.VolumeGrid(np.array(inside["sigma_t.data"])),
            "to_world": mi.ScalarTransform4f(matrix @ place),
        },
        "scale": float(inside["scale"]) / scale,
        "has_spectral_extinction": medium.has_spectral_extinction(),
        "albedo": {"type": "rgb", "value": np.ravel(inside["albedo.value.value"]).tolist()},
        "phase": medium.phase_function(),
    }


def behind_camera(scene: Description, distance: float) -> Array:
    """Return the place so far behind the camera [m]."""
    place = np.array(scene["sensor"]["to_world"].matrix, dtype=np.float64)
    return place[:3, 3] - distance * place[:3, 2]


def with_speck(scene: Description) -> Description:
    """Return a scene with a speck far behind the camera, whose shadow falls nowhere in view."""
    speck = placed(box((DUST, DUST, DUST)), behind_camera(scene, FAR))
    return scene | {"speck": mitsuba_mesh("speck", speck, (0.5, 0.5, 0.5))}


def with_body(scene: Description, distance: float) -> Description:
    """Return a scene with a body of fog so far behind the camera, where no ray comes."""
    body = placed(box((1.7, 1.3, 1.1)), behind_camera(scene, distance))
    fog = {"type": "homogeneous", "sigma_t": 0.3, "albedo": 0.5}
    return scene | {"aside": medium_boundary("aside", body, fog)}


def another_light(scene: Description) -> Description:
    """Return a light beside those of a scene: a sun where there is one,
    a lamp in view elsewhere.
    """
    if any(scene[name]["type"] == "directional" for name in lights(scene)):
        irradiance = {"type": "rgb", "value": [2.0, 1.0, 3.0]}
        return {"type": "directional", "direction": [0.3, 0.5, -0.8], "irradiance": irradiance}
    axes = np.array(scene["sensor"]["to_world"].matrix, dtype=np.float64)
    place = axes[:3] @ (0.31, 0.57, 1.13, 1.0)
    intensity = {"type": "rgb", "value": [20.0, 10.0, 30.0]}
    return {"type": "point", "position": list(place), "intensity": intensity}


def turned(scene: Description, angle: float) -> Description:
    """Return a scene whose camera is turned about its own up, to the right [degrees]."""
    sensor = dict(scene["sensor"])
    sensor["to_world"] = sensor["to_world"] @ mi.ScalarTransform4f().rotate([0, 1, 0], -angle)
    return scene | {"sensor": sensor}


def denser(scene: Description, factor: float) -> Description:
    """Return a scene whose media are so many times as dense."""

    def dense(part: Any) -> Any:
        if isinstance(part, mi.Mesh):
            return _with_values(part, part.interior_medium(), "scale", lambda value: factor * value)
        if part.get("type") == "heightfog":
            return {k: factor * v if k.startswith("sigma") else v for k, v in part.items()}
        return part | {"scale": factor * part.get("scale", 1.0)} if _has_scale(part) else part

    return _everywhere(scene, dense)


def _has_scale(part: Description) -> bool:
    """Return whether a description is of a medium whose density its scale multiplies."""
    sigma_t = part.get("sigma_t")
    return sigma_t is not None and not (
        isinstance(sigma_t, dict) and sigma_t["type"] == "heightfog"
    )


def paler(scene: Description, factor: float) -> Description:
    """Return a scene whose media scatter so many times as much, at one extinction."""

    def pale(part: Any) -> Any:
        if isinstance(part, mi.Mesh):
            return _with_values(part, part.interior_medium(), "albedo", lambda v: factor * v)
        if "albedo" not in part:
            return part
        albedo = part["albedo"]
        if isinstance(albedo, dict):
            return part | {"albedo": albedo | {"value": [factor * v for v in albedo["value"]]}}
        return part | {"albedo": factor * albedo}

    return _everywhere(scene, pale)


def permuted(scene: Description, order: Sequence[int]) -> Description:
    """Return a scene whose colours are permuted, those of lights, media and surfaces."""

    def other(part: Any) -> Any:
        if isinstance(part, mi.Mesh):
            return _with_values(part, part, "", lambda v: v[list(order)] if len(v) == 3 else v)
        if part.get("type") == "rgb" and np.size(part["value"]) == 3:
            return part | {"value": [part["value"][number] for number in order]}
        return part

    return _everywhere(scene, other)


def _everywhere(part: Any, change: Callable[[Any], Any]) -> Any:
    """Return a description with all its dictionaries and meshes changed, the inner ones first."""
    if isinstance(part, mi.Mesh):
        return change(part)
    if not isinstance(part, dict):
        return part
    return change({key: _everywhere(value, change) for key, value in part.items()})


def _with_values(mesh: Any, inside: Any, begins: str, change: Callable[[Array], Array]) -> Any:
    """Return a mesh in which the numbers and colours of itself or of its medium, `inside`, are
    changed whose names begin so; None for no medium.
    """
    if inside is None:
        return mesh
    parameters = mi.traverse(inside)
    for key in list(parameters.keys()):
        if not key.startswith(begins) or not key.endswith(_ENDS):
            continue
        old = parameters[key]
        new = change(np.ravel(old).astype(np.float64)).tolist()
        parameters[key] = new[0] if isinstance(old, float) else type(old)(*new)
    parameters.update()
    return mesh
