# SPDX-License-Identifier: BSD-3-Clause
"""Cameras, lights, media and phase functions that no command takes, refused by id and by Mitsuba's own word."""

from typing import Any

from analytic.errors import InputError
from validation.scenes.files.nodes import of_kind, properties, references

_TAKEN = {
    "Emitter": ("point", "spot", "directional", "area", "constant", "envmap"),
    "Medium": ("homogeneous", "heterogeneous"),
    "PhaseFunction": ("isotropic", "hg", "rayleigh", "tabphase"),
}
_WORDS = {"Emitter": "light", "Medium": "medium", "PhaseFunction": "phase function"}
_COLOURS = {"point": "intensity", "spot": "intensity", "directional": "irradiance", "area": "radiance"}
_TEXTURES = ("bitmap", "checkerboard", "mesh_attribute", "volume")


def check_kinds(state: Any) -> None:
    """Refuse what no command takes."""
    for kind, taken in _TAKEN.items():
        for index in of_kind(state, kind):
            props = properties(state, index)
            if props.plugin_name() not in taken:
                name = f"{_WORDS[kind]} '{props.id()}'" if props.id() else f"a {_WORDS[kind]} of the scene"
                raise InputError(
                    f"{name} is of type '{props.plugin_name()}'; wanted one of {', '.join(taken)}: replace it"
                    + " or remove it" * (kind == "Emitter")
                )
    for index in of_kind(state, "Emitter"):
        _check_light(state, index)
    sensors = of_kind(state, "Sensor")
    if sensors:
        _check_camera(properties(state, sensors[0]))


def _check_camera(props: Any) -> None:
    name = f"camera '{props.id()}'"
    if props.plugin_name() != "perspective":
        raise InputError(
            f"{name} is of type '{props.plugin_name()}'; wanted a sensor of type 'perspective', a pinhole: replace it"
        )
    for axis in "xy":
        key = f"principal_point_offset_{axis}"
        if key in props and float(props[key]):
            raise InputError(f"{name} has {key} = {float(props[key]):g}; wanted none: remove it")


def _check_light(state: Any, index: int) -> None:
    props = properties(state, index)
    name = f"light '{props.id()}'"
    wanted = _COLOURS.get(props.plugin_name())
    for key, at in references(props):
        textured = properties(state, at).plugin_name() in _TEXTURES
        if key == "texture" or (key == wanted and textured):
            raise InputError(
                f"{name}, of type '{props.plugin_name()}', has a texture as {key}; wanted one colour: remove the "
                "texture, or give its mean as 'rgb'"
            )
