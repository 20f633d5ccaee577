# SPDX-License-Identifier: BSD-3-Clause
"""Cameras, lights and nodes of Blender, and their meaning for a Mitsuba scene; no adapter.

`to_mitsuba.py` asks this file. It takes things of `bpy` and does not import it. Nodes must be
constant: a value comes from an input itself, or from a node *Value* or *RGB*. All else raises
CannotError, whose words say what to do.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from mitsuba_parts import Array, CannotError, Lamp, Medium, camera_xml, coefficients, fov_x

#: Inputs of the nodes of volumes, by their kinds.
_VOLUMES = {
    "ShaderNodeVolumeCoefficients": ("Scatter Coefficients", "Absorption Coefficients"),
    "ShaderNodeVolumePrincipled": ("Color", "Density", "Absorption Color"),
    "ShaderNodeVolumeScatter": ("Color", "Density"),
    "ShaderNodeVolumeAbsorption": ("Color", "Density"),
}
#: Inputs of volumes that shine; they must be 0.
_SHINING = ("Emission Strength", "Blackbody Intensity", "Emission Coefficients")
_PHASES = {"HENYEY_GREENSTEIN": "hg", "RAYLEIGH": "rayleigh"}
_GREY = (0.8, 0.8, 0.8)  # reflectance of a mesh without a material, in Cycles
#: Inputs of a Principled BSDF: that must have these values, and that are left out but for 0.
_PLAIN = {"Alpha": 1, "Transmission Weight": 0, "Subsurface Weight": 0, "Emission Strength": 0}
_GLOSS = ("Specular IOR Level", "Metallic", "Coat Weight", "Sheen Weight", "Diffuse Roughness")


@dataclass(frozen=True)
class Surface:
    """A diffuse surface."""

    reflectance: Array  #: RGB
    two_sided: bool = True  #: else it is black from behind
    left: list[str] = field(default_factory=list)  #: what its material has beside it


@dataclass(frozen=True)
class Camera:
    """A camera, as `camera_xml` takes it."""

    name: str
    matrix: Array
    fov: float
    size: tuple[int, int]


def camera_of(scene: Any, name: str, unit: float) -> Camera:
    """Return the active camera of a scene; `unit` is the length of Blender's unit [m]."""
    render, lens = scene.render, scene.camera.data
    percent = render.resolution_percentage
    size = render.resolution_x * percent // 100, render.resolution_y * percent // 100
    _refuse(
        (lens.type != "PERSP", f"it is of the type {lens.type}; expected PERSP"),
        (lens.shift_x or lens.shift_y, "it has a Shift; expected 0"),
        (lens.dof.use_dof, "its Depth of Field is on; expected it off"),
        (render.pixel_aspect_x != render.pixel_aspect_y, "its pixels are no squares; expected 1:1"),
        (render.use_border, "its Render Region is on; expected it off"),
    )
    fov = fov_x(lens.lens, (lens.sensor_width, lens.sensor_height), lens.sensor_fit, size)
    made = Camera(name, in_metres(scene.camera.matrix_world, unit), fov, size)
    camera_xml(made.name, made.matrix, made.fov, made.size, None)  # refuses what it cannot say
    return made


def lamp_of(lamp: Any, matrix: Any, unit: float) -> Lamp:
    """Return a light by metres; `matrix` is that of its object, `unit` Blender's unit [m]."""
    cycles = getattr(lamp, "cycles", None)  # missing where the add-on is off
    _refuse(
        (lamp.energy < 0, "its power is below 0; expected 0 or more"),
        (not lamp.use_shadow, "its Shadow is off; expected it on"),
        (not lamp.normalize, "its Normalize is off; expected it on"),
        (lamp.diffuse_factor != 1, "its Diffuse factor for EEVEE is not 1; expected 1"),
        (lamp.volume_factor != 1, "its Volume factor for EEVEE is not 1; expected 1"),
        (getattr(cycles, "is_portal", False), "it is a Portal; expected a light"),
    )
    # Colour times power. All distances grow by the unit, so the power by its square.
    power = np.array(lamp.color, dtype=np.float64) * (lamp.energy * 2.0**lamp.exposure)
    power *= np.array(lamp.temperature_color) if lamp.use_temperature else 1.0
    power *= emission_of(lamp.node_tree) if lamp.use_nodes and lamp.node_tree else 1.0
    power *= 1.0 if lamp.type == "SUN" else unit**2
    # Each kind of light has some of these properties.
    shape, size = getattr(lamp, "shape", "SQUARE"), getattr(lamp, "size", 0.0) * unit
    oblong = shape in ("RECTANGLE", "ELLIPSE")
    return Lamp(
        lamp.type,
        in_metres(matrix, unit),
        power,
        radius=getattr(lamp, "shadow_soft_size", 0.0) * unit,
        soft_falloff=getattr(lamp, "use_soft_falloff", False),
        cone=getattr(lamp, "spot_size", 0.0),
        blend=getattr(lamp, "spot_blend", 0.0),
        angle=getattr(lamp, "angle", 0.0),
        shape=shape,
        size=(size, lamp.size_y * unit if oblong else size),
        spread=getattr(lamp, "spread", np.pi),
    )


def in_metres(matrix: Any, unit: float) -> Array:
    """Return a matrix to the world with its place in metres; its axes keep their lengths."""
    made = np.array(matrix, dtype=np.float64)
    made[:3, 3] *= unit
    return made


def check_visible(instance: Any, *flags: str) -> None:
    """Raise CannotError for an object, or one whose instance it is, that meets a part of the
    light: whose flags are off.
    """
    for thing in filter(None, (instance.object, instance.parent)):
        linking = thing.light_linking
        off = [flag for flag in flags if not getattr(thing, flag)]
        _refuse(
            (off, f"its {' and '.join(off)} is off; expected it on, or hide it in renders"),
            (linking and linking.receiver_collection, "it has Light Linking; expected none"),
            (linking and linking.blocker_collection, "it has Shadow Linking; expected none"),
            (thing.is_holdout, "it is a Holdout; expected none"),
            # A light has it by default: catchers show its shadows.
            (thing.type != "LIGHT" and thing.is_shadow_catcher, "it is a Shadow Catcher"),
        )


def _refuse(*reasons: tuple[Any, str]) -> None:
    """Raise CannotError by the first reason that holds."""
    for holds, why in reasons:
        if holds:
            raise CannotError(why)


def output_of(tree: Any) -> Any:
    """Return the output of a tree of nodes that Cycles takes, None without one."""
    return tree.get_output_node("CYCLES") if tree else None


def source(socket: Any) -> Any:
    """Return the node that gives an input its value, None where it has its own."""
    while socket.is_linked and not socket.links[0].is_muted:
        node = socket.links[0].from_node
        if node.mute:
            raise CannotError(f"its node {node.name} is muted; expected it on, or removed")
        if node.bl_idname != "NodeReroute":
            return node
        socket = node.inputs[0]
    return None


def value(node: Any, name: str) -> Any:
    """Return the constant value of an input: a number, or three."""
    socket, giver = node.inputs[name], source(node.inputs[name])
    if giver is not None and giver.bl_idname not in ("ShaderNodeValue", "ShaderNodeRGB"):
        raise CannotError(f"its {name} comes from the node {giver.name}; expected one value")
    given = socket.default_value if giver is None else giver.outputs[0].default_value
    single = not hasattr(socket.default_value, "__len__")
    if single == hasattr(given, "__len__"):
        raise CannotError(f"its {name} gets a value of another kind; expected one of its kind")
    return float(given) if single else np.array(given, dtype=np.float64)[:3]


def volume_node(material: Any) -> Any:
    """Return the node of the volume of a material, None without one."""
    output = output_of(material.node_tree) if material else None
    return None if output is None else source(output.inputs["Volume"])


def medium_of(node: Any, unit: float) -> Medium:
    """Return the medium of the node of a volume; `unit` is the length of Blender's unit [m]."""
    # Volumes that are added up scatter and absorb together.
    if node.bl_idname == "ShaderNodeAddShader":
        medium = Medium(np.zeros(3), np.zeros(3))
        for each in filter(None, map(source, node.inputs)):
            medium += medium_of(each, unit)
        return medium
    if node.bl_idname not in _VOLUMES:
        raise CannotError(f"its volume is a {node.bl_label}; expected one that is the same inside")
    for name in _SHINING:
        if name in node.inputs and np.any(value(node, name)):
            raise CannotError(f"its volume shines; expected {name} 0")
    phase = _PHASES.get(getattr(node, "phase", "HENYEY_GREENSTEIN"))
    if phase is None:
        raise CannotError(f"its phase function is {node.phase}; expected Henyey-Greenstein")
    # Coefficients are per length.
    given = {name: value(node, name) for name in _VOLUMES[node.bl_idname]}
    sigma_s, sigma_a = (each / unit for each in coefficients(node.bl_idname, given))
    if min(*sigma_s, *sigma_a) < 0:
        raise CannotError("its volume scatters or absorbs less than nothing; expected 0 or more")
    has_g = phase == "hg" and "Anisotropy" in node.inputs
    return Medium(sigma_s, sigma_a, phase, value(node, "Anisotropy") if has_g else 0.0)


def background_of(node: Any) -> Array:
    """Return the radiance of the background of a world."""
    if node.bl_idname != "ShaderNodeBackground":
        raise CannotError(f"its surface is a {node.bl_label}; expected a Background of one colour")
    radiance: Array = value(node, "Color") * value(node, "Strength")
    return radiance


def emission_of(tree: Any) -> Array:
    """Return the factor that the nodes of a light are."""
    output = output_of(tree)
    node = None if output is None else source(output.inputs["Surface"])
    if node is None or node.bl_idname != "ShaderNodeEmission":
        raise CannotError("its nodes are no Emission alone; expected one, or Use Nodes off")
    factor: Array = value(node, "Color") * value(node, "Strength")
    return factor


def surface_of(material: Any) -> Surface:
    """Return the diffuse part of a material; None is the material of a mesh that has none."""
    if material is None:
        return Surface(np.array(_GREY))
    output, what = output_of(material.node_tree), f"material '{material.name}'"
    node = None if output is None else source(output.inputs["Surface"])
    if node is None:
        raise CannotError(f"{what} has no surface; expected a Diffuse or Principled BSDF")
    front = _front(node)
    node, two_sided = (node, True) if front is None else (front, False)
    if node.bl_idname == "ShaderNodeBsdfDiffuse":
        colour: Array = value(node, "Color")
        left = [] if _is(node, "Roughness", 0) else ["Roughness"]
    elif node.bl_idname == "ShaderNodeBsdfPrincipled":
        for key, plain in _PLAIN.items():
            if not _is(node, key, plain):
                raise CannotError(f"{what} has another {key} than {plain}; expected {plain}")
        colour = value(node, "Base Color") * (1 - value(node, "Metallic"))
        left = [key for key in _GLOSS if not _is(node, key, 0)]
    else:
        raise CannotError(f"{what} is a {node.bl_label}; expected a Diffuse or Principled BSDF")
    if not 0 <= colour.min() <= colour.max() <= 1:
        raise CannotError(f"{what} has the colour {colour.tolist()}; expected 0 to 1")
    # Inputs that bend normals or move the surface.
    left += ["Normal"] if node.inputs["Normal"].is_linked else []
    left += ["Displacement"] if output.inputs["Displacement"].is_linked else []
    return Surface(colour, two_sided, left)


def _front(node: Any) -> Any:
    """Return the front of a surface that is black from behind: of a mix, by Backfacing, with a
    black Diffuse BSDF. None for others.
    """
    if node.bl_idname != "ShaderNodeMixShader":
        return None
    side, front, back = (source(each) for each in node.inputs)
    if front is None or back is None or back.bl_idname != "ShaderNodeBsdfDiffuse":
        return None
    by_side = side is not None and node.inputs[0].links[0].from_socket.name == "Backfacing"
    return front if by_side and not np.any(value(back, "Color")) else None


def _is(node: Any, name: str, plain: float) -> bool:
    socket = node.inputs[name]
    return not socket.is_linked and bool(socket.default_value == plain)
