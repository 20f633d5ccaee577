# SPDX-License-Identifier: BSD-3-Clause
"""A scene file made into Mitsuba's scene: parsed, repaired, built."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

import mitsuba as mi

from airlight.errors import InputError, MissingError
from airlight.reference.storage.files import temporary_folder
from airlight.reference.storage.scene_digest import description_digest, give_description
from airlight.validation.scenes.changes import give_lobes
from airlight.validation.scenes.files.advice import check_colours, check_files, in_words
from airlight.validation.scenes.files.camera import Lens, check_camera, clip_notes, lens_of
from airlight.validation.scenes.files.grids import give_grids
from airlight.validation.scenes.files.media import (
    give_extinction,
    give_own_parts,
    grey_densities,
    mirrored_grids,
    pass_where_no_material,
)
from airlight.validation.scenes.files.nodes import (
    child,
    kind,
    name_nodes,
    of_kind,
    properties,
    references,
)
from airlight.validation.scenes.files.references import leave_out_media, touching
from airlight.validation.scenes.files.shapes import (
    cylinders_as_meshes,
    lamps_as_rectangles,
    rooms_as_boxes,
    write_out_instances,
)
from airlight.validation.scenes.files.text import check_text
from airlight.validation.scenes.names import is_pbrt
from airlight.validation.scenes.pbrt.translate import translate

_TAKEN = {
    "Emitter": ("point", "spot", "directional", "area", "constant", "envmap"),
    "Medium": ("homogeneous", "heterogeneous"),
    "PhaseFunction": ("isotropic", "hg", "rayleigh", "tabphase"),
}
_WORDS = {"Emitter": "light", "Medium": "medium", "PhaseFunction": "phase function"}
_COLOURS = {
    "point": "intensity",
    "spot": "intensity",
    "directional": "irradiance",
    "area": "radiance",
}
_TEXTURES = ("bitmap", "checkerboard", "mesh_attribute", "volume")
_FILM = ("width", "height", "crop_width", "crop_height", "crop_offset_x", "crop_offset_y")


def read_file(
    path: Path,
    lobes: Mapping[str, float] = MappingProxyType({}),
) -> tuple[mi.Object, Lens | None]:
    """Read a scene file: an `mi.Scene` with the lens of its first camera, or another object of
    Mitsuba where the file has no scene.

    Isotropic media get the mean cosines that `lobes` has for their ids. Features that no command
    can take are refused.
    """
    config = mi.parser.ParserConfig(mi.variant())
    # The resolver is global in Mitsuba: files beside this scene must not be found from the next
    # one.
    resolver = mi.file_resolver()
    try:
        mi.set_file_resolver(mi.FileResolver(resolver))
        mi.file_resolver().prepend(str(path.parent))
        if is_pbrt(path):
            return _translated(config, path, lobes)
        check_text(path)
        return _built(config, _parsed(config, path), path, lobes)
    except (InputError, MissingError):
        raise
    # Mitsuba raises RuntimeError for all bad input; Python plugins raise anything
    except Exception as error:
        raise InputError(f"scene {path}: Mitsuba cannot read it: {in_words(error)}") from error
    finally:
        mi.set_file_resolver(resolver)


def _translated(
    config: mi.parser.ParserConfig, path: Path, lobes: Mapping[str, float]
) -> tuple[mi.Object, Lens | None]:
    """Read a file of pbrt: its translation is treated as every other file."""
    # The meshes of the translation are files, which must be there until the scene is built.
    with temporary_folder() as folder:
        translation = translate(path, folder)
        for note in translation.notes:
            mi.Log(mi.LogLevel.Warn, note)
        state = mi.parser.parse_string(config, translation.xml)
        return _built(config, _resolved(config, state), path, lobes)


def _parsed(config: mi.parser.ParserConfig, path: Path) -> mi.parser.ParserState:
    """Return the nodes of a file, with the names that Mitsuba 3 gives to everything,
    and references as numbers.

    Meshes are not merged, as `mi.load_file` would: shapes keep their names, and two
    bodies of a medium stay two.
    """
    text = path.read_text(encoding="utf-8", errors="replace")
    if "<lookAt" in text:  # of version 0.5, which Mitsuba's own upgrade leaves out
        state = mi.parser.parse_string(config, re.sub(r"(</?)lookAt\b", r"\1lookat", text))
    else:
        state = mi.parser.parse_file(config, str(path))
    return _resolved(config, state)


def _resolved(
    config: mi.parser.ParserConfig, state: mi.parser.ParserState
) -> mi.parser.ParserState:
    mi.parser.transform_upgrade(config, state)
    mi.parser.transform_resolve(config, state)
    mi.parser.transform_merge_equivalent(
        config, state
    )  # a medium written twice is one: its neighbours may reference it
    return state


def _built(
    config: mi.parser.ParserConfig,
    state: mi.parser.ParserState,
    path: Path,
    lobes: Mapping[str, float],
) -> tuple[mi.Object, Lens | None]:
    if kind(state, 0) != "Scene":
        return mi.parser.instantiate(config, state), None
    _mend(state, path)
    cameras = of_kind(state, "Sensor")
    lens = lens_of(properties(state, cameras[0])) if cameras else None
    give_lobes(state, lobes)
    # The identity of the scene is that of the repaired description, before shapes are rewritten by
    # what Mitsuba builds.
    digest = description_digest(state)
    with temporary_folder() as folder:
        notes = cylinders_as_meshes(state, folder)
        # which takes the nodes apart
        scene = mi.parser.instantiate(config, mi.parser.ParserState(state))
        # Some repairs need built shapes: windows, lamps on meshes, media of walls. They change the
        # description, of which the scene is then built again.
        rooms = rooms_as_boxes(state, scene.shapes())
        changed = [
            bool(rooms),
            lamps_as_rectangles(state, scene.shapes()),
            leave_out_media(state, scene),
        ]
        scene = mi.parser.instantiate(config, state) if any(changed) else scene
    for note in [*notes, *rooms, *touching(scene), *clip_notes(scene)]:
        mi.Log(mi.LogLevel.Warn, note)
    give_description(scene, digest)
    return scene, lens


def _mend(state: mi.parser.ParserState, path: Path) -> None:
    """Change the nodes of a file into nodes that methods and reference read, with warnings."""
    # Names come before checks, whose messages use them. Instances come last: copies are made of
    # parts that are repaired already.
    _leave_out_rendering(state)
    name_nodes(state)
    check_kinds(state)
    give_grids(state)
    check_files(state, path)
    for note in [*give_extinction(state), *mirrored_grids(state)]:
        mi.Log(mi.LogLevel.Warn, note)
    grey_densities(state)
    pass_where_no_material(state)
    check_colours(state)
    give_own_parts(state)
    write_out_instances(state)


def _leave_out_rendering(state: mi.parser.ParserState) -> None:
    """Leave out integrators, samplers and filters: no method uses them, and Mitsuba 3 lacks some
    that old files name. Leave out the weights by which lights are sampled: `volpath` would never
    sample a light of weight 0.
    """
    for node in state.nodes:
        if "sampling_weight" in node.props:
            del node.props["sampling_weight"]
        for key, at in references(node.props):
            if kind(state, at) in ("Integrator", "Sampler"):
                del node.props[key]
            elif kind(state, at) == "Film":
                film = properties(state, at)
                # Only the size of a film counts; its type may be one that Mitsuba 3 no longer has.
                plain_film = mi.Properties("hdrfilm")
                for name in _FILM:
                    if name in film:
                        plain_film[name] = film[name]
                state.nodes[at].props = plain_film


def check_kinds(state: mi.parser.ParserState) -> None:
    """Refuse lights, media, phase functions and cameras of types that no command takes."""
    for part, types in _TAKEN.items():
        for index in of_kind(state, part):
            props = properties(state, index)
            if props.plugin_name() not in types:
                name = f"{_WORDS[part]} '{props.id()}'" if props.id() else f"a {_WORDS[part]}"
                for medium in of_kind(state, "Medium"):
                    of_medium = properties(state, medium)
                    if any(at == index for _, at in references(of_medium)):
                        name += f" of medium '{of_medium.id()}'"
                raise InputError(
                    f"{name} is of type '{props.plugin_name()}'; expected one of "
                    f"{', '.join(types)}: replace it" + " or remove it" * (part == "Emitter")
                )
    for index in of_kind(state, "Emitter"):
        _check_light(state, index)
    for index in of_kind(state, "BSDF"):
        relief = child(state, index, "Texture")
        if relief is None or properties(state, index).plugin_name() != "bumpmap":
            continue
        if (made := properties(state, relief).plugin_name()) != "bitmap":
            raise InputError(
                f"a bumpmap of the scene is of a '{made}', whose slope Mitsuba does not have; "
                "expected a 'bitmap': replace it, or take the surface without the bumpmap"
            )
    sensors = of_kind(state, "Sensor")
    if sensors:
        check_camera(properties(state, sensors[0]))


def _check_light(state: mi.parser.ParserState, index: int) -> None:
    props = properties(state, index)
    name = f"light '{props.id()}'"
    wanted = _COLOURS.get(props.plugin_name())
    for key, at in references(props):
        textured = properties(state, at).plugin_name() in _TEXTURES
        if key == "texture" or (key == wanted and textured):
            raise InputError(
                f"{name}, of type '{props.plugin_name()}', has a texture as {key}; expected one "
                "colour: remove the "
                "texture, or give its mean as 'rgb'"
            )
