# SPDX-License-Identifier: BSD-3-Clause
"""The camera of a file: cameras that no command takes are refused, and notes say which parts of
Mitsuba's own images the clip planes cut off.

Rays of Mitsuba's camera start at its near plane and end at its far plane. The medium between the
pinhole and the near plane scatters light into the eye all the same, and a far plane is no wall:
references and methods leave nothing out.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import mitsuba as mi
import numpy as np

from airlight.errors import InputError
from airlight.reference.scene.camera import camera_matrix
from airlight.reference.scene.varying import is_grid

Lens = Mapping[str, float | str]  #: what a description says of a camera's angle of view

_USUAL_NEAR = 1e-2  # Mitsuba's near plane [m] where the file gives none


def check_camera(props: mi.Properties) -> None:
    """Refuse a camera that is no pinhole, by its properties in the file."""
    name = f"camera '{props.id()}'"
    if props.plugin_name() != "perspective":
        raise InputError(
            f"{name} is of type '{props.plugin_name()}'; expected a sensor of type 'perspective', "
            "a pinhole: replace it"
        )
    for axis in "xy":
        key = f"principal_point_offset_{axis}"
        if key in props and float(props[key]):
            raise InputError(f"{name} has {key} = {float(props[key]):g}; expected none: remove it")


def lens_of(camera: mi.Properties | Mapping[str, Any]) -> Lens:
    """Return what a description says of the angle of view of a perspective camera."""
    names = ("fov", "fov_axis") if "fov" in camera else ("focal_length",)
    return {name: camera[name] for name in names if name in camera}


def x_fov(lens: Lens, size: tuple[int, int]) -> mi.Float:
    """Return the horizontal angle of view [degrees] that Mitsuba gives a lens at a size [pixels]:
    it depends on the aspect where the lens says an angle along another axis.
    """
    film = {"type": "hdrfilm", "width": size[0], "height": size[1]}
    return mi.traverse(mi.load_dict({"type": "perspective", **lens, "film": film}))["x_fov"]


def clip_notes(scene: mi.Scene) -> list[str]:
    """Return a note where the clip planes of the camera take something away
    from Mitsuba's own image.
    """
    if not scene.sensors():
        return []
    sensor = scene.sensors()[0]
    near, far = (float(mi.traverse(sensor)[key]) for key in ("near_clip", "far_clip"))
    # Optical depths of a medium around the camera; a box of fog around it ends within the box of
    # all shapes, and a density grid at its own.
    medium, matrix, boxes = sensor.get_medium(), camera_matrix(sensor), [scene.bbox()]
    unbounded = medium is not None and all(
        shape.interior_medium() != medium for shape in scene.shapes()
    )
    before = beyond = ""
    parameters = mi.traverse(medium) if medium is not None else {}
    if medium is not None and is_grid(medium):
        parts = mi.traverse(medium).hierarchy
        boxes.append(next(each for each in parts if each.class_name() == "GridVolume").bbox())
        unbounded = False
    # Depths of all shapes and of a grid along the camera's axis, by the corners of their boxes.
    depth = np.empty(0)
    for box in boxes:
        span = np.array([np.ravel(box.min), np.ravel(box.max)], dtype=np.float64)
        if np.all(np.isfinite(span)):  # else empty, or a place that `check_numbers` refuses
            corners = np.array(np.meshgrid(*span.T)).reshape(3, -1).T
            depth = np.append(depth, (corners - matrix[:3, 3]) @ matrix[:3, 2])
    if "sigma_t.value.value" in parameters:
        sigma_t = float(np.min(parameters["sigma_t.value.value"]) * parameters["scale"])
        if sigma_t > 0:
            before, beyond = (
                f" (an optical depth of {sigma_t * length:.3g})" for length in (near, far)
            )
        # Beyond an optical depth of 17 the light is lost in the rounding of float32:
        # exp(-17) = 2^-24.
        unbounded &= sigma_t * far < 17.0
    # The near plane cuts scattered light wherever there is a medium, and shapes wherever they are
    # nearer than it; the far plane cuts the medium only if that is not opaque before it.
    cuts_near = near > _USUAL_NEAR and (medium is not None or np.min(depth, initial=np.inf) < near)
    cuts_far = bool(unbounded or np.max(depth, initial=-np.inf) > far)
    lacks = [f"what is nearer than near_clip, {near:g} m{before}"] if cuts_near else []
    lacks += [f"what is beyond far_clip, {far:g} m{beyond}"] if cuts_far else []
    if not lacks:
        return []
    # A model has no fog outside of them; shapes there stay in its image.
    ends = f"planes:{near if cuts_near else 0.0:g}:{far if cuts_far else np.inf:g}"
    return [
        f"camera '{sensor.id()}': its clip planes are not used; Mitsuba's own image lacks "
        f"{'; and '.join(lacks)}: to compare with it, move them there, or leave out the fog there by "
        f"--model ends={ends}"
    ]
