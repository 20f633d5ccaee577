# SPDX-License-Identifier: BSD-3-Clause
"""`airlight describe SCENE`: everything to set in another renderer; of a folder, which of its scenes are taken."""

from pathlib import Path
from typing import Annotated

import typer

from reports.commands.options import Json, Markdown, Meshes, Ranges, Scene, Size, drawn_from


def describe(
    scene: Scene,
    size: Size = None,
    meshes: Meshes = None,
    ranges: Ranges = None,
    gltf: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Write the scene as binary glTF 2.0, a .glb file.", show_default=False),
    ] = None,
    markdown: Markdown = False,
    json: Json = False,
) -> None:
    """Print all that another renderer needs to render a scene.

    Its image can then be judged, by `airlight compare SCENE IMAGE.exr`. Camera, media, lights, surfaces, what the
    pixels hold and what file to write. The glTF file has the same camera, lights and meshes; media are in its
    extras.

    Of a folder it prints what becomes of each .xml file in it: taken with which notes, or refused with which words.
    """
    from analytic.errors import InputError
    from reference.storage.files import ensure_writable
    from reports.interchange.gltf import write_gltf
    from reports.interchange.scene import describe_scene
    from reports.machine.environment import activate
    from reports.machine.printing import print_notes
    from reports.tables.scene import description_text
    from reports.tables.terminal import print_json, terminal_width
    from validation.scenes.loading import load_scene, parse_size

    if Path(scene).is_dir():
        _describe_folder(Path(scene), alone=not (size or meshes or ranges or gltf), markdown=markdown, json=json)
        return
    if markdown:
        raise InputError("--markdown: got a scene; wanted a folder of .xml files, or no --markdown")
    if gltf is not None:
        if gltf.suffix.lower() != ".glb":
            raise InputError(f"--gltf: got {gltf}, wanted a name that ends in .glb, for example {gltf.stem}.glb")
        ensure_writable(gltf)
    pixels = parse_size(size) if size else None
    activate()
    (scene,) = drawn_from([scene], meshes, ranges)
    loaded = load_scene(scene, pixels)
    described = describe_scene(loaded)
    written = None if gltf is None else write_gltf(gltf, loaded)
    print_notes(described["notes"])
    if json:
        print_json(described | ({} if written is None else {"gltf": written}))
        return
    print(description_text(described, terminal_width() or 120))
    if written is not None:
        cut = ", ".join(written["tessellated"])
        print(f"{written['path']}: {written['triangles']} triangles" + (f"; cut into triangles: {cut}" if cut else ""))


def _describe_folder(folder: Path, *, alone: bool, markdown: bool, json: bool) -> None:
    """Print what becomes of each scene file of a folder."""
    from analytic.errors import InputError
    from reports.interchange.folder import describe_folder, folder_data, folder_table
    from reports.machine.environment import activate
    from reports.machine.printing import print_tables
    from reports.tables.terminal import print_json

    if not alone:
        raise InputError(f"scene: got the folder {folder}; wanted --json, --markdown or no option with it")
    activate()
    outcomes = describe_folder(folder)
    if json:
        print_json(folder_data(folder, outcomes))
        return
    print_tables([folder_table(outcomes)], as_markdown=markdown)
