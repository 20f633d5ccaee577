# SPDX-License-Identifier: BSD-3-Clause
"""Render a scene of airlight by Blender's Cycles, from what `airlight describe` says of it and nothing else.

    airlight describe sphere-spot --size 160x120 --json --gltf sphere-spot.glb > sphere-spot.json
    python3.11 render_cycles.py sphere-spot.json sphere-spot.glb sphere-spot.exr --samples 512
    airlight compare sphere-spot sphere-spot.exr

The interpreter needs the module `bpy` (`pip install bpy==5.0.1` for Python 3.11), or run
`blender --background --python render_cycles.py -- sphere-spot.json ...`. With `--layers` the file is Blender's
multi-layer EXR, whose layer `ViewLayer.Volume Direct` is the airlight. Rendered with Blender 5.0.1.
"""

import argparse
import json
import math
import sys

import bpy
from mathutils import Matrix, Vector

FILTERS = {"box": "BOX", "blackman-harris": "BLACKMAN_HARRIS"}


def main() -> None:
    """Read the command line and render."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("described", help="what `airlight describe SCENE --json` printed")
    parser.add_argument("gltf", help="what `--gltf` wrote, for the meshes")
    parser.add_argument("output", help="the EXR file")
    parser.add_argument("--samples", type=int, default=512, help="paths per pixel")
    parser.add_argument("--layers", action="store_true", help="write a multi-layer file")
    parser.add_argument("--filter", choices=FILTERS, default="box", help="the pixel filter; Cycles' own is the latter")
    chosen = parser.parse_args(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else None)
    with open(chosen.described, encoding="utf-8") as stream:
        described = json.load(stream)
    scene = bpy.context.scene
    bpy.data.batch_remove(list(bpy.data.objects))  # the cube, the lamp and the camera that Blender starts with
    shapes(described, chosen.gltf)
    scene.camera = camera(described["camera"])
    for light in described["lights"]:
        lamp(light)
    world(scene, described["medium"])
    settings(scene, described["camera"]["size"], chosen)
    bpy.ops.render.render(write_still=True)


def shapes(described: dict, path: str) -> None:
    """Import the meshes, which is exact, and give them materials by name."""
    if described["surfaces"] or described["bounded_media"]:
        bpy.ops.import_scene.gltf(filepath=path)
    surfaces = {surface["name"]: surface for surface in described["surfaces"]}
    media = {medium["name"]: medium for medium in described["bounded_media"]}
    for thing in list(bpy.data.objects):
        if thing.type != "MESH":
            bpy.data.objects.remove(thing)  # camera and lights come from the description
            continue
        thing.data.materials.clear()
        thing.data.materials.append(diffuse(surfaces[thing.name]) if thing.name in surfaces else fog(media[thing.name]))
        thing.cycles.shadow_terminator_offset = thing.cycles.shadow_terminator_geometry_offset = 0


def diffuse(surface: dict) -> bpy.types.Material:
    """Return reflectance / pi, black from behind if the surface is so."""
    material, tree, output = empty_material(surface["name"])
    front = tree.nodes.new("ShaderNodeBsdfDiffuse")
    front.inputs["Color"].default_value = (*surface["reflectance"], 1)
    front.inputs["Roughness"].default_value = 0
    shader = front.outputs[0]
    if not surface["two_sided"]:
        back, mix = tree.nodes.new("ShaderNodeBsdfDiffuse"), tree.nodes.new("ShaderNodeMixShader")
        back.inputs["Color"].default_value = (0, 0, 0, 1)
        tree.links.new(tree.nodes.new("ShaderNodeNewGeometry").outputs["Backfacing"], mix.inputs[0])
        tree.links.new(shader, mix.inputs[1])
        tree.links.new(back.outputs[0], mix.inputs[2])
        shader = mix.outputs[0]
    tree.links.new(shader, output.inputs["Surface"])
    return material


def fog(medium: dict) -> bpy.types.Material:
    """Return a body that is nothing but a medium."""
    material, tree, output = empty_material(medium["name"])
    tree.links.new(coefficients(tree, medium), output.inputs["Volume"])
    return material


def empty_material(name: str) -> tuple:
    """Return a material, its nodes, and the node where they end."""
    material = bpy.data.materials.new(name)
    material.node_tree.nodes.clear()
    return material, material.node_tree, material.node_tree.nodes.new("ShaderNodeOutputMaterial")


def coefficients(tree: bpy.types.NodeTree, medium: dict) -> bpy.types.NodeSocket:
    """Return a homogeneous medium by sigma_s and sigma_a [1/m], which no colour picker touches."""
    kinds = {"isotropic": "HENYEY_GREENSTEIN", "hg": "HENYEY_GREENSTEIN", "rayleigh": "RAYLEIGH"}
    node = tree.nodes.new("ShaderNodeVolumeCoefficients")
    node.phase = kinds[medium["phase"]["name"]]
    if node.phase == "HENYEY_GREENSTEIN":
        node.inputs["Anisotropy"].default_value = medium["phase"].get("g", 0)
    node.inputs["Scatter Coefficients"].default_value = medium["sigma_s"]
    node.inputs["Absorption Coefficients"].default_value = medium["sigma_a"]
    return node.outputs[0]


def camera(described: dict) -> bpy.types.Object:
    """Return a pinhole; Blender's looks along -z."""
    data = bpy.data.cameras.new("camera")
    data.sensor_fit, data.angle = "HORIZONTAL", math.radians(described["fov_horizontal"])
    data.clip_start, data.clip_end = 1e-6, 1e6
    backward = -Vector(described["forward"])
    return placed("camera", data, (described["right"], described["up"], backward), described["position"])


def lamp(described: dict) -> None:
    """Add a light without size; its power is that of a lamp that shines as on its axis in all directions."""
    directional = described["kind"] == "directional"
    colour = described["irradiance" if directional else "intensity"]
    brightest = max(colour)
    data = bpy.data.lights.new("lamp", {"point": "POINT", "spot": "SPOT", "directional": "SUN"}[described["kind"]])
    data.color = [value / brightest for value in colour]
    data.energy = brightest if directional else 4 * math.pi * brightest
    if directional:
        data.angle = 0
    else:
        data.shadow_soft_size, data.use_soft_falloff = 0, False
    if data.type == "SPOT":
        if described["beam_angle"] < described["cutoff_angle"]:
            raise SystemExit("the edge of Blender's spots is another function of the angle: choose a scene without")
        data.spot_size, data.spot_blend = 2 * math.radians(described["cutoff_angle"]), 0  # the whole angle
    backward = -Vector(described.get("axis", (0, 0, -1)))
    side = backward.orthogonal().normalized()
    placed("lamp", data, (side, backward.cross(side), backward), described.get("position", (0, 0, 0)))


def placed(name: str, data: bpy.types.ID, axes: tuple, position: list[float]) -> bpy.types.Object:
    """Put something into the scene, with its axes as columns."""
    thing = bpy.data.objects.new(name, data)
    thing.matrix_world = Matrix.Translation(position) @ Matrix(axes).transposed().to_4x4()
    bpy.context.collection.objects.link(thing)
    return thing


def world(scene: bpy.types.Scene, medium: dict | None) -> None:
    """Fill all space with a medium, behind a black sky."""
    scene.world = bpy.data.worlds.new("world")
    tree = scene.world.node_tree
    tree.nodes.clear()
    if medium is not None:
        output = tree.nodes.new("ShaderNodeOutputWorld")
        tree.links.new(coefficients(tree, medium), output.inputs["Volume"])


def settings(scene: bpy.types.Scene, size: list[int], chosen: argparse.Namespace) -> None:
    """Ask for single scattering, without clamps, denoiser, or a view transform."""
    scene.render.engine = "CYCLES"
    cycles = scene.cycles
    cycles.device, cycles.samples, cycles.seed = "CPU", chosen.samples, 1
    cycles.use_adaptive_sampling = cycles.use_denoising = False
    # No bounce at all: light - one scattering or reflection - eye.
    cycles.max_bounces = cycles.diffuse_bounces = cycles.volume_bounces = 0
    cycles.transparent_max_bounces = 1024  # the bounds of media are crossed as transparent surfaces
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0
    cycles.light_sampling_threshold = 0
    cycles.pixel_filter_type = FILTERS[chosen.filter]
    render = scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = *size, 100
    render.filepath, render.use_file_extension = chosen.output, False
    image = render.image_settings
    if chosen.layers:
        scene.view_layers[0].cycles.use_pass_volume_direct = True
        image.media_type = "MULTI_LAYER_IMAGE"
    else:
        image.file_format, image.color_mode = "OPEN_EXR", "RGB"
    image.color_depth, image.exr_codec = "32", "ZIP"


if __name__ == "__main__":
    main()
