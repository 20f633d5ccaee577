# SPDX-License-Identifier: BSD-3-Clause
"""`airlight.report` of engines: scenes rendered in engines that others wrote, and judged."""

import shutil
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from airlight.errors import InputError, nearest
from airlight.reports.api.capture import LIMIT, check_limit
from airlight.reports.api.command import report_command, setting_words
from airlight.reports.api.inputs import pixels_of, several, telling
from airlight.reports.machine.engine_adapter import CannotError, adapter_names
from airlight.reports.machine.environment import MissingError, activate
from airlight.reports.tables.record import Result
from airlight.reports.tables.table import Table
from airlight.validation.scenes.names import check_scene, scene_names, scene_stem

if TYPE_CHECKING:
    from airlight.reports.diff.compare import Difference
    from airlight.reports.engines.measure import Render
    from airlight.reports.engines.record import Engines

ALL = "all"
#: A lamp in the open, one in a spot, columns, a sun in bounded fog, a layer of mist, a room.
SCENES = ("open-fog", "sphere-spot", "colonnade", "windows", "mist", "omni-box")
SIZE = (160, 120)


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class EnginesReport(Result):
    """A report on engines that was written."""

    folder: Path
    data: "Engines"  #: the content of engines.json

    @property
    def page(self) -> Path:
        """The HTML page."""
        from airlight.reports.engines.record import PAGE

        return self.folder / PAGE

    @property
    def title(self) -> str:
        """The engines and the scenes."""
        scenes = ", ".join(scene.name for scene in self.data.scenes)
        return f"{', '.join(self.data.engines)} in {scenes}, {self.data.created}"

    @property
    def claims(self) -> Sequence[str]:
        """A sentence on each engine."""
        from airlight.reports.engines.tables import engine_sentences

        return engine_sentences(self.data)

    @property
    def tables(self) -> Sequence[Table]:
        """The errors of each engine in each scene."""
        from airlight.reports.engines.tables import engines_table

        return [engines_table(self.data)]

    @property
    def lines(self) -> Sequence[str]:
        """Where it was written."""
        return [str(self.page)]

    @property
    def failures(self) -> Sequence[str]:
        """The adapters that failed: an engine that is far from physics is a result."""
        from airlight.reports.engines.record import FAILED

        failed = [cell for cell in self.data.cells if cell.status == FAILED]
        return [f"{cell.engine} in {cell.scene}: {cell.reason}" for cell in failed]

    def to_dict(self) -> dict[str, Any]:
        """Return the content of engines.json."""
        return asdict(self.data)


def report_on_engines(
    engines: Any,
    scenes: Sequence[Any],
    *,
    size: Any,
    settings: Any,
    images: Any,
    adapters: Any,
    limit: float,
    diagnose: bool,
    output: Path,
    progress: Any,
) -> EnginesReport:
    """Render scenes in engines, or take the images of a folder, judge them and write the report;
    parameters as of `airlight.report`.
    """
    # Names are refused before Mitsuba starts.
    for scene in scenes:
        check_scene(scene)
    check_limit(limit)
    asked = [name.strip() for words in several(engines) for name in str(words).split(",")]
    of_engine = _settings(settings)
    kept = None if images is None else _Kept.of(Path(images), [str(scene) for scene in scenes])
    known = adapter_names(adapters) if kept is None else kept.engines
    chosen = known if ALL in asked else asked
    for name in [*chosen, *of_engine]:
        if name not in known:
            raise InputError(
                f"engines: got {name!r}, expected {ALL} or some of {', '.join(known)}"
                f"{nearest(name, known)}"
            )
    for name in of_engine:
        if name not in chosen:
            raise InputError(
                f"set: got a setting of {name}, expected one of {', '.join(chosen)}, which render: "
                "name it among the engines, or leave the setting out"
            )
    if kept is not None:
        names = [str(scene) for scene in scenes] or kept.scenes
        pixels = kept.size
    else:
        names, pixels = [str(scene) for scene in scenes or SCENES], pixels_of(size) or SIZE

    from airlight.reference.storage.files import ensure_folder
    from airlight.reports.engines.measure import Wanted, write_engines
    from airlight.reports.engines.record import STRIP, engines_file, named_files, read_engines
    from airlight.reports.report.staged import staged

    def named_before(folder: Path) -> list[str]:
        file = engines_file(folder)
        names = [] if file is None else [*named_files(read_engines(file)), STRIP]
        return [name for name in names if Path(name).name == name]

    options = {
        "engines": ",".join(asked),
        "images": images,
        "size": None if size is None else pixels,
        "adapters": adapters,
        "limit": limit if limit != LIMIT else None,
        "diagnose": diagnose,
    }
    given = [f"{name}.{word}" for name, words in of_engine.items() for word in words]
    wanted = Wanted(
        engines=tuple(chosen),
        scenes=tuple(names),
        size=pixels,
        needed=() if ALL in asked else tuple(asked),
        set_up=tuple(of_engine),
        diagnose=diagnose,
        command=report_command(options, scenes, settings=given),
    )
    activate()
    target = ensure_folder(output)
    with telling(progress, "engines") as tell, staged(target, named_before) as hidden:
        render = _engines(of_engine, pixels, adapters, limit) if kept is None else kept.render
        data = write_engines(hidden, wanted, render, tell)
    return EnginesReport(folder=target, data=data)


def _settings(settings: Any) -> dict[str, list[str]]:
    """Return the settings NAME=VALUE of each engine, from words ENGINE.NAME=VALUE."""
    found: dict[str, list[str]] = {}
    for word in setting_words(settings):
        engine, dot, rest = word.partition(".")
        if not (dot and engine and "=" in rest):
            raise InputError(
                f"set: got {word!r}, expected ENGINE.NAME=VALUE, such as playcanvas.localSteps=32"
            )
        found.setdefault(engine, []).append(rest)
    return found


def _engines(
    of_engine: Mapping[str, Sequence[str]], size: tuple[int, int], adapters: Any, limit: float
) -> "Render":
    """Return what renders a scene in an engine."""
    from airlight.reports.api.capture import capture

    def render(engine: str, scene: str, file: Path) -> object:
        chosen = list(of_engine.get(engine, ()))
        return capture(
            engine, scene, output=file, size=size, settings=chosen, adapters=adapters, limit=limit
        )

    return render


@dataclass(frozen=True)
class _Kept:
    """Captures of an earlier report, SCENE.ENGINE.exr, with the reasons of cells without any."""

    folder: Path
    engines: list[str]
    scenes: list[str]
    size: tuple[int, int]
    before: "Engines | None"  #: what engines.json says beside them

    @classmethod
    def of(cls, folder: Path, asked: Sequence[str]) -> "_Kept":
        """Find the captures of a folder; `asked` are the scenes that the user names. Mitsuba is not
        needed.
        """
        from airlight.reports.engines.record import engines_file, read_engines
        from airlight.validation.engine.images import find_images, images_size

        file = engines_file(folder)
        before = None if file is None else read_engines(file)
        # Files may be named by scenes of the user, whose paths the command or engines.json has.
        sources = {scene_stem(name): name for name in scene_names()}
        sources |= {scene.name: scene.source for scene in before.scenes} if before else {}
        sources |= {scene_stem(name): name for name in asked}
        found = find_images(folder, sources)
        labels = {image.label for images in found.values() for image in images}
        labels |= set(before.engines) if before else set()
        sizes = {images_size(images) for images in found.values()}
        if len(sizes) > 1:
            raise InputError(f"--images: the images of {folder} have several sizes")
        known = [scene.source for scene in before.scenes] if before else []
        names = [*known, *(sources[name] for name in found if sources[name] not in known)]
        return cls(folder, sorted(labels), names, sizes.pop(), before)

    def render(self, engine: str, scene: str, file: Path) -> None:
        """Copy the capture, or raise why there is none."""
        from airlight.reports.engines.record import CANNOT, FAILED

        place = self.folder / f"{scene_stem(scene)}.{engine}.exr"
        if place.is_file():
            shutil.copyfile(place, file)
            return
        for cell in self.before.cells if self.before else ():
            if (cell.scene, cell.engine) == (scene_stem(scene), engine) and cell.reason:
                kind = {CANNOT: CannotError, FAILED: InputError}.get(cell.status, MissingError)
                raise kind(cell.reason)
        raise MissingError(f"there is no {place.name} in {self.folder}")


def difference_of_engines(old: Path, new: Path) -> "Difference":
    """Compare two files engines.json."""
    from airlight.reports.diff.engines import compare_engines
    from airlight.reports.engines.record import read_engines

    return compare_engines(read_engines(old), read_engines(new))
