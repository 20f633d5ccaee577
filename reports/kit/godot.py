# SPDX-License-Identifier: BSD-3-Clause
"""A certified scene as a scene of Godot 4, by the page `docs/engines/godot.md`.

Godot has y up; (x, y, z) becomes (x, z, -y). Its colours are sRGB where a file has them, and its
fog has one extinction for all colours: that of green. Nobody has run these files.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from airlight.reports.kit.scenes import KitScene, Vector

#: Pixels of the view along a side of a certified pixel; the middle one is its ray.
BLOCK = 33
#: As far as lights reach and the camera sees [m]: lights of Godot end, and 1000 times the scenes is
#: far enough that the window of their end is 1 within 1e-12 there.
_FAR = 1e4
#: The length of the fog [m], over which froxels are divided. Beyond it rays without an end have up to
#: 2.4 % of their light in `thin-open` and 2e-6 elsewhere, by the integral from there on.
_LENGTH = 32.0
#: The optical depth of that length below which it is told.
_THIN = 1.0
#: Makes Godot's edge of a spot, 1 - rim^n, hard.
_HARD = 1000.0
_SEGMENTS = 256  # of a sphere: its radius errs by 1e-4 at most

#: The settings of the project that hold the scenes.
PROJECT = """; SPDX-License-Identifier: MIT-0
config_version=5

[application]

config/name="airlight conformance kit"
config/features=PackedStringArray("4.3", "Forward Plus")

[rendering]

renderer/rendering_method="forward_plus"
environment/volumetric_fog/volume_size=256
environment/volumetric_fog/volume_depth=256
environment/volumetric_fog/use_filter=0
anti_aliasing/quality/use_debanding=false
"""


def godot_cannot(scene: KitScene) -> tuple[str, ...]:
    """Return what Godot's fog cannot have of a scene."""
    medium = scene.data["medium"]
    found = []
    if len(set(medium["sigma_t"])) > 1:
        found.append("one extinction for all colours: green is judged")
    if medium["phase"] == "rayleigh":
        found.append("no Rayleigh scattering: isotropic in its place")
    if any(light["type"] == "spot" and light["beam"] < light["cutoff"] for light in _lights(scene)):
        found.append("no edge of a spot that is linear in the angle")
    if min(medium["sigma_t"]) * _LENGTH < _THIN:
        found.append(f"its fog ends after {_LENGTH:g} m, and there is light beyond")
    return tuple(found)


def godot_scene(scene: KitScene) -> str:
    """Return a scene as the text of a `.tscn` file."""
    medium = scene.data["medium"]
    resources = [_environment(medium), _black()]
    nodes = []
    left, up, forward, position = scene.matrix
    nodes.append(
        _node(
            "Camera",
            "Camera3D",
            transform=_frame(left, up, forward, position),
            fov=_number(scene.fov),
            near="0.01",
            far=_number(_FAR),
            current="true",
        )
    )
    nodes.append(_node("Fog", "WorldEnvironment", environment='SubResource("fog")'))
    nodes += [_light_node(scene, number) for number in range(len(_lights(scene)))]
    for number, shape in enumerate(scene.data["occluders"]):
        resources.append(_mesh(shape, number))
        nodes.append(_occluder_node(shape, number))
    # A script reads the image of the view: it has linear values and no window.
    width, height = (side * BLOCK for side in scene.size)
    cannot = "; ".join(godot_cannot(scene)) or "nothing"
    note = f"{scene.words} Not run. Godot cannot have of it: {cannot}."
    view = [
        '[node name="Root" type="Node3D"]',
        'script = ExtResource("judge")',
        f'editor_description = "{note}"',
        "",
        '[node name="View" type="SubViewport" parent="."]',
        "own_world_3d = true",
        f"size = Vector2i({width}, {height})",
        "use_hdr_2d = true",
        "render_target_update_mode = 4",
    ]
    head = [
        f"[gd_scene load_steps={len(resources) + 2} format=3]",
        "",
        f'[ext_resource type="Script" path="res://{scene.name}/godot.gd" id="judge"]',
    ]
    return "\n\n".join(["\n".join(head), *resources, "\n".join(view), *nodes]) + "\n"


def _lights(scene: KitScene) -> Sequence[Mapping[str, Any]]:
    lights: Sequence[Mapping[str, Any]] = scene.data["lights"]
    return lights


def _environment(medium: Mapping[str, Any]) -> str:
    return _resource(
        "Environment",
        "fog",
        background_mode="1",
        background_color="Color(0, 0, 0, 1)",
        ambient_light_source="1",
        reflected_light_source="1",
        volumetric_fog_enabled="true",
        volumetric_fog_density=_number(medium["sigma_t"][1]),
        volumetric_fog_albedo=_colour(medium["albedo"]),
        volumetric_fog_emission="Color(0, 0, 0, 1)",
        volumetric_fog_anisotropy=_number(medium.get("g", 0.0)),
        volumetric_fog_length=_number(_LENGTH),
        volumetric_fog_detail_spread="1.0",
        volumetric_fog_gi_inject="0.0",
        volumetric_fog_ambient_inject="0.0",
        # Rays that meet nothing have fog too.
        volumetric_fog_sky_affect="1.0",
        volumetric_fog_temporal_reprojection_enabled="false",
    )


def _black() -> str:
    return _resource(
        "StandardMaterial3D",
        "black",
        shading_mode="0",
        cull_mode="2",
        albedo_color="Color(0, 0, 0, 1)",
    )


def _light_node(scene: KitScene, number: int) -> str:
    light = _lights(scene)[number]
    brightest = max(light["intensity"])
    # An energy e is pi e W/sr; Godot's attenuation 2 is the inverse square.
    values = {
        "light_color": _colour([value / brightest for value in light["intensity"]]),
        "light_energy": _number(brightest / math.pi),
        "light_indirect_energy": "0.0",
        "light_specular": "0.0",
        "shadow_enabled": "true",
    }
    if light["type"] == "point":
        one = ((-1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, 1.0, 0.0))
        place = {"transform": _frame(*one, light["position"])}
        reach = {"omni_range": _number(_FAR), "omni_attenuation": "2.0"}
        return _node(f"Light{number}", "OmniLight3D", **place, **values, **reach)
    matrix = scene.data["mitsuba"][f"light{number}"]["to_world"]["matrix"]
    columns = [tuple(row[column] for row in matrix[:3]) for column in range(4)]
    reach = {
        "spot_range": _number(_FAR),
        "spot_attenuation": "2.0",
        "spot_angle": _number(light["cutoff"]),
        "spot_angle_attenuation": _number(_HARD if light["beam"] == light["cutoff"] else 1.0),
    }
    return _node(f"Light{number}", "SpotLight3D", transform=_frame(*columns), **values, **reach)


def _mesh(shape: Mapping[str, Any], number: int) -> str:
    name = f"mesh{number}"
    if shape["type"] == "sphere":
        radius = shape["radius"]
        return _resource(
            "SphereMesh",
            name,
            radius=_number(radius),
            height=_number(2 * radius),
            radial_segments=str(_SEGMENTS),
            rings=str(_SEGMENTS // 2),
        )
    if shape["type"] == "box":
        return _resource("BoxMesh", name, size="Vector3(2, 2, 2)")
    return _resource("QuadMesh", name, size="Vector2(2, 2)")


def _occluder_node(shape: Mapping[str, Any], number: int) -> str:
    # The edges of a mesh of 2 m are the half edges of the shape; a screen has no third.
    x, y, z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
    edges = [x, y, z] if shape["type"] == "sphere" else [*shape["half_edges"], z][:3]
    columns = [*edges, shape["centre"]]
    return _node(
        f"Occluder{number}",
        "MeshInstance3D",
        transform=_transform(columns),
        mesh=f'SubResource("mesh{number}")',
        material_override='SubResource("black")',
        cast_shadow="2",
    )


def _frame(left: Vector, up: Vector, forward: Vector, position: Vector) -> str:
    """Return a transform of Godot, whose cameras and spots look along -z with x to the right."""
    right, back = (tuple(-value for value in axis) for axis in (left, forward))
    return _transform([right, up, back, position])


def _transform(columns: Sequence[Sequence[float]]) -> str:
    """Return a transform by its columns in the axes of the scene."""
    turned = [(x, z, -y + 0.0) for x, y, z in columns]
    rows = [_number(column[axis]) for axis in range(3) for column in turned[:3]]
    return f"Transform3D({', '.join([*rows, *map(_number, turned[3])])})"


def _colour(linear: Sequence[float]) -> str:
    """Return a colour as Godot's files have it, in sRGB (IEC 61966-2-1)."""
    encoded = [
        12.92 * value if value <= 0.0031308 else 1.055 * value ** (1 / 2.4) - 0.055
        for value in linear
    ]
    return f"Color({', '.join(map(_number, encoded))}, 1)"


def _number(value: float) -> str:
    return f"{value:.9g}"


def _resource(kind: str, name: str, **values: str) -> str:
    return "\n".join([f'[sub_resource type="{kind}" id="{name}"]', *_assigned(values)])


def _node(name: str, kind: str, **values: str) -> str:
    return "\n".join([f'[node name="{name}" type="{kind}" parent="View"]', *_assigned(values)])


def _assigned(values: Mapping[str, str]) -> list[str]:
    return [f"{name} = {value}" for name, value in values.items()]
