# SPDX-License-Identifier: BSD-3-Clause
"""Render a scene of airlight by Blender's Cycles, from what `airlight describe`
says of it and nothing else.

    airlight describe sphere-spot --size 160x120 --json -o sphere-spot.glb > sphere-spot.json
    python3.11 render_cycles.py sphere-spot.json sphere-spot.glb sphere-spot.exr --samples 512
    airlight compare sphere-spot sphere-spot.exr

The interpreter needs the module `bpy` (`pip install bpy==5.0.1` for Python 3.11), or run `blender
--background --python render_cycles.py -- sphere-spot.json ...`. With `--layers` the file is
Blender's multi-layer EXR, whose layer `ViewLayer.Volume Direct` is the airlight. Rendered with
Blender 5.0.1.

`cycles_properties.py` gives every number as a property of `bpy`; this file creates what is
listed there and assigns it.
"""

import argparse
import json
import sys
from functools import reduce
from pathlib import Path
from typing import Any

import bpy
from mathutils import Matrix

sys.path.insert(0, str(Path(__file__).parent))  # Blender's `--python` does not look there

from cycles_properties import cycles_properties

FILTERS = {"box": "BOX", "blackman-harris": "BLACKMAN_HARRIS"}


def main() -> None:
    """Read the command line and render."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("described", help="what `airlight describe SCENE --json` printed")
    parser.add_argument("gltf", help="what `-o` wrote, for the meshes")
    parser.add_argument("output", help="the EXR file")
    parser.add_argument("--samples", type=int, default=512, help="paths per pixel")
    parser.add_argument("--layers", action="store_true", help="write a multi-layer file")
    parser.add_argument(
        "--filter",
        choices=FILTERS,
        default="box",
        help="the pixel filter; Cycles' own is the latter",
    )
    chosen = parser.parse_args(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else None)
    properties = read(chosen.described)
    properties["scene"]["cycles.pixel_filter_type"] = FILTERS[chosen.filter]
    build(properties, chosen.gltf)
    bpy.context.scene.view_layers[0].cycles.use_pass_volume_direct = chosen.layers
    assign(
        bpy.context.scene.render.image_settings,
        properties["layered_image_settings" if chosen.layers else "image_settings"],
    )
    render(chosen.output, chosen.samples)


def read(path: str) -> dict[str, Any]:
    """Return the properties of a scene that `describe` printed."""
    with open(path, encoding="utf-8") as stream:
        return cycles_properties(json.load(stream)["result"])


def build(properties: dict[str, Any], gltf: str) -> None:
    """Make the scene."""
    scene = bpy.context.scene
    # the cube, the lamp and the camera that Blender starts with
    bpy.data.batch_remove(list(bpy.data.objects))
    assign(scene, properties["scene"])
    shapes(properties, gltf)
    scene.camera = placed("camera", bpy.data.cameras.new("camera"), properties["camera"])
    for light in properties["lights"]:
        placed("lamp", bpy.data.lights.new("lamp", can(light)["type"]), light)
    scene.world = bpy.data.worlds.new("world")
    tree = scene.world.node_tree
    tree.nodes.clear()
    if properties["world"] is not None:
        volume(tree, properties["world"], tree.nodes.new("ShaderNodeOutputWorld"))


def render(output: str, samples: int) -> None:
    """Render into a file."""
    scene = bpy.context.scene
    scene.cycles.device, scene.cycles.samples, scene.cycles.seed = "CPU", samples, 1
    scene.render.filepath, scene.render.use_file_extension = output, False
    bpy.ops.render.render(write_still=True)


def assign(thing: bpy.types.bpy_struct, values: dict[str, Any]) -> None:
    """Assign properties by name; a name may lead through other things."""
    for name, value in values.items():
        *path, last = name.split(".")
        setattr(reduce(getattr, path, thing), last, value)


def can(part: dict[str, Any]) -> dict[str, Any]:
    """Return a part of the description, or stop where Cycles does not have it."""
    if "cannot" in part:
        raise SystemExit(f"Cycles cannot render this scene: {part['cannot']}")
    return part


def placed(name: str, data: bpy.types.ID, described: dict[str, Any]) -> bpy.types.Object:
    """Put something into the scene."""
    assign(data, described["data"])
    thing = bpy.data.objects.new(name, data)
    thing.matrix_world = Matrix(described["matrix_world"])
    bpy.context.collection.objects.link(thing)
    return thing


def shapes(properties: dict[str, Any], gltf: str) -> None:
    """Import the meshes, which is exact, and give them materials by name."""
    if properties["materials"] or properties["media"]:
        bpy.ops.import_scene.gltf(filepath=gltf)
    for thing in list(bpy.data.objects):
        if thing.type != "MESH":
            bpy.data.objects.remove(thing)  # camera and lights come from the description
            continue
        assign(thing, properties["objects"])
        thing.data.transform(Matrix(properties["turn"]))
        material = bpy.data.materials.new(thing.name)
        material.node_tree.nodes.clear()
        output = material.node_tree.nodes.new("ShaderNodeOutputMaterial")
        if thing.name in properties["media"]:
            volume(material.node_tree, properties["media"][thing.name], output)
        else:
            diffuse(material.node_tree, properties["materials"][thing.name], output)
        thing.data.materials.clear()
        thing.data.materials.append(material)


def diffuse(tree: bpy.types.NodeTree, described: dict[str, Any], output: bpy.types.Node) -> None:
    """Make a diffuse surface, black from behind if it is so."""
    front = tree.nodes.new("ShaderNodeBsdfDiffuse")
    fill(front, can(described)["inputs"])
    shader = front.outputs[0]
    if not described["two_sided"]:
        back, mix = tree.nodes.new("ShaderNodeBsdfDiffuse"), tree.nodes.new("ShaderNodeMixShader")
        fill(back, {"Color": (0, 0, 0, 1)})
        tree.links.new(tree.nodes.new("ShaderNodeNewGeometry").outputs["Backfacing"], mix.inputs[0])
        tree.links.new(shader, mix.inputs[1])
        tree.links.new(back.outputs[0], mix.inputs[2])
        shader = mix.outputs[0]
    tree.links.new(shader, output.inputs["Surface"])


def volume(tree: bpy.types.NodeTree, described: dict[str, Any], output: bpy.types.Node) -> None:
    """Make a homogeneous medium."""
    node = tree.nodes.new("ShaderNodeVolumeCoefficients")
    node.phase = can(described)["phase"]
    fill(node, described["inputs"])
    tree.links.new(node.outputs[0], output.inputs["Volume"])


def fill(node: bpy.types.Node, inputs: dict[str, Any]) -> None:
    """Give values to the inputs of a node."""
    for name, value in inputs.items():
        node.inputs[name].default_value = value


if __name__ == "__main__":
    main()
