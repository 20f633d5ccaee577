# SPDX-License-Identifier: BSD-3-Clause
"""Run by a Python that has `bpy`: levels as an artist makes them, and their images by Cycles.

    PYTHON tests/helpers/blender_level.py NAME OUT.blend [OUT.exr SAMPLES]

`world` has a soft spot in a Principled Volume, `bank` a sun and fog in a mesh, `lamps` three lights
with a size above the view in fog, `refused` what no scene can say.
"""

import sys
from pathlib import Path
from typing import Any

import bpy

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "docs" / "examples"))

from cycles_properties import cycles_properties
from render_cycles import assign

SIZE = (48, 36)


def added(kind: str, **given: Any) -> Any:
    """Add a mesh by its operator, and return it."""
    getattr(bpy.ops.mesh, f"primitive_{kind}_add")(**given)
    return bpy.context.object


def painted(thing: Any, colour: tuple[float, float, float]) -> Any:
    """Give an object a Principled BSDF without gloss, and return the node."""
    material = bpy.data.materials.new(thing.name)
    node = material.node_tree.nodes["Principled BSDF"]
    node.inputs["Base Color"].default_value = (*colour, 1.0)
    node.inputs["Specular IOR Level"].default_value = 0.0
    thing.data.materials.clear()
    thing.data.materials.append(material)
    return node


def lamp(kind: str, place: Any = (0.6, -1.1, 4.1), **given: Any) -> Any:
    """Add a light that shines down."""
    made = bpy.data.objects.new(kind.lower(), bpy.data.lights.new(kind.lower(), kind))
    made.location, made.rotation_euler = place, (0.2, 0.3, 0.4)
    assign(made.data, {"color": (1.0, 0.8, 0.6), **given})
    bpy.context.scene.collection.objects.link(made)
    return made


def props() -> None:
    """Make a cube with posts that hang on it, a floor, and instances of a smooth head."""
    cube = bpy.data.objects["Cube"]
    painted(cube, (0.61, 0.37, 0.29))
    cube.location, cube.rotation_euler = (0.3, 0.2, 0.9), (0.3, 0.2, 0.7)
    cube.scale = (0.7, 0.5, 0.6)
    painted(added("plane", size=14, location=(0, 0, -0.4)), (0.47, 0.53, 0.41))
    post = painted_post(cube)
    row = post.modifiers.new("row", "ARRAY")
    row.count, row.relative_offset_displace = 3, (3.1, 0.4, 0)
    # A head that is finer in renders, as two instances of a collection, one of them mirrored.
    head = added("monkey")
    painted(head, (0.7, 0.2, 0.5))
    head.scale = (0.5, 0.5, 0.5)
    head.data.shade_smooth()
    finer = head.modifiers.new("finer", "SUBSURF")
    finer.levels, finer.render_levels = 0, 1
    heads = bpy.data.collections.new("heads")
    for owner in head.users_collection:
        owner.objects.unlink(head)
    heads.objects.link(head)
    for place, turn, scale in (((-1.6, -0.4, 0.5), 0.4, 1.0), ((-0.9, 1.7, 0.6), -2.1, -1.3)):
        empty = bpy.data.objects.new("heads", None)
        empty.instance_type, empty.instance_collection = "COLLECTION", heads
        empty.location, empty.rotation_euler = place, (0, 0, turn)
        empty.scale = (scale, abs(scale), abs(scale))
        bpy.context.scene.collection.objects.link(empty)
    added("uv_sphere", location=(0, -2, 1), radius=0.9).hide_render = True


def painted_post(parent: Any) -> Any:
    """Return a post that moves with its parent, and has no material."""
    post = added("cylinder", vertices=12, radius=0.13, depth=2.1)
    post.parent, post.location, post.rotation_euler = parent, (2.1, -1.1, 0.1), (0.2, -0.1, 0)
    return post


def volume(tree: Any, kind: str, **given: Any) -> Any:
    """Return a new node of a volume with these inputs."""
    node = tree.nodes.new(f"ShaderNode{kind}")
    for name, value in given.items():
        node.inputs[name.replace("_", " ")].default_value = value
    return node


def fog(scene: Any) -> None:
    """Fill the world."""
    tree = scene.world.node_tree
    colours = {"Color": (0.81, 0.72, 0.63, 1), "Absorption_Color": (0.2, 0.1, 0.3, 1)}
    node = volume(tree, "VolumePrincipled", Density=0.11, Anisotropy=0.31, **colours)
    tree.links.new(node.outputs[0], tree.nodes["World Output"].inputs["Volume"])


def bank() -> None:
    """Make a mirrored box of fog that scatters by one node and absorbs by another."""
    box = added("cube", size=1, location=(0.2, 0.1, 1.2))
    box.scale, box.rotation_euler, box.name = (-7.1, 6.3, 3.1), (0, 0, 0.2), "bank"
    material = bpy.data.materials.new("bank")
    tree = material.node_tree
    tree.nodes.clear()
    sums, out = tree.nodes.new("ShaderNodeAddShader"), tree.nodes.new("ShaderNodeOutputMaterial")
    scatter = {"Color": (0.9, 0.7, 0.5, 1), "Density": 0.13, "Anisotropy": 0.31}
    first = volume(tree, "VolumeScatter", **scatter)
    second = volume(tree, "VolumeAbsorption", Color=(0.4, 0.6, 0.8, 1), Density=0.07)
    tree.links.new(first.outputs[0], sums.inputs[0])
    tree.links.new(second.outputs[0], sums.inputs[1])
    tree.links.new(sums.outputs[0], out.inputs["Volume"])
    box.data.materials.append(material)


def level(name: str) -> None:
    """Make a level."""
    scene = bpy.context.scene
    bpy.data.objects.remove(bpy.data.objects["Light"])
    props()
    lens = scene.camera.data
    scene.camera.location, scene.camera.rotation_euler = (4.1, -5.3, 2.7), (1.257, 0.04, 0.663)
    lens.sensor_fit, lens.sensor_height, lens.lens = "VERTICAL", 20, 24
    scene.render.resolution_x, scene.render.resolution_y = 2 * SIZE[0], 2 * SIZE[1]
    scene.render.resolution_percentage = 50
    sharp = {"shadow_soft_size": 0.0}
    if name != "bank":
        fog(scene)
    if name == "world":
        scene.unit_settings.scale_length = 0.37
        lamp("SPOT", energy=700, exposure=0.5, spot_size=1.1, spot_blend=0.6, **sharp)
    if name == "bank":
        bank()
        lamp("SUN", energy=3, angle=0)
        scene.world.node_tree.nodes["Background"].inputs["Strength"].default_value = 0
    if name == "lamps":
        scene.render.resolution_percentage = 25  # a reference of these is costly
        area = {"size": 0.8, "size_y": 0.5, "shape": "RECTANGLE"}
        lamp("AREA", energy=300, **area).scale = (-1.2, 1.2, 1.2)
        lamp("AREA", (-2.1, 0.3, 4.4), energy=90, size=0.6, shape="DISK").name = "disk"
        given = {"shadow_soft_size": 0.3, "use_soft_falloff": False}
        lamp("POINT", (1.6, 2.3, 4.6), energy=110, **given)
    if name == "refused":
        lamp("POINT", energy=9, shadow_soft_size=0.1)
        lamp("SUN", energy=3, angle=0)
        lamp("SPOT", energy=9, use_shadow=False, **sharp)
        node = painted(added("cube", location=(0, 0, 3)), (1, 1, 1))
        bpy.context.object.name = "window"
        node.inputs["Transmission Weight"].default_value = 1.0
        bpy.ops.object.volume_add()
        lamp("POINT", (0.6, -1.1, 3.1), energy=300, **sharp).name = "last"


def render(path: str, samples: int) -> None:
    """Render the level as the adapter of Cycles does, into layers."""
    scene = bpy.context.scene
    kept = scene.unit_settings.scale_length
    camera = {"size": SIZE, "fov_horizontal": 60.0, "right": (1, 0, 0), "up": (0, 1, 0)}
    camera |= {"forward": (0, 0, -1), "position": (0, 0, 0)}
    lists: dict[str, Any] = {"lights": [], "bounded_media": [], "surfaces": []}
    properties = cycles_properties({"camera": camera, "medium": None, "up": "z", **lists})
    size = {"render.resolution_x", "render.resolution_y", "render.resolution_percentage"}
    values = {key: value for key, value in properties["scene"].items() if key not in size}
    narrow = {"cycles.pixel_filter_type": "GAUSSIAN", "cycles.filter_width": 0.01}
    count = {"cycles.device": "CPU", "cycles.samples": samples, "cycles.seed": 1}
    assign(scene, {**values, **narrow, **count, "unit_settings.scale_length": kept})
    for thing in bpy.data.objects:
        assign(thing, properties["objects"])
    assign(scene.camera.data, {"clip_start": 1e-6, "clip_end": 1e6})
    scene.view_layers[0].cycles.use_pass_volume_direct = True
    assign(scene.render.image_settings, properties["layered_image_settings"])
    scene.render.filepath, scene.render.use_file_extension = path, False
    bpy.ops.render.render(write_still=True)


if __name__ == "__main__":
    level(sys.argv[1])
    bpy.ops.wm.save_as_mainfile(filepath=sys.argv[2])
    if len(sys.argv) > 3:
        render(sys.argv[3], int(sys.argv[4]))
