# SPDX-License-Identifier: BSD-3-Clause
"""`airlight.describe` and `airlight.view`: a scene in numbers, a scene live."""

import json
import os
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from airlight.errors import InputError
from airlight.reports.api.inputs import (
    Files,
    KernelLike,
    MethodLike,
    ModelLike,
    Progress,
    SceneLike,
    Size,
    Values,
    changes_of,
    chosen_model,
    configuration_of,
    exclude,
    note,
    one_error,
    output_files,
    pixels_of,
    several,
)
from airlight.reports.tables.record import OfScene, Result
from airlight.reports.tables.table import Table
from airlight.validation.scenes.names import check_scene

if TYPE_CHECKING:
    from airlight.reference.scene.model import Model
    from airlight.validation.scenes.loading import LoadedScene


@one_error
def describe(
    scene: SceneLike,
    *,
    change: Values = (),
    size: Size | None = None,
    model: ModelLike | None = None,
    variants: Literal["all"] | None = None,
    output: Files = (),
    progress: Progress = None,
) -> "Description | Variants":
    """Describe everything that another renderer needs to render a scene.

    The description has the camera, media, lights and surfaces, what the pixels contain and which
    file to write. `airlight compare SCENE IMAGE.exr` then judges the image. The glTF file has the
    same camera, lights and meshes, with the media in its extras.

    Parameters
    ----------
    scene
        A built-in scene, random:SEED or a Mitsuba XML or pbrt file; from Python also what
        `load_scene` takes or returns.
    change
        Change the camera, a light or a medium of the scene, such as medium.sigma_t=0.1; may be given several times.
    size
        Width and height [pixels], or WxH; the scene's own by default.
    model
        Name the equation of an engine, such as playcanvas:range=8, see `airlight list models`; by
        default the one that a scene file names.
    variants
        all: write the changed scenes of `airlight check` into the folder of `--output`, each as JSON
        and as glTF, and check.json, which names the frames to render.
    output
        Write the scene as binary glTF 2.0, a .glb file, as a scene of pbrt-v4, a .pbrt file, or
        its height fog or density grid as a grid of Mitsuba, a .vol file.
    progress
        True prints notes on the scene on the error stream.

    Raises
    ------
    InputError
        For a scene without a reference, with the name of what is in the way.
    """
    # Names are checked before Mitsuba starts.
    if variants is not None:
        beside = {"change": several(change), "model": model}
        exclude("variants", "are those of a scene as it is", beside)
        return _variants(scene, size, several(output))
    files = output_files(output, ".glb", ".pbrt", ".vol")
    by_ending = {
        ending: [path for path in files if path.suffix.lower() == ending]
        for ending in (".glb", ".pbrt", ".vol")
    }
    for ending, paths in by_ending.items():
        if len(paths) > 1:
            raise InputError(
                f"output: got {' and '.join(map(str, paths))}, expected one {ending} file at most"
            )
    check_scene(scene)
    changes, chosen = changes_of(change), chosen_model(model)
    from airlight.reference.storage.files import write_text
    from airlight.reports.api.scenes import opened
    from airlight.reports.interchange.gltf import write_gltf
    from airlight.reports.interchange.pbrt import pbrt_scene
    from airlight.reports.interchange.scene import describe_scene
    from airlight.validation.scenes.changes import change_words

    loaded = opened(scene, size, changes, chosen)
    # The ending says what is written; a .vol file holds a medium that varies, sampled to a grid.
    described = describe_scene(loaded)
    # A scene may fit one kind of file alone: it is refused before any is written.
    pbrt = {str(path): pbrt_scene(loaded) for path in by_ending[".pbrt"]}
    grids = [_write_grid(path, loaded) for path in by_ending[".vol"]]
    written = [write_gltf(path, loaded) for path in by_ending[".glb"]]
    for path, text in pbrt.items():
        write_text(path, text)
    note(progress, described["notes"])
    return Description(
        described=described,
        changes=tuple(change_words(changes)),
        gltf=written[-1] if written else None,
        pbrt=tuple(pbrt),
        grid=grids[-1] if grids else "",
        asked=model.strip() if isinstance(model, str) else _model_words(scene, loaded, chosen),
        advice=_model_advice(loaded) if chosen is None else "",
    )


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Description(Result):
    """Everything that another renderer needs to render a scene."""

    described: Mapping[str, Any]  #: see `reports.interchange.scene.describe_scene`
    changes: tuple[str, ...] = ()  #: of the scene, in words
    asked: str = ""  #: the words of its model, where the command that judges needs them
    gltf: Mapping[str, Any] | None = None  #: the glTF file that was written
    pbrt: tuple[str, ...] = ()  #: the files of the pbrt scene that was written
    grid: str = ""  #: the medium that reads the volume file that was written, as XML
    advice: str = ""  #: the model that the engine of a height fog solves, where none is named

    def __getitem__(self, name: str) -> Any:
        """Return a part of the description, such as 'camera' or 'lights'."""
        return self.described[name]

    @property
    def title(self) -> str:
        """The scene."""
        return str(self.described["scene"])

    @property
    def scene_name(self) -> str:
        """The scene."""
        return self.title

    @property
    def notes(self) -> Sequence[str]:
        """Remarks on the scene."""
        return self["notes"]

    @property
    def tables(self) -> Sequence[Table]:
        """The camera, the media, the lights and the surfaces, with units of engines."""
        from airlight.reports.interchange.words import description_table

        return [description_table(self.described)]

    @property
    def lines(self) -> Sequence[str]:
        """The command that judges an image, the model, and the files that were written."""
        from airlight.validation.scenes.models import model_line

        options = [word for change in self.changes for word in ("--change", change)]
        options += ["--model", self.asked] if self.asked else []
        command = ["airlight", "compare", self["source"], self["file"]["name"], *options]
        lines = [f"to judge it: {shlex.join(command)}"]
        if self["model"] is not None:
            lines.append(model_line(**self["model"]))
        lines += [self.advice] if self.advice else []
        if self.gltf is not None:
            # glTF knows triangles only: shapes that Mitsuba intersects in closed form have become
            # meshes, which the user must know when the silhouettes differ.
            cut = ", ".join(self.gltf["tessellated"])
            more = f"; cut into triangles: {cut}" if cut else ""
            lines.append(f"{self.gltf['path']}: {self.gltf['triangles']} triangles{more}")
        lines += [f"{path}: the scene for pbrt-v4" for path in self.pbrt]
        return [*lines, f"the fog as a grid: {self.grid}"] if self.grid else lines

    def to_dict(self) -> dict[str, Any]:
        """Return the description, its changes, and the files that were written."""
        own = {
            "changes": list(self.changes),
            "gltf": self.gltf,
            "pbrt": list(self.pbrt),
            "grid": self.grid,
            "advice": self.advice,
        }
        return {**self.described, **{name: value for name, value in own.items() if value}}


def _model_words(scene: Any, loaded: "LoadedScene", chosen: "Model | None") -> str:
    """Return what a user types beside a scene to judge by its model; nothing where its name or its
    file says as much.
    """
    from airlight.validation.scenes.files.text import named_in
    from airlight.validation.scenes.models import DEFAULT, PHYSICAL_NAME

    if chosen is None and isinstance(scene, str | os.PathLike):
        return ""
    # A scene from Python may have another model than its file.
    is_named = loaded.path is not None and named_in(loaded.path, DEFAULT).model is not None
    plain = PHYSICAL_NAME if chosen is not None or is_named else ""
    return loaded.model.terms or plain


def _model_advice(loaded: "LoadedScene") -> str:
    """Return which model the height fog of an engine asks for, nothing where one is named."""
    from airlight.validation.scenes.models import preset_of_fog

    preset = preset_of_fog(loaded.fog_engine)
    if preset is None or not loaded.model.is_physical:
        return ""
    return f"--model {preset.usage} solves this engine's own equation ({preset.title})"


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Variants(OfScene):
    """The changed scenes that were written for `airlight check`."""

    folder: Path
    frames: tuple[str, ...]  #: names of the images to render
    relations: tuple[str, ...]

    @property
    def title(self) -> str:
        """The scene and the folder."""
        return f"{self.scene}, changed scenes in {self.folder}"

    @property
    def lines(self) -> Sequence[str]:
        """The images to render, and the command that judges them."""
        return [
            f"{self.folder}: {len(self.frames)} scenes, each as NAME.json and NAME.glb",
            f"to render: NAME.exr of each, beside {self.folder / 'check.json'}",
            f"to judge them: {shlex.join(['airlight', 'check', str(self.folder)])}",
        ]


def _variants(scene: Any, size: Any, output: Sequence[Any]) -> Variants:
    """Write the changed scenes of a check."""
    if len(output) != 1 or Path(output[0]).suffix:
        raise InputError("variants: expected one folder for the scenes, such as -o variants")
    check_scene(scene)
    from airlight.reference.storage.files import ensure_folder, write_text
    from airlight.reports.api.scenes import opened
    from airlight.reports.interchange.gltf import write_gltf
    from airlight.reports.interchange.scene import describe_scene
    from airlight.validation.check.check_file import FILE, CheckFile, named_frames
    from airlight.validation.check.variants import variants as changed

    pixels = opened(scene, size).size  # starts Mitsuba, and says how large the images are
    made, folder = changed(str(scene), pixels), ensure_folder(output[0])
    for name, build in made.scenes.items():
        loaded = replace(opened(build()), name=name)
        data = Description(described=describe_scene(loaded)).enveloped(f"airlight describe {scene}")
        text = json.dumps(data, indent=1, ensure_ascii=False, allow_nan=False)
        write_text(folder / f"{name}.json", text + "\n")
        write_gltf(folder / f"{name}.glb", loaded)
    asked = CheckFile(made.asked, scene=str(scene), again=made.again)
    write_text(folder / FILE, json.dumps(named_frames(asked), indent=1) + "\n")
    names = tuple(f"{name}.exr" for name in made.scenes)
    relations = tuple(each.name for each in made.asked)
    return Variants(scene=str(scene), folder=folder, frames=names, relations=relations)


def _write_grid(path: Path, loaded: "LoadedScene") -> str:
    from airlight.reference.scene.varying import GridMedium, HeightMedium
    from airlight.reports.interchange.fog_grid import write_fog_grid
    from airlight.reports.interchange.scene import scene_as_it_is

    # A homogeneous medium needs no grid: its numbers stand in the description.
    medium = scene_as_it_is(loaded).medium
    if not isinstance(medium, HeightMedium | GridMedium):
        raise InputError(
            f"output: got {path}, and the medium is no height fog and no grid; expected a name "
            "that ends in .glb or .pbrt"
        )
    return write_fog_grid(path, medium)


@one_error
def view(
    scene: SceneLike,
    method: MethodLike = "shadow-planes",
    kernel: KernelLike | None = None,
    *,
    change: Values = (),
    size: Size = "640x480",
    address: str = "127.0.0.1:0",
    **parameters: Any,
) -> None:
    """Show a scene live in the browser.

    The mouse moves the camera; widgets change method, kernel, parameters, lights and media. The
    page shows what a frame costs, stage by stage, and its error against the reference, which is
    computed while nothing moves. It also shows the command that renders the same frame. Ctrl-C ends
    the view.

    The address has a token: anyone who knows it may use the page, but can choose only built-in
    methods and kernels and those that are named here. Beyond 127.0.0.1 it travels in clear text.

    Parameters
    ----------
    scene
        A built-in scene, random:SEED or a Mitsuba XML or pbrt file.
    method
        A method of `airlight list methods`, or a user's as MODULE:FUNCTION,
        FILE.py:FUNCTION or FILE.glsl.
    kernel
        Airlight kernel, see `airlight list kernels`.
    change
        Change the camera, a light or a medium of the scene, such as medium.sigma_t=0.1; may be given several times.
    size
        Width and height [pixels], or WxH.
    address
        The HOST:PORT to listen at; port 0 is any free one.
    parameters
        Parameters of the method.
    """
    from airlight.reports.machine.environment import activate, require

    require("websockets", "view", "the live view")
    # An IPv6 host has colons of its own: the port stands behind the last.
    host, _, digits = address.rpartition(":")
    if not host or not digits.isdecimal() or not (port := int(digits)) <= 65535:
        raise InputError(
            f"address: got {address!r}, expected HOST:PORT, a port from 0, any free one, to 65535"
        )
    # Mistakes in words are found before Mitsuba starts.
    check_scene(scene)
    chosen = configuration_of(method, kernel, parameters)
    changes, pixels = changes_of(change), pixels_of(size)
    variant = activate()
    from airlight.reports.view.server import Server
    from airlight.reports.view.session import Session
    from airlight.reports.view.widgets import ViewState

    assert pixels is not None
    # The session owns the scene and its threads, the server only passes messages on; the session
    # must end its reference whether or not the server could listen.
    session = Session(ViewState(str(scene), pixels, chosen, changes), variant)
    try:
        try:
            server = Server(
                host, port, opened=session.opened, told=session.told, closed=session.closed
            )
        except OSError as error:
            raise InputError(
                f"address: cannot listen at {host}, port {port}: {error.strerror}; expected an "
                "address of this "
                "machine, and a port that is free: 0 finds one"
            ) from error
        server.start()
        print(f"{server.address}\nCtrl-C ends the view.", flush=True)
        # Frames are rendered in this thread until Ctrl-C: Dr.Jit records in the thread that calls.
        session.run()
    finally:
        session.reference.end()
