# SPDX-License-Identifier: BSD-3-Clause
"""The images of engines judged: by physics, and by the equation that each names."""

import json
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from airlight.errors import InputError
from airlight.reference.quadrature.image import ReferenceImage
from airlight.reference.scene.model import PHYSICAL
from airlight.reference.storage.exr import TOTAL, Image, read_exr
from airlight.reference.storage.store import date
from airlight.reports.data.records import Environment
from airlight.reports.engines.record import (
    CANNOT,
    FAILED,
    FILE,
    JUDGED,
    MISSING,
    PAGE,
    SCHEMA,
    STRIP,
    UNKNOWN,
    Captured,
    Cell,
    Engines,
    EngineScene,
    LayerErrors,
    Status,
    engines_text,
)
from airlight.reports.machine.engine_adapter import CannotError
from airlight.reports.machine.environment import MissingError, describe_environment
from airlight.reports.machine.progress import Progress, counted, sharing
from airlight.reports.plotting.pictures import error_map, exposure, png_bytes, tone_mapped
from airlight.validation.arrays import Array
from airlight.validation.columns import record_of
from airlight.validation.engine.diagnose import diagnose_file
from airlight.validation.engine.images import captured_model
from airlight.validation.engine.judge import errors_of, judge_image, references
from airlight.validation.engine.model_errors import PartError
from airlight.validation.engine.observation import AIRLIGHT, SURFACE, judged_layer
from airlight.validation.estimates.quadrature import reference_layer
from airlight.validation.scenes.loading import LoadedScene, load_scene
from airlight.validation.scenes.names import scene_stem

#: Renders a scene in an engine into a file; raises `InputError` as `airlight.capture` does.
Render = Callable[[str, str, Path], object]


@dataclass(frozen=True, kw_only=True)
class Wanted:
    """The parts of a report on engines."""

    engines: tuple[str, ...]  #: names of adapters
    scenes: tuple[str, ...]  #: names or paths
    size: tuple[int, int]
    #: engines that end the report where a program of theirs is missing
    needed: tuple[str, ...] = ()
    set_up: tuple[str, ...] = ()  #: engines whose settings the user gave
    diagnose: bool = False  #: whether faults are looked for in each image
    command: str = "airlight report --engines all"


def write_engines(folder: Path, wanted: Wanted, render: Render, progress: Progress) -> Engines:
    """Render, judge and write all into a folder, the page last; return the data.

    An engine that cannot have a scene, or fails in it, gets a cell that says why.
    """
    from airlight.reports.engines.page import render_engines, strip_bytes

    environment = record_of(describe_environment(), Environment)
    # Starting a browser and judging take about as long; a diagnosis takes ten times as long.
    parts = [(f"{scene}, ", 1.0) for scene in wanted.scenes]
    scenes, cells = [], list[Cell]()
    for source, step in zip(wanted.scenes, sharing(progress, parts)):
        tell = counted(step)
        loaded = load_scene(source, wanted.size)
        scene, references_of = _scene(folder, source, loaded)
        scenes.append(scene)
        for place, engine in enumerate(wanted.engines):
            tell(place, len(wanted.engines), engine)
            file = folder / f"{scene.name}.{engine}.exr"
            cell = _rendered(render, engine, scene, file, needed=wanted.needed)
            if cell.status == JUDGED:
                cell = _judged(cell, file, loaded, references_of, exposure=scene.exposure)
            if cell.status == JUDGED and wanted.diagnose:
                tell(place, len(wanted.engines), f"{engine}, the diagnosis")
                cell = replace(cell, headline=_headline(file, source))
            cells.append(cell)
        del loaded, references_of
    # A setting that an engine does not have is refused in every scene.
    for engine in wanted.set_up:
        refused = [cell for cell in cells if cell.engine == engine]
        if refused and all(cell.status == CANNOT for cell in refused):
            raise InputError(refused[0].reason)
    missing = [cell.reason for cell in cells if cell.status == MISSING]
    if missing and len(missing) == len(cells):
        raise MissingError(missing[0])
    data = Engines(
        schema=SCHEMA,
        created=date(),
        command=wanted.command,
        environment=environment,
        engines=wanted.engines,
        scenes=tuple(scenes),
        cells=tuple(cells),
    )
    # Data before the page, which is drawn from them alone.
    strip = strip_bytes(data, folder)
    if strip:
        (folder / STRIP).write_bytes(strip)
    (folder / FILE).write_text(engines_text(data), encoding="utf-8", newline="\n")
    (folder / PAGE).write_text(render_engines(data, folder), encoding="utf-8", newline="\n")
    return data


def _scene(
    folder: Path, source: str, loaded: LoadedScene
) -> tuple[EngineScene, Callable[[str], ReferenceImage]]:
    """Return the record of a scene, with its pictures, and what gives its physical reference."""
    physical = replace(loaded, model=PHYSICAL)
    reference_of = references(physical)
    # A sun in fog without bounds has no physical image: a black one stands for it, without a file.
    width, height = (int(n) for n in loaded.scene.sensors()[0].film().size())
    name, files, factor = scene_stem(source), {}, 1.0
    try:
        total = reference_layer(reference_of("centre"), TOTAL, emitted=True)
    except InputError:
        total = None
    if total is not None:
        factor = exposure(total)
        files["picture"] = f"{name}.png"
        (folder / files["picture"]).write_bytes(png_bytes(tone_mapped(total, factor)))
    return (
        EngineScene(
            name=name,
            source=source,
            purpose=loaded.purpose,
            size=(width, height),
            exposure=factor,
            files=files,
        ),
        reference_of,
    )


def _rendered(
    render: Render, engine: str, scene: EngineScene, file: Path, *, needed: Sequence[str]
) -> Cell:
    """Render a scene in an engine; return a cell that says whether there is an image."""
    status: Status = JUDGED
    reason = ""
    try:
        render(engine, scene.source, file)
    except MissingError as error:
        if engine in needed:
            raise
        status, reason = MISSING, str(error)
    except CannotError as error:
        status, reason = CANNOT, str(error)
    except InputError as error:
        status, reason = FAILED, str(error)
    return Cell(scene=scene.name, engine=engine, status=status, reason=reason)


def _judged(
    cell: Cell,
    file: Path,
    loaded: LoadedScene,
    physical_of: Callable[[str], ReferenceImage],
    *,
    exposure: float,
) -> Cell:
    """Return a cell with the errors of its image, and its pictures."""
    image, model = read_exr(file), captured_model(file) or PHYSICAL
    captured = captured_of(image)
    solving = replace(loaded, model=model)
    reference_of = references(solving)
    layers = []
    for name in (AIRLIGHT, SURFACE):
        judged = judged_layer(image, file, name=name)
        # A scene without surfaces has nothing to judge there.
        dark = name == SURFACE and not judged.values.any()
        if dark and not reference_of("centre").surface.any():
            continue
        compared = judge_image(image, judged, solving, reference_of, path=file)
        verdict, errors = compared.verdict, errors_of(compared, judged, solving)
        # Nobody knows what is of an equation that was not told, and what of its algorithm.
        if not captured.told:
            none = PartError(None, None, None)
            errors = replace(errors, image=none, against_physics=None, correlation=None)
        layers.append(
            LayerErrors(
                layer=name,
                errors=errors,
                noise=verdict.block_noise if np.isfinite(verdict.block_noise) else None,
                right=verdict.right,
                verdict=verdict.words,
                place=compared.place.words if compared.place and captured.told else "",
            )
        )
    # Pictures of all light: the image, and its errors against physics and against its equation.
    shown = image.layers[AIRLIGHT].astype(np.float64) + image.layers[SURFACE]
    pictures = {"picture": tone_mapped(shown, exposure)}
    if captured.told:
        pictures["algorithm"] = error_map(_total(reference_of(captured.pixel)), shown)
    with suppress(InputError):  # a sun in fog without bounds has no physical image
        pictures["error"] = error_map(_total(physical_of(captured.pixel)), shown)
    files = {"image": file.name}
    for kind, picture in pictures.items():
        files[kind] = f"{file.stem}-{kind}.png"
        file.with_name(files[kind]).write_bytes(png_bytes(picture))
    return replace(cell, captured=captured, layers=tuple(layers), files=files)


def _total(reference: ReferenceImage) -> Array:
    return reference_layer(reference, TOTAL, emitted=True)


def captured_of(image: Image) -> Captured:
    """Return what the header of a capture says of its engine."""

    def said(name: str, otherwise: str = "") -> str:
        return str(image.attributes.get(f"airlight:{name}", otherwise))

    try:
        settings = json.loads(said("settings", "{}"))
        edits = json.loads(said("edits", "[]"))
    except ValueError as error:
        raise InputError(
            f"the header of a capture has settings that are no JSON: {error}"
        ) from None
    return Captured(
        engine=said("engine", "an engine without a name"),
        version=said("engine-version"),
        device=said("device"),
        pixel=said("pixel", "centre"),
        settings=settings,
        edits=tuple(edits),
        told=bool(said("engine")) and said("equation") != UNKNOWN,
    )


def _headline(file: Path, source: str) -> str:
    """Return what the diagnosis says of an image, without being told the engine's equation."""
    try:
        found = diagnose_file(file, source, model=PHYSICAL)
    except InputError as error:  # a sun in fog without bounds has no physical image
        return f"nothing, as it cannot look: {error}"
    said = {each.layer: " ".join(each.lines[1:2]) for each in found}
    if len(said) == 1:
        return next(iter(said.values()))
    return " ".join(f"The {layer}: {words}" for layer, words in said.items())
