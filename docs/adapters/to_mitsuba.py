# SPDX-License-Identifier: BSD-3-Clause
"""Bring a level out of Blender: write what it renders as a Mitsuba scene, which airlight reads. No
adapter. See docs/engines/blender.md.

    blender level.blend --background --python docs/adapters/to_mitsuba.py -- level.xml
    python docs/adapters/to_mitsuba.py level.blend level.xml

The second line needs a Python with `bpy`, which `blender.py` looks for. The level is that of a
render, in the active view layer and at the current frame, and its numbers give the image of Cycles
with one scattering. Lengths become metres by the unit scale of the scene; powers and densities
follow, so that the image stays. Blender 5.0.1 was tried.

`mitsuba_parts.py` converts numbers, without Blender; `blender_parts.py` reads cameras, lights and
nodes.
"""

import argparse
import os
import re
import sys
import traceback
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NoReturn

sys.path.insert(0, str(Path(__file__).resolve().parent))

from blender import MISSING, WRONG, end, find_bpy

try:
    import numpy as np
except ImportError:
    find_bpy("to_mitsuba")  # starts again with a Python that has both
    raise

from blender_parts import (
    Camera,
    Surface,
    background_of,
    camera_of,
    check_visible,
    lamp_of,
    medium_of,
    output_of,
    source,
    surface_of,
    volume_node,
)
from mitsuba_parts import (
    Array,
    CannotError,
    Index,
    Medium,
    camera_xml,
    is_inside,
    lamp_xml,
    medium_xml,
    ply_bytes,
    rgb,
    surface_xml,
    tag,
    write_files,
)

#: Objects that render nothing themselves: meshes of curves, texts and metaballs are instances.
_NOTHING = (
    *("ARMATURE", "CAMERA", "CURVE", "EMPTY", "FONT", "LATTICE", "LIGHT_PROBE", "META"),
    *("SPEAKER", "SURFACE"),
)


@dataclass(frozen=True)
class Options:
    """The command line."""

    output: Path
    level: str | None  #: the file to open; None for the open one
    skip: bool  #: whether parts that a scene cannot say are left out
    sharp: bool  #: whether lights lose their radius and angle
    grey: float | None  #: reflectance of surfaces that have no constant colour


@dataclass(frozen=True)
class Volume:
    """A closed mesh around a medium."""

    vertices: Array  #: [m]
    faces: Index
    medium: Medium


@dataclass
class Level:
    """A level, which is read part by part."""

    options: Options
    unit: float = 1.0  #: length of Blender's unit [m]
    camera: Camera | None = None
    lights: list[str] = field(default_factory=list)  #: XML
    world: Medium | None = None
    volumes: dict[str, Volume] = field(default_factory=dict)
    #: the surface of each mesh, and its corners by triangles, (n, 3, 3) [m] or with normals 6
    meshes: dict[str, tuple[Surface, list[Array]]] = field(default_factory=dict)
    refused: dict[str, str] = field(default_factory=dict)  #: why, by the name of a part
    notes: dict[str, None] = field(default_factory=dict)  #: in their order, each once
    names: dict[object, str] = field(default_factory=dict)

    def name(self, key: object, words: str) -> str:
        """Return the id of a part, a plain word that no other part has."""
        if key not in self.names:
            plain = re.sub(r"[^A-Za-z0-9_]+", "-", words).strip("-") or "part"
            number, name, used = 1, plain, {each.lower() for each in self.names.values()}
            while name.lower() in used:
                number += 1
                name = f"{plain}-{number}"
            self.names[key] = name
        return self.names[key]

    def attempt(self, name: str, read: Callable[["Level", Any], None], part: Any) -> None:
        """Read a part of the level, or keep why it cannot be said."""
        try:
            read(self, part)
        except CannotError as error:
            self.refused[name] = str(error)

    def note(self, words: str) -> None:
        """Keep what the user should know, once."""
        self.notes[words] = None


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        """End with one line."""
        end(WRONG, f"to_mitsuba: {message}")


def main() -> None:
    """Read the command line, and write the files."""
    options = read_options()
    find_bpy("to_mitsuba")
    import bpy

    # Before 5.0 an area light of Cycles is darker, by pi/4, and lights lack properties.
    if bpy.app.version < (5, 0):
        end(MISSING, f"to_mitsuba: Blender is {bpy.app.version_string}; expected 5.0 or newer")
    if options.level is not None:
        try:
            bpy.ops.wm.open_mainfile(filepath=os.path.abspath(options.level))
        except RuntimeError as error:
            end(WRONG, f"to_mitsuba: {options.level}: {str(error).removeprefix('Error: ')}")
    level = read_level(options)
    # Each refusal is a line. Nothing is written then, unless these parts may be left out.
    for name, why in level.refused.items():
        print(f"{'left out' if options.skip else 'cannot'}: {name}: {why}", file=sys.stderr)
    if level.camera is None or (level.refused and not options.skip):
        way = "a scene needs its camera" if options.skip else "change these, or --skip them"
        end(WRONG, f"to_mitsuba: nothing was written: {way}")
    try:
        options.output.absolute().parent.mkdir(parents=True, exist_ok=True)
        write_files(files_of(level, level.camera))
    except OSError as error:
        end(WRONG, f"to_mitsuba: {error.filename}: {error.strerror}")
    for note in level.notes:
        print(f"note: {note}", file=sys.stderr)
    counts = f"{len(level.meshes)} meshes, {len(level.lights)} emitters"
    print(f"{options.output}: {counts}, {len(level.volumes)} bounded media", flush=True)


def read_options() -> Options:
    """Return the command line, which in Blender stands behind `--`; end with a line if wrong."""
    inside = "--" in sys.argv
    parser = _Parser(prog="to_mitsuba.py", description=(__doc__ or "").partition("\n\n")[0])
    if not inside:
        parser.add_argument("level", help="the .blend file")
    parser.add_argument("output", help="the .xml file; its meshes are written beside it")
    parser.add_argument("--skip", action="store_true", help="leave out what a scene cannot say")
    sharp = "take lights without their radius and angle: shadows have sharp edges"
    parser.add_argument("--sharp", action="store_true", help=sharp)
    grey = "the reflectance of surfaces that have no constant diffuse colour, such as 0.5"
    parser.add_argument("--grey", type=float, metavar="VALUE", help=grey)
    chosen = parser.parse_args(sys.argv[sys.argv.index("--") + 1 :] if inside else None)
    output, opened = Path(chosen.output), None if inside else chosen.level
    if output.suffix != ".xml":
        parser.error(f"got {output}, expected a name that ends in .xml")
    if opened is not None and not os.path.isfile(opened):
        parser.error(f"{opened}: no such file; expected a .blend file")
    if chosen.grey is not None and not 0 <= chosen.grey <= 1:
        parser.error(f"--grey: got {chosen.grey:g}, expected a reflectance from 0 to 1")
    return Options(output, opened, chosen.skip, chosen.sharp, chosen.grey)


def read_level(options: Options) -> Level:
    """Return the open level as a render sees it: with modifiers and instances as in a render, and
    without what is hidden there.
    """
    import bpy

    level, failed = Level(options), []

    # A render engine is given the scene of a render, any other script that of the viewport.
    # `bpy` has no types.
    class Reader(bpy.types.RenderEngine):  # type: ignore[misc]  # bpy has no types
        bl_idname, bl_label = "AIRLIGHT_TO_MITSUBA", "to_mitsuba"

        def render(self, depsgraph: Any) -> None:
            try:
                _read(level, depsgraph)
            except Exception:  # Blender would print it and go on
                failed.append(traceback.format_exc())

    scene = bpy.context.scene
    if scene.camera is None:
        level.refused["camera"] = "there is none; expected an active camera"
        return level
    bpy.utils.register_class(Reader)
    scene.render.engine = Reader.bl_idname
    scene.render.use_compositing = scene.render.use_sequencer = False
    bpy.ops.render.render(layer=bpy.context.view_layer.name)
    bpy.utils.unregister_class(Reader)
    if failed:
        raise RuntimeError(failed[0])
    if level.world is None and not level.volumes:
        level.note("the level has no volume, and airlight needs fog: add one to the World")
    return level


def _read(level: Level, depsgraph: Any) -> None:
    """Fill a level."""
    scene = depsgraph.scene_eval
    level.unit = scene.unit_settings.scale_length
    level.attempt(f"camera '{scene.camera.name}'", _camera, scene)
    # The world first: suns and bounded media depend on its volume.
    if scene.world is not None:
        level.attempt(f"world '{scene.world.name}'", _world, scene.world)
    readers = {"LIGHT": _light, "MESH": _mesh}
    for instance in depsgraph.object_instances:
        thing = instance.object
        if thing.type in _NOTHING or not instance.show_self:
            continue
        name = f"{thing.type.lower()} '{thing.name}'"
        level.attempt(name, readers.get(thing.type, _no_triangles), instance)


def _no_triangles(level: Level, instance: Any) -> None:
    raise CannotError(f"a {instance.object.type} has no triangles; expected a mesh")


def _camera(level: Level, scene: Any) -> None:
    name, lens = level.name("camera", scene.camera.name), scene.camera.data
    level.camera = camera_of(scene, name, level.unit)
    clip = f"its Clip, {lens.clip_start:g} to {lens.clip_end:g}, is not used"
    level.note(f"camera '{scene.camera.name}': {clip}: fog begins at the camera and does not end")


def _world(level: Level, world: Any) -> None:
    output = output_of(world.node_tree)
    if output is None:
        return
    # The volume of the world is around all; no light of a background comes through it.
    volume, background = source(output.inputs["Volume"]), source(output.inputs["Surface"])
    medium = None if volume is None else medium_of(volume, level.unit)
    level.world = medium if medium is not None and medium.sigma_t.any() else None
    if background is None:
        return
    if level.world is not None:
        level.note(f"world '{world.name}': nothing of its background comes through its volume")
        return
    radiance = background_of(background)
    if radiance.any():
        flags = getattr(world, "cycles_visibility", None)  # missing where the add-on is off
        if flags and not (flags.diffuse and flags.scatter):
            raise CannotError("it lights a part of the scene; expected its Ray Visibility on")
        sky = tag(
            "emitter", rgb("radiance", radiance), type="constant", id=level.name("sky", "sky")
        )
        level.lights.append(sky)


def _light(level: Level, instance: Any) -> None:
    thing = instance.object
    check_visible(instance, "visible_diffuse", "visible_volume_scatter")
    lamp = lamp_of(thing.data, instance.matrix_world, level.unit)
    if lamp.kind == "SUN" and level.world is not None:
        raise CannotError("the volume of the World lets no sun in; expected it in a mesh")
    name = level.name((thing.name, "light", *lamp.matrix.ravel()), thing.name)
    emitters = lamp_xml(name, lamp, sharp=level.options.sharp)
    level.lights += emitters if lamp.power.any() else []
    if len(emitters) > 1:
        pieces = f"{len(emitters)} spots, within 0.6 % of its intensity"
        level.note(f"light '{thing.name}': its soft edge becomes {pieces}")


def _mesh(level: Level, instance: Any) -> None:
    thing = instance.object
    check_visible(instance, "visible_camera", "visible_shadow")
    if any(each.settings.type == "HAIR" for each in thing.particle_systems):
        raise CannotError("it has hair; expected meshes alone")
    mesh = thing.to_mesh()
    mesh.calc_loop_triangles()
    slots = [slot.material for slot in thing.material_slots] or [None]
    number = np.minimum(_values(mesh.loop_triangles, "material_index", "i")[:, 0], len(slots) - 1)
    # Places in metres. A mirrored mesh has its triangles turned, so that fronts stay fronts.
    matrix = np.array(instance.matrix_world, dtype=np.float64)
    linear, mirrored = matrix[:3, :3], np.linalg.det(matrix[:3, :3]) < 0
    turn = [0, 2, 1] if mirrored else [0, 1, 2]
    vertices = (_values(mesh.vertices, "co", "f", 3) @ linear.T + matrix[:3, 3]) * level.unit
    faces = _values(mesh.loop_triangles, "vertices", "i", 3)[:, turn]
    triangles = vertices[faces]
    # Normals turn by the cofactors, which are the inverse transposed matrix times its determinant.
    if mesh.normals_domain != "FACE":
        cofactors = np.cross(linear[:, [1, 2, 0]], linear[:, [2, 0, 1]], axis=0)
        normals = _values(mesh.corner_normals, "vector", "f", 3) @ cofactors.T
        normals /= np.maximum(np.linalg.norm(normals, axis=1), 1e-30)[:, None]  # not by 0
        corners = normals[_values(mesh.loop_triangles, "loops", "i", 3)[:, turn]]
        triangles = np.concatenate([triangles, -corners if mirrored else corners], axis=2)
    thing.to_mesh_clear()
    # A mesh with a volume bounds it, and is nothing else; volumes of Cycles add up.
    used = [slots[index] for index in np.unique(number)]
    volumes = [node for node in map(volume_node, used) if node is not None]
    if volumes:
        if len(used) > 1 or source(output_of(used[0].node_tree).inputs["Surface"]) is not None:
            raise CannotError("it has a volume and a surface; expected one, or two meshes")
        medium = medium_of(volumes[0], level.unit)
        medium = medium if level.world is None else level.world + medium
        name = level.name((thing.name, "volume", *matrix.ravel()), thing.name)
        level.volumes |= {name: Volume(vertices, faces, medium)} if medium.sigma_t.any() else {}
        return
    # Triangles by material. Instances of an object are one mesh.
    surfaces = [_surface(level, thing.name, material) for material in used]
    for index, surface in zip(np.unique(number), surfaces):
        words = thing.name if len(used) == 1 else f"{thing.name}-{index + 1}"
        material = slots[index] and slots[index].name_full
        name = level.name((thing.original.name_full, material, triangles.shape[2]), words)
        level.meshes.setdefault(name, (surface, []))[1].append(triangles[number == index])


def _values(sequence: Any, name: str, kind: str, width: int = 1) -> Any:
    """Return a property of all members of a sequence, (n, width), whole numbers or floats."""
    values = np.empty(len(sequence) * width, dtype=np.int32 if kind == "i" else np.float32)
    sequence.foreach_get(name, values)
    return values.reshape(-1, width).astype(np.int64 if kind == "i" else np.float64)


def _surface(level: Level, name: str, material: Any) -> Surface:
    try:
        surface = surface_of(material)
    except CannotError as error:
        if level.options.grey is None:
            raise CannotError(f"{error}; --grey 0.5 takes such surfaces as grey") from error
        level.note(f"mesh '{name}' is grey: {error}")
        return Surface(np.full(3, level.options.grey))
    if surface.left:
        left = ", ".join(surface.left)
        level.note(f"material '{material.name}': its diffuse part is taken, without {left}")
    return surface


def files_of(level: Level, camera: Camera) -> list[tuple[Path, bytes]]:
    """Return the files of a level with their content, the scene last."""
    output, files, shapes = level.options.output, [], []
    # Media: that of the world, and those in meshes. The camera names the one around it.
    at_camera = None if level.world is None else level.name("world", "medium")
    media = [] if at_camera is None or level.world is None else [medium_xml(at_camera, level.world)]
    outside = [] if at_camera is None else [tag("ref", name="exterior", id=at_camera)]
    for name, volume in level.volumes.items():
        inside = level.name((name, "medium"), f"{name}-medium")
        path = output.with_suffix(f".{name}.ply")
        media.append(medium_xml(inside, volume.medium))
        files.append((path, ply_bytes(volume.vertices, volume.faces)))
        bounds = [tag("bsdf", type="null"), tag("ref", name="interior", id=inside), *outside]
        shapes.append(_ply(name, path, True, *bounds))
        if is_inside(volume.vertices, volume.faces, camera.matrix[:3, 3]):
            at_camera = inside
    # Surfaces: triangles share their equal corners.
    for name, (surface, parts) in level.meshes.items():
        path, triangles = output.with_suffix(f".{name}.ply"), np.concatenate(parts)
        rows = triangles.reshape(-1, triangles.shape[2]).astype(np.float32)
        corners, numbers = np.unique(rows, axis=0, return_inverse=True)
        normals = corners[:, 3:] if corners.shape[1] > 3 else None
        files.append((path, ply_bytes(corners[:, :3], numbers.reshape(-1, 3), normals)))
        material = surface_xml(surface.reflectance, two_sided=surface.two_sided)
        shapes.append(_ply(name, path, normals is None, material))
    sensor = camera_xml(camera.name, camera.matrix, camera.fov, camera.size, at_camera)
    scene = tag("scene", *media, sensor, *level.lights, *shapes, version="3.0.0")
    return [*files, (output, f'<?xml version="1.0" encoding="utf-8"?>\n{scene}\n'.encode())]


def _ply(name: str, path: Path, flat: bool, *inside: str) -> str:
    file = tag("string", name="filename", value=path.name)
    facets = tag("boolean", name="face_normals", value=str(flat).lower())
    return tag("shape", file, facets, *inside, type="ply", id=name)


if __name__ == "__main__":
    main()
