# SPDX-License-Identifier: BSD-3-Clause
"""Render a scene of airlight by Cycles with a fault in it: as `render_cycles.py`,
and one thing is set wrong.

    airlight describe sphere-spot --size 160x120 --json -o sphere-spot.glb > sphere-spot.json
    python3.11 cycles_faults.py sphere-spot.json sphere-spot.glb folder --samples 256 --faults
    no-shadow g-lobe airlight compare sphere-spot folder/no-shadow.exr --diagnose

No pixel of an image is changed: the faults are in what Blender is told, before it renders or
writes. Its PNG files are read back as numbers, as someone does who takes them for linear. `--list`
prints each fault, the name that a diagnosis should give it, and what was done.
"""

import argparse
import json
import math
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
from mathutils import Matrix, Vector

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "examples"))
from render_cycles import assign, build, read, render

Properties = dict[str, Any]
Fault = tuple[str, str, Callable[[Properties], Any]]  # its name in a diagnosis, words, what is done

_PNG = {"file_format": "PNG", "color_mode": "RGB", "color_depth": "16"}


def main() -> None:
    """Read the command line and render."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "described", nargs="?", help="what `airlight describe SCENE --json` printed"
    )
    parser.add_argument("gltf", nargs="?", help="what `-o` wrote, for the meshes")
    parser.add_argument("folder", nargs="?", help="where the EXR files go")
    parser.add_argument(
        "--faults", nargs="*", choices=FAULTS, help="those that the scene can have, by default"
    )
    parser.add_argument("--samples", type=int, default=256, help="paths per pixel")
    parser.add_argument("--list", action="store_true", help="print the faults as JSON")
    chosen = parser.parse_args(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else None)
    if chosen.list:
        print(
            json.dumps(
                {
                    name: {"injected": injected, "words": words}
                    for name, (injected, words, _) in FAULTS.items()
                }
            )
        )
        return
    os.makedirs(chosen.folder, exist_ok=True)
    for name in chosen.faults or FAULTS:
        properties = read(chosen.described)
        after = FAULTS[name][2](properties)
        if after is not NOT_HERE:
            faulty(name, properties, after, chosen)


def faulty(
    name: str, properties: Properties, after: Callable[[], Any] | None, chosen: argparse.Namespace
) -> None:
    """Render a scene with a fault; `after` changes what Blender has made of the properties."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    build(properties, chosen.gltf)
    if after is not None:
        after()
    path = os.path.join(chosen.folder, f"{name}.exr")
    image_settings = properties["image_settings"]
    assign(bpy.context.scene.render.image_settings, image_settings)
    if image_settings["file_format"] == "OPEN_EXR":
        render(path, chosen.samples)
    else:
        render(path + ".png", chosen.samples)
        as_numbers(path + ".png", path)


def as_numbers(png: str, path: str) -> None:
    """Write the values of a PNG file, from 0 to 1, into an EXR file."""
    image = bpy.data.images.load(png)
    image.colorspace_settings.name = "Non-Color"
    scene = bpy.context.scene
    scene.view_settings.view_transform = "Raw"
    settings = scene.render.image_settings
    settings.file_format, settings.color_mode, settings.color_depth = "OPEN_EXR", "RGB", "32"
    image.save_render(path, scene=scene)
    os.remove(png)


NOT_HERE = object()  #: a scene that cannot have the fault


def right(properties: Properties) -> None:
    """Change nothing."""


def scene(**values: Any) -> Callable[[Properties], None]:
    """Set properties of the scene; dots in names are double underscores."""
    return lambda properties: properties["scene"].update(
        {name.replace("__", "."): v for name, v in values.items()}
    )


def volumes(change: Callable[[dict[str, Any]], Any]) -> Callable[[Properties], Any]:
    """Change the inputs of all media."""

    def changed(properties: Properties) -> Any:
        after = [change(inputs) for inputs in media_inputs(properties)]
        return NOT_HERE if after.count(NOT_HERE) == len(after) else None

    return changed


def media_inputs(properties: Properties) -> list[dict[str, Any]]:
    """Return the inputs of all media; a scene may have none around its bodies."""
    media = (properties["world"], *properties["media"].values())
    return [medium["inputs"] for medium in media if medium is not None]


def coefficients(
    change: Callable[[float, float], tuple[float, float]],
) -> Callable[[Properties], Any]:
    """Change scattering and absorption of all media by a function of both."""

    def changed(inputs: dict[str, Any]) -> None:
        names = "Scatter Coefficients", "Absorption Coefficients"
        pairs = [change(s, a) for s, a in zip(inputs[names[0]], inputs[names[1]], strict=True)]
        inputs[names[0]], inputs[names[1]] = ([pair[part] for pair in pairs] for part in (0, 1))

    return volumes(changed)


def anisotropy(change: Callable[[float], float]) -> Callable[[Properties], Any]:
    """Change g of all media."""

    def changed(inputs: dict[str, Any]) -> Any:
        g = inputs.get("Anisotropy")
        if g is None or change(g) == g:
            return NOT_HERE
        inputs["Anisotropy"] = change(g)
        return None

    return volumes(changed)


def lights(change: Callable[[dict[str, Any]], Any], *types: str) -> Callable[[Properties], Any]:
    """Change the data of all lights of some types."""

    def changed(properties: Properties) -> Any:
        there = [light for light in properties["lights"] if light["type"] in types]
        for light in there:
            change(light["data"])
        return None if there else NOT_HERE

    return changed


def scaled(name: str, factor: float) -> Callable[[dict[str, Any]], None]:
    """Multiply a property."""
    return lambda data: data.update({name: factor * data[name]})


def moved(properties: Properties) -> None:
    """Put the first light elsewhere."""
    for axis, by in enumerate((0.11, -0.07, 0.09)):
        properties["lights"][0]["matrix_world"][axis][3] += by


def other_unit(factor: float) -> Callable[[Properties], Any]:
    """Multiply all lengths, as a file in another unit does; what is typed in stays."""

    def changed(properties: Properties) -> Any:
        for thing in (properties["camera"], *properties["lights"]):
            for axis in range(3):
                thing["matrix_world"][axis][3] *= factor
        return lambda: transform_meshes(Matrix.Scale(factor, 4))

    return changed


def mirrored(properties: Properties) -> Any:
    """Mirror the world at the plane through the camera that is upright in the
    image: another handedness.
    """
    camera = Matrix(properties["camera"]["matrix_world"])
    mirror = camera @ Matrix.Diagonal((-1, 1, 1, 1)) @ camera.inverted()
    for light in properties["lights"]:
        light["matrix_world"] = [list(row) for row in mirror @ Matrix(light["matrix_world"])]
    return lambda: transform_meshes(mirror)


def transform_meshes(matrix: Matrix) -> None:
    """Transform the points of all meshes."""
    for thing in meshes():
        thing.data.transform(thing.matrix_world.inverted() @ matrix @ thing.matrix_world)
        if matrix.determinant() < 0:
            thing.data.flip_normals()


def meshes() -> list[bpy.types.Object]:
    """Return the meshes."""
    return [thing for thing in bpy.data.objects if thing.type == "MESH"]


def turned(properties: Properties) -> None:
    """Turn the camera upside down."""
    camera = properties["camera"]
    camera["matrix_world"] = [
        list(row) for row in Matrix(camera["matrix_world"]) @ Matrix.Rotation(math.pi, 4, "Z")
    ]


def shifted(pixels: float) -> Callable[[Properties], None]:
    """Move the film to the right, by a fraction of its width."""
    return lambda properties: properties["camera"]["data"].update(
        shift_x=pixels / properties["scene"]["render.resolution_x"]
    )


def camera(**values: Any) -> Callable[[Properties], None]:
    """Set properties of the camera."""
    return lambda properties: properties["camera"]["data"].update(values)


def other_channels(properties: Properties) -> None:
    """Give blue to red, and red to blue."""
    for light in properties["lights"]:
        light["data"]["color"] = light["data"]["color"][::-1]
    for material in properties["materials"].values():
        material["inputs"]["Color"] = [*material["inputs"]["Color"][2::-1], 1.0]
    for inputs in media_inputs(properties):
        for name in ("Scatter Coefficients", "Absorption Coefficients"):
            inputs[name] = inputs[name][::-1]


def shadowless(properties: Properties) -> Any:
    """Let no mesh cast a shadow."""
    if not properties["materials"]:
        return NOT_HERE
    properties["objects"]["visible_shadow"] = False
    return None


def falloff(output: str) -> Callable[[Properties], Any]:
    """Let lights fall off by the node "Light Falloff"."""

    def change() -> None:
        for lamp in bpy.data.lights:
            lamp.use_nodes = True
            tree = lamp.node_tree
            node = tree.nodes.new("ShaderNodeLightFalloff")
            node.inputs["Strength"].default_value = 1
            emission = next(each for each in tree.nodes if each.type == "EMISSION")
            tree.links.new(node.outputs[output], emission.inputs["Strength"])

    return lambda properties: change


def pane(fill: Callable[[bpy.types.NodeTree], bpy.types.NodeSocket]) -> Callable[[Properties], Any]:
    """Hold a pane before the camera that only it sees."""

    def change() -> None:
        eye = bpy.context.scene.camera
        corners = [Vector((x, y, -1e-4)) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
        data = bpy.data.meshes.new("pane")
        data.from_pydata([eye.matrix_world @ corner for corner in corners], [], [(0, 1, 2, 3)])
        thing = bpy.data.objects.new("pane", data)
        bpy.context.collection.objects.link(thing)
        thing.visible_shadow = thing.visible_volume_scatter = thing.visible_diffuse = False
        material = bpy.data.materials.new("pane")
        tree = material.node_tree
        tree.nodes.clear()
        output = tree.nodes.new("ShaderNodeOutputMaterial")
        tree.links.new(fill(tree), output.inputs["Surface"])
        material.cycles.emission_sampling = "NONE"
        data.materials.append(material)

    return lambda properties: change


def darker_corners(tree: bpy.types.NodeTree) -> bpy.types.NodeSocket:
    """Return a pane that lets the fourth power of the cosine to the camera's axis
    through, as a lens does.
    """
    view, apart = tree.nodes.new("ShaderNodeCameraData"), tree.nodes.new("ShaderNodeSeparateXYZ")
    power, glass = tree.nodes.new("ShaderNodeMath"), tree.nodes.new("ShaderNodeBsdfTransparent")
    power.operation, power.inputs[1].default_value = "POWER", 4
    size = tree.nodes.new("ShaderNodeMath")
    size.operation = "ABSOLUTE"
    tree.links.new(view.outputs["View Vector"], apart.inputs[0])
    tree.links.new(apart.outputs["Z"], size.inputs[0])
    tree.links.new(size.outputs[0], power.inputs[0])
    tree.links.new(power.outputs[0], glass.inputs[0])
    return glass.outputs[0]


def glow(tree: bpy.types.NodeTree) -> bpy.types.NodeSocket:
    """Return a pane that shines."""
    shine, glass = tree.nodes.new("ShaderNodeEmission"), tree.nodes.new("ShaderNodeBsdfTransparent")
    both = tree.nodes.new("ShaderNodeAddShader")
    shine.inputs["Color"].default_value, shine.inputs["Strength"].default_value = (
        (1, 1, 1, 1),
        0.003,
    )
    tree.links.new(shine.outputs[0], both.inputs[0])
    tree.links.new(glass.outputs[0], both.inputs[1])
    return both.outputs[0]


def png(transform: str, **more: Any) -> Callable[[Properties], None]:
    """Write a PNG file through a view transform."""

    def changed(properties: Properties) -> None:
        depth = more.pop("depth", "16")
        properties["scene"]["view_settings.view_transform"] = transform
        properties["scene"].update({name.replace("__", "."): value for name, value in more.items()})
        properties["image_settings"] = _PNG | {"color_depth": depth}

    return changed


def bounces(count: int) -> Callable[[Properties], None]:
    """Let light scatter again."""
    return scene(
        cycles__max_bounces=count, cycles__volume_bounces=count, cycles__diffuse_bounces=count
    )


def with_lamp_in_view(change: Callable[[Properties], None]) -> Callable[[Properties], Any]:
    """Make a fault that wants bright pixels: beside a lamp radiance has no limit."""

    def changed(properties: Properties) -> Any:
        eye = Matrix(properties["camera"]["matrix_world"])
        places = [
            eye.inverted() @ Matrix(light["matrix_world"]).translation
            for light in properties["lights"]
        ]
        half = math.tan(0.5 * properties["camera"]["data"]["angle"])
        seen = [
            place.z < 0 and max(abs(place.x), 1.3 * abs(place.y)) < -half * place.z
            for place in places
        ]
        return change(properties) if any(seen) else NOT_HERE

    return changed


NEAR = "POINT", "SPOT"
FAULTS: dict[str, Fault] = {
    "right": ("right", "nothing", right),
    "factor-2": ("factor", "lamps of twice the power", lights(scaled("energy", 2), *NEAR)),
    "factor-4-pi": (
        "factor",
        "I watts in the place of 4 pi I",
        lights(scaled("energy", 0.25 / math.pi), *NEAR),
    ),
    "factor-1.05": ("factor", "Film Exposure 1.05", scene(cycles__film_exposure=1.05)),
    "extinction-1.5": (
        "extinction",
        "both coefficients 1.5 times",
        coefficients(lambda s, a: (1.5 * s, 1.5 * a)),
    ),
    "extinction-0.9": (
        "extinction",
        "both coefficients 0.9 times",
        coefficients(lambda s, a: (0.9 * s, 0.9 * a)),
    ),
    "absorption-0": (
        "absorption",
        "Volume Scatter alone: no absorption",
        coefficients(lambda s, a: (s, 0.0)),
    ),
    "absorption-3": (
        "absorption",
        "the absorption three times",
        coefficients(lambda s, a: (s, 3 * a)),
    ),
    "sigma-s": (
        "sigma-s",
        "sigma_t as Scatter, absorption on top",
        coefficients(lambda s, a: (s + a, a * (s + a) / s)),
    ),
    "albedo-1": (
        "albedo",
        "sigma_t as Scatter Coefficients, no absorption",
        coefficients(lambda s, a: (s + a, 0.0)),
    ),
    "albedo-twice": (
        "albedo",
        "the albedo twice: Volume Scatter of colour albedo and density sigma_s",
        coefficients(lambda s, a: (s * s / (s + a), s + a - s * s / (s + a))),
    ),
    "g-sign": ("g-sign", "Anisotropy -g", anisotropy(lambda g: -g)),
    "g-lobe": ("g", "Anisotropy 0.3 more", anisotropy(lambda g: g + 0.3)),
    "g-0": (
        "phase",
        "Anisotropy 0, which is isotropic, as a new node has it",
        anisotropy(lambda g: 0.0),
    ),
    "multiple": ("multiple", "32 bounces", bounces(32)),
    "near-1": ("near-plane", "Clip Start 1 m", camera(clip_start=1.0)),
    "near-0.1": ("near-plane", "Clip Start 0.1 m, Blender's own", camera(clip_start=0.1)),
    "feet": ("unit-length", "lengths in feet", other_unit(3.280839895)),
    "no-shadow": ("no-shadow", "meshes without Ray Visibility for shadows", shadowless),
    "linear-falloff": ("distance-law", "Light Falloff Linear", falloff("Linear")),
    "constant-falloff": ("distance-law", "Light Falloff Constant", falloff("Constant")),
    "spot-half": (
        "spot-angle",
        "the half angle as Spot Size",
        lights(scaled("spot_size", 0.5), "SPOT"),
    ),
    "spot-1.1": ("spot-angle", "Spot Size 1.1 times", lights(scaled("spot_size", 1.1), "SPOT")),
    "spot-blend": (
        "spot-falloff",
        "Spot Blend 0.15, Blender's own",
        lights(lambda data: data.update(spot_blend=0.15), "SPOT"),
    ),
    "spot-blend-1": (
        "spot-falloff",
        "Spot Blend 1",
        lights(lambda data: data.update(spot_blend=1.0), "SPOT"),
    ),
    "radius-0.3": (
        "light-radius",
        "Radius 0.3 m",
        lights(lambda data: data.update(shadow_soft_size=0.3), "POINT"),
    ),
    "moved": ("light-position", "the lamp 16 cm off", moved),
    "fov-axis": (
        "fov-axis",
        "Sensor Fit Vertical with the horizontal angle",
        camera(sensor_fit="VERTICAL"),
    ),
    "shift-0.5": ("shift", "half a pixel", shifted(0.5)),
    "shift-1": ("shift", "a pixel", shifted(1.0)),
    "mirrored": ("flip", "the world mirrored", mirrored),
    "turned": ("flip", "the camera upside down", turned),
    "vignette": ("vignette", "corners darker by cos^4", pane(darker_corners)),
    "black-level": ("black-level", "0.003 more everywhere", pane(glow)),
    "srgb": ("transfer", "PNG of 16 bits, View Transform Standard", png("Standard")),
    "srgb-8": ("transfer", "PNG of 8 bits, View Transform Standard", png("Standard", depth="8")),
    "gamma": ("transfer", "PNG, Raw with Gamma 2.2", png("Raw", view_settings__gamma=2.2)),
    "clamp": ("clamp", "PNG, Raw: what is above 1 is cut off", with_lamp_in_view(png("Raw"))),
    "filmic": ("tone-map", "PNG, View Transform Filmic", png("Filmic")),
    "agx": ("tone-map", "PNG, View Transform AgX, Blender's own", png("AgX")),
    "channels": ("channels", "red and blue of all colours swapped", other_channels),
}

if __name__ == "__main__":
    main()
