# SPDX-License-Identifier: BSD-3-Clause
"""`airlight.capture`: a scene in an engine that others wrote, without a window, as an EXR file.

An *adapter* is a program that sets the scene up in its engine; those of a clone lie in
`docs/adapters`, whose README has the contract. Nothing here knows an engine.
"""

import json
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from airlight.errors import InputError
from airlight.reports.api.inputs import (
    File,
    Progress,
    SceneLike,
    Size,
    Values,
    one_error,
    output_files,
    several,
    telling,
)
from airlight.reports.machine.engine_adapter import adapter_command, run_adapter
from airlight.reports.machine.environment import stamped
from airlight.reports.tables.record import OfScene

if TYPE_CHECKING:
    from airlight.reference.storage.exr import Image
    from airlight.reports.api.explore import Description

_LAYERS = ("airlight", "surface")
LIMIT = 300.0  #: of an engine by default [s]
_LONGEST = 2e6  # [s], as of `realtime.child_process`


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Capture(OfScene):
    """An image of a scene that an engine made."""

    source: str  #: the scene as commands name it
    path: str  #: the file that was written
    engine: str
    version: str
    device: str  #: that drew the image, in the engine's words
    settings: Mapping[str, Any]  #: of the engine, by its own names
    edits: tuple[str, ...]  #: changes of its shaders
    changes: tuple[str, ...]  #: of the scene, in words
    model: str | None  #: the equation that the settings mean; None where it is not known
    pixel: str | None  #: of what the values of pixels are: centre or area
    size: tuple[int, int]  #: width and height [pixels]
    seconds: float  #: of the whole run, which says nothing about the speed of the engine
    problems: tuple[str, ...]  #: that the engine told
    remarks: tuple[str, ...] = field(default=(), repr=False)

    @property
    def title(self) -> str:
        """The scene and the engine."""
        return "{} in {} {}, {} x {}".format(self.scene, self.engine, self.version, *self.size)

    @property
    def notes(self) -> Sequence[str]:
        """Remarks on the scene."""
        return self.remarks

    @property
    def command(self) -> str:
        """The command that judges the image."""
        words = ["airlight", "compare", self.source, self.path]
        words += [word for change in self.changes for word in ("--change", change)]
        words += ["--pixel", self.pixel] if self.pixel else []
        return shlex.join([*words, "--model", self.model] if self.model else words)

    @property
    def lines(self) -> Sequence[str]:
        """The settings, the equation, and the command that judges the image."""
        from airlight.validation.scenes.models import PHYSICAL_NAME, model_line, model_of

        lines = [self.title]
        told = ", ".join(f"{name}={value}" for name, value in self.settings.items())
        lines += [f"settings  {told}"] if told else []
        lines += [f"edit      {edit}" for edit in self.edits]
        lines += [model_line("", model_of(self.model).terms or PHYSICAL_NAME)] if self.model else []
        lines += [f"the engine said: {words}" for words in self.problems]
        lines += [f"note: {words}" for words in self.remarks]
        return [*lines, f"wrote {self.path}", f"to judge it: {self.command}"]

    def to_dict(self) -> dict[str, Any]:
        """Return the data, with the command that judges the image."""
        return {**super().to_dict(), "judge": self.command}


@one_error
def capture(
    engine: str,
    scene: SceneLike,
    *,
    output: File | None = None,
    change: Values = (),
    size: Size | None = None,
    settings: Values = (),
    edit: Sequence[str] = (),
    adapters: File | None = None,
    limit: float = LIMIT,
    progress: Progress = None,
) -> Capture:
    """Render a scene in an engine, without a window, and write an EXR file.

    The engine is not ours: an adapter sets it up by what `airlight describe` says. The file has the
    layers `airlight` and `surface`. The result names the equation that the settings mean, and the
    command that judges the image by it. The adapters of a clone are playcanvas, three and
    babylon, which run in Chromium, eevee and cycles of Blender, and bevy; see
    docs/adapters/README.md.

    The exit status is 2 for what an engine cannot have, and 3 where a program is missing.

    Parameters
    ----------
    engine
        The name of an adapter, such as playcanvas or three.
    scene
        A built-in scene, random:SEED or a Mitsuba XML or pbrt file; from Python also what
        `load_scene` takes or returns.
    output
        The .exr file to write.
    change
        Change the camera, a light or a medium of the scene, such as medium.sigma_t=0.1; may be given several times.
    size
        Width and height [pixels], or WxH; the scene's own by default.
    settings
        NAME=VALUE, a setting of the engine by its own name, such as localSteps=32; may be given several times.
    edit
        CHUNK~FROM~TO, replace a text in a shader of the engine: its chunk, and both texts; may be
        given several times. The equation of the result is then not known.
    adapters
        The folder of the adapters; by default docs/adapters of the clone.
    limit
        The longest time that the engine may take [s].
    progress
        Called with (fraction done, what); True shows a bar.

    Raises
    ------
    InputError
        For what the engine cannot have, an adapter that fails or takes too long, and an image that
        has another size, lacks a layer or is not finite.
    MissingError
        If a program is missing: the message says what to type.
    """
    # All that can be wrong in words is refused before Mitsuba starts.
    if output is None:
        raise InputError(f"output: expected a file to write, such as -o {engine}.exr")
    (file,) = output_files(output, ".exr")
    check_limit(limit)
    edits = _edits(edit)
    options = [*_settings(settings), *(f"edit={each}" for each in edits)]
    command = adapter_command(engine, adapters)
    from airlight.reference.storage.exr import Image, write_exr
    from airlight.reference.storage.files import temporary_folder
    from airlight.reports.api.explore import Description, describe
    from airlight.reports.engines.record import UNKNOWN
    from airlight.validation.scenes.models import model_of, model_words

    with telling(progress, f"{scene} in {engine}") as tell, temporary_folder() as folder:
        # The scene, as `airlight describe --json -o` has it.
        tell(0, "the scene")
        described = describe(scene, change=change, size=size, output=folder / "scene.glb")
        assert isinstance(described, Description)
        data = described.enveloped("airlight describe")
        text = json.dumps(data, ensure_ascii=False, allow_nan=False)
        (folder / "scene.json").write_text(text, encoding="utf-8")
        # The engine, then its image.
        tell(0, "the engine")
        names = [str(folder / name) for name in ("scene.json", "scene.glb", "out.exr")]
        told = run_adapter(engine, [*command, *names, *options], limit=limit, folder=folder)
        width, height = described["camera"]["size"]
        image = _image(engine, folder / "out.exr", (width, height), told.layers)
    model = None if told.model is None else model_of(told.model)
    made = {"engine": told.engine, "engine-version": told.version, "device": told.device}
    made |= {"pixel": told.pixel or ""}
    made |= {"settings": json.dumps(told.settings), "edits": json.dumps(edits) if edits else ""}
    made |= {"model": model_words(model) if model and not model.is_physical else ""}
    made |= {"equation": "" if model else UNKNOWN}
    attributes = {f"airlight:{name}": words for name, words in made.items() if words}
    write_exr(file, stamped(Image(image.layers, attributes=attributes)))
    return Capture(
        scene=described.title,
        source=described["source"],
        path=str(output),
        engine=told.engine,
        version=told.version,
        device=told.device,
        settings=told.settings,
        edits=tuple(edits),
        changes=described.changes,
        model=told.model,
        pixel=told.pixel,
        size=(width, height),
        seconds=told.seconds,
        problems=told.problems,
        remarks=_remarks(described),
    )


def check_limit(limit: float) -> None:
    """Refuse what is no time that an engine may take [s]."""
    if not 0 < limit <= _LONGEST:
        raise InputError(f"limit: got {limit:g}, expected a time above 0 up to {_LONGEST:g} [s]")


def _settings(settings: Any) -> list[str]:
    """Return settings as words NAME=VALUE."""
    from airlight.validation.study.configuration import parse_settings

    given = settings if isinstance(settings, Mapping) else parse_settings(several(settings))
    if "edit" in given:
        raise InputError("settings: edit is an option of its own: --edit CHUNK~FROM~TO")
    return [f"{name}={value}" for name, value in given.items()]


def _edits(edit: Any) -> list[str]:
    edits = [str(each) for each in several(edit)]
    for each in edits:
        cells = each.split("~")
        if len(cells) != 3 or not (cells[0] and cells[1]):
            raise InputError(f"edit: got {each!r}, expected CHUNK~FROM~TO")
    return edits


def _image(engine: str, path: Path, size: tuple[int, int], called: Mapping[str, str]) -> "Image":
    """Return the image that an adapter wrote, once it is known to be whole; `called` are names of
    its layers.
    """
    import numpy as np

    from airlight.reference.storage.exr import Image, layer, read_exr

    if not path.is_file():
        raise InputError(f"{engine}: its adapter wrote no image")
    try:
        read = read_exr(path)
        layers = {
            name: layer(read, called.get(name, name), "its image")
            for name in (("airlight", "total") if "total" in called else _LAYERS)
        }
    except InputError as error:
        raise InputError(f"{engine}: {str(error).replace(str(path), 'its image')}") from error
    for name, values in layers.items():
        height, width = values.shape[:2]
        if (width, height) != size or read.window is not None:
            raise InputError(
                "{}: its image has {} x {} pixels{}; expected {} x {}".format(
                    engine, width, height, " in part" if read.window else "", *size
                )
            )
        wrong = int(np.count_nonzero(~np.isfinite(values).all(axis=2)))
        if wrong:
            raise InputError(f"{engine}: {wrong} pixels of its layer {name} are not finite")
    # An engine that writes all light has the surfaces as what is left of it.
    if "total" in layers:
        layers["surface"] = layers.pop("total") - layers["airlight"]
    return Image(layers)


def _remarks(described: "Description") -> tuple[str, ...]:
    """Return what is to be known of the scene in the engine."""
    assert described.gltf is not None
    cut = ", ".join(described.gltf["tessellated"])
    return (*described.notes, *([f"cut into triangles: {cut}"] if cut else []))
