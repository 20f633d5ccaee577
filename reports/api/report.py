# SPDX-License-Identifier: BSD-3-Clause
"""`airlight.report`: the error report."""

import os
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from airlight.errors import InputError
from airlight.reports.api.capture import LIMIT
from airlight.reports.api.command import report_command
from airlight.reports.api.inputs import (
    File,
    Kernels,
    Methods,
    ModelLike,
    Progress,
    Scenes,
    Size,
    Values,
    Words,
    chosen_model,
    exclude,
    note,
    one_error,
    pixels_of,
    several,
    telling,
)
from airlight.reports.tables.drawing import html
from airlight.reports.tables.record import Result, block, bullets
from airlight.reports.tables.table import Table
from airlight.validation.scenes.names import check_scene

if TYPE_CHECKING:
    from airlight.reference.scene.model import Model
    from airlight.reports.api.engines import EnginesReport
    from airlight.reports.data import records
    from airlight.validation.engine.images import EngineImage
    from airlight.validation.study.study import Study

FOLDER = "airlight-report"  #: where a report is written by default


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Report(Result):
    """An error report that was written."""

    folder: Path
    data: "records.Report"  #: the content of report.json
    done: str = ""  #: how much was measured, in words
    figures: tuple[str, ...] = ()  #: files of figures that were written

    @property
    def page(self) -> Path:
        """The HTML page."""
        return self.folder / "report.html"

    @property
    def claims(self) -> tuple[str, ...]:
        """The sentences at the top of the page."""
        return tuple(claim.text for claim in self.data.claims)

    @property
    def confirmed(self) -> bool:
        """Whether no check speaks against the reference, and at least one confirms each layer."""
        from airlight.reports.report.claims import confirmed

        return confirmed(self.data.scenes)

    @property
    def faults(self) -> Sequence[str]:
        """The faults of user methods."""
        from airlight.reports.report.claims import own_faults

        return own_faults(row for scene in self.data.scenes for row in scene.methods)

    @property
    def failures(self) -> Sequence[str]:
        """The faults of user methods, and a reference that is not confirmed."""
        return [*self.faults, *([] if self.confirmed else ["the reference is not confirmed"])]

    @property
    def scene_name(self) -> str | None:
        """The scene of a report of one."""
        return self.data.scenes[0].name if len(self.data.scenes) == 1 else None

    def to_dict(self) -> dict[str, Any]:
        """Return the content of report.json."""
        return asdict(self.data)

    @property
    def tables(self) -> Sequence[Table]:
        """The fastest method within an error."""
        from airlight.reports.tables.methods import fastest_table

        return [fastest_table(self.data.scenes)] if self.data.scenes else []

    @property
    def lines(self) -> Sequence[str]:
        """Where it was written."""
        count = len(self.data.scenes)
        page = f"{self.page}: {count} scene{'' if count == 1 else 's'}, {self.done}"
        return [page, *self.figures]

    @property
    def title(self) -> str:
        """The scenes and the date."""
        return f"{', '.join(scene.name for scene in self.data.scenes)}, {self.data.created}"

    def _repr_html_(self) -> str:
        link = f'<p><a href="{_address(self.page)}">{self.page}</a></p>'
        return block(f"Report on {self.title}", bullets(self.claims), *map(html, self.tables), link)

    def __repr__(self) -> str:
        return f"Report({str(self.folder)!r}, {len(self.data.scenes)} scenes)"


def _address(page: Path) -> str:
    """Return the address of a page, relative inside the current folder: a notebook
    shows only files below it.
    """
    try:
        return page.resolve().relative_to(Path(os.getcwd()).resolve()).as_posix()
    except ValueError:
        return page.resolve().as_uri()


@one_error
def report(
    scenes: Scenes = (),
    *,
    quick: bool = False,
    full: bool = False,
    size: Size | None = None,
    method: Methods = (),
    kernel: Kernels = (),
    settings: Values = (),
    images: File | None = None,
    model: ModelLike | None = None,
    engines: Words | None = None,
    diagnose: bool = False,
    adapters: File | None = None,
    limit: float = LIMIT,
    output: File | None = None,
    from_: File | None = None,
    figures: Literal["single", "double"] | None = None,
    fresh: bool = False,
    cluster: str | None = None,
    progress: Progress = None,
) -> "Report | EnginesReport":
    """Measure methods in scenes and write the report, one page.

    The page is report.html, next to report.json and each image as EXR and PNG.

    With `--engines` it is a report on engines that others wrote: each renders each scene, as
    `airlight capture` does, and its image is judged by physics and by the equation that its
    settings mean. The page is engines.html, next to engines.json. An engine that cannot have a
    scene has a reason in place of numbers; the exit status is 1 if an adapter failed.

    Results that this machine measured before, with the same code and scenes, come from the cache;
    the times of a scene are of one run of all its methods, and are measured again if any of these
    is new. The exit status is 1 if single-scatter or volpath does not confirm the reference within
    the margin, or if a user method fails: the report says how.

    Parameters
    ----------
    scenes
        Built-in scenes, random:SEED and Mitsuba XML or pbrt files; four with `--quick`, eleven by
        default. Or a study, a TOML file as for `airlight sweep`.
    quick
        Few scenes and small images, for a first look in some minutes.
    full
        Large images, many samples and all tables, in about an hour; fourteen scenes by default. Height
        fog, density grids and many lights are measured where they are named.
    size
        Width and height of images and timed frames [pixels], or WxH; those of the effort by default.
    method
        A method of `airlight list methods`, a user's as MODULE:FUNCTION, FILE.py:FUNCTION or
        FILE.glsl, or 'all', the default; may be given several times. From Python also functions and
        `airlight.configuration(...)`.
    kernel
        Airlight kernel of the methods; may be given several times.
    settings
        NAME=VALUE, a parameter for each method that `--method` names, or kernel=NAME; may be given several times.
        With engines ENGINE.NAME=VALUE, a setting of that engine by its own name.
    images
        Folder with images of your engine, SCENE.exr or SCENE.NAME.exr, to
        compare with the reference. With engines a folder with captures, SCENE.ENGINE.exr, which
        are judged in place of new ones.
    model
        For images: judge them by the equation of an engine, such as playcanvas:range=8, see
        `airlight list models`; by default by that which a capture names. Methods are judged by the
        physical equation.
    engines
        all, or names of adapters of `airlight capture`, such as playcanvas,three. Six scenes of 160x120 pixels by
        default.
    diagnose
        With engines: also look for faults in each image, which takes a minute each.
    adapters
        With engines: the folder of their adapters, as of `airlight capture`.
    limit
        With engines: the longest time that one image may take [s].
    output
        Folder for the report; airlight-report by default.
    from_
        Draw the page of this report.json again and measure nothing; `--method`
        names what the strip shows.
    figures
        Also write figures and a LaTeX table for a paper, with the width of a
        single or a double column.
    fresh
        Measure again what earlier runs have cached.
    cluster
        Let workers compute references and their checks: local[:N] processes, tcp://HOST:PORT or
        tls://HOST:PORT of a Dask scheduler, or its scheduler file. A tcp scheduler authenticates
        nobody and its workers run what they are sent: use it only on a network that you trust.
    progress
        Called with (fraction done, what); True shows a bar.

    Raises
    ------
    InputError
        For what cannot be used, before the work begins.

    Examples
    --------
    >>> import airlight
    >>> report = airlight.report("open-fog", method="unshadowed", output="my-report")  # doctest: +SKIP
    >>> report.claims[0]  # doctest: +SKIP
    'The reference is confirmed by our own Mitsuba integrator in 1 of 1 comparisons: ...'
    """
    if engines is not None:
        of_methods: dict[str, Any] = {
            "quick": quick,
            "full": full,
            "method": method,
            "kernel": kernel,
        }
        of_methods |= {"model": model, "from": from_, "figures": figures, "fresh": fresh}
        exclude("engines", "no method is measured", {**of_methods, "cluster": cluster})
        if images is not None:
            of_engines: dict[str, Any] = {"size": size, "set": settings, "adapters": adapters}
            of_engines |= {"limit": limit != LIMIT}
            exclude("images", "the engines are not run", of_engines)
        from airlight.reports.api.engines import report_on_engines

        return report_on_engines(
            engines,
            several(scenes),
            size=size,
            settings=settings,
            images=images,
            adapters=adapters,
            limit=limit,
            diagnose=diagnose,
            output=Path(FOLDER if output is None else output),
            progress=progress,
        )
    of_adapters = {"diagnose": diagnose, "adapters": adapters, "limit": limit != LIMIT}
    exclude("report", "they belong to --engines", of_adapters)
    # An old report is drawn again: nothing is measured, and options of measurement are mistakes.
    # With --figures, scenes and methods choose what the strip shows.
    if from_ is not None:
        beside = {
            "quick": quick,
            "full": full,
            "size": size,
            "kernel": kernel,
            "set": settings,
            "images": images,
            "model": model,
            "fresh": fresh,
        }
        shown = {"a scene": scenes, "method": method} if figures is None else {}
        exclude("from", "the report is drawn again", {**beside, "cluster": cluster, **shown})
        return _redrawn(
            Path(from_), output, figures, several(scenes), [str(each) for each in several(method)]
        )
    if quick:
        exclude("quick", "names the effort", {"full": full})
    # Sizes, methods and repetitions follow from the effort or from a study file.
    effort = "quick" if quick else "full" if full else "default"
    target = Path(FOLDER if output is None else output)
    asked = (several(scenes), several(method), several(kernel), settings)
    if images is None:
        exclude(
            "report", "methods are judged by physics; a model is for --images", {"model": model}
        )
    places = {"images": images, "output": output, "figures": figures, "cluster": cluster}
    places["model"] = model if model is None or isinstance(model, str) else model.terms
    # report.json says how to make it again.
    pixels = pixels_of(size)
    efforts = {"quick": quick, "full": full, "size": pixels, "fresh": fresh}
    command = report_command({**efforts, **places}, *asked)
    data = _measured(
        target,
        effort,
        *asked,
        size=pixels,
        images=images,
        model=chosen_model(model),
        fresh=fresh,
        cluster=cluster,
        command=command,
        progress=progress,
    )
    written = _figures(target, figures, [], []) if figures else ()
    return Report(folder=target, data=data, done=_done(data), figures=written)


def _figures(folder: Path, column: str, scenes: list[str], labels: list[str]) -> tuple[str, ...]:
    from airlight.reports.figures.report import write_figures

    return write_figures(folder, column, scene=scenes[0] if scenes else None, labels=labels or None)


def _redrawn(
    path: Path, output: Any, figures: str | None, scenes: list[str], labels: list[str]
) -> Report:
    """Draw the page of a report again, into its own folder or as a whole report into
    another, and its figures.
    """
    from airlight.reference.storage.files import alone, ensure_folder, write_bytes, write_text
    from airlight.reports.data.records import load_report, named_files
    from airlight.reports.page.render import render_page

    # The page itself shows all scenes of the report.
    if len(scenes) > 1:
        raise InputError("report: the strip shows one scene; name one of them")
    data, folder = load_report(path)
    target = ensure_folder(output or folder)
    # The page is drawn before anything is written: a report that cannot be drawn leaves the target
    # as it is.
    page = render_page(data, folder)
    # Two commands that write the same folder at a time would mix their files.
    with alone(target):
        # Into another folder the whole report is copied, so that its page finds the images.
        if not target.samefile(folder):
            for name in ("report.json", *named_files(data)):
                write_bytes(target / name, (folder / name).read_bytes())
        write_text(target / "report.html", page)
        written = _figures(target, figures, scenes, labels) if figures else ()
    return Report(folder=target, data=data, done="drawn again", figures=written)


def _measured(
    target: Path,
    effort: str,
    scenes: list[Any],
    methods: list[Any],
    kernels: list[Any],
    settings: Any,
    *,
    size: tuple[int, int] | None,
    images: Any,
    model: "Model | None",
    fresh: bool,
    cluster: str | None,
    command: str,
    progress: Any,
) -> "records.Report":
    """Measure and write a report; unusable input is refused before the work begins."""
    import gc

    from airlight.reports.machine.environment import activate

    # The address of a cluster is checked here, and connected to only when the work begins.
    place = None
    if cluster is not None:
        from airlight.reports.cluster.connect import connected, parse_place

        place = parse_place(cluster)
    # Scenes are opened twice, and by other processes: by their names. A misspelt one is refused
    # before Mitsuba starts.
    for each in scenes:
        if not isinstance(each, str | os.PathLike):
            raise InputError(
                f"scenes: got {type(each).__name__}, expected the name or the path of a scene"
            )
        if not os.fspath(each).endswith(".toml"):
            check_scene(each)
    activate()
    from airlight.realtime.methods.shader.source import is_users
    from airlight.reports.api.configurations import asked_configurations
    from airlight.reports.report.measure import write_report
    from airlight.validation.study.cost import TIMED, check_work, frame_work, reference_work
    from airlight.validation.study.study import RandomScenes, standard_study

    # A study file replaces the effort: it says scenes, sizes and methods.
    study, asked = standard_study(effort), [os.fspath(path) for path in scenes]
    if len(asked) == 1 and asked[0].endswith(".toml"):
        beside = {effort: effort != "default", "size": size}
        exclude(asked[0], "the study says how much is measured", beside)
        study, asked = _study_of(Path(asked[0])), []
    if images is not None:
        exclude("images", "they have sizes of their own", {"size": size})
    study = study.at(size)
    # Images from elsewhere decide the scenes where none is named.
    names, shown = _scenes_of_images(asked, images, tuple(study.scene_names()))
    # With `apart` user code runs in other processes, which can be ended when a method hangs.
    chosen, apart = asked_configurations(methods, kernels, settings, usual=study.configurations)
    # A newcomer expects the built-in methods beside the new one; measuring them takes minutes, so
    # that the user decides.
    if methods and all(isinstance(name, str) and is_users(name) for name in methods):
        note(
            progress,
            ["what --method names is measured alone; --method all adds the built-in methods"],
        )
    if shown:  # the sizes of an effort are known to be right; those of images are the user's
        from airlight.validation.engine.images import images_size

        sizes = [images_size(tuple(several)) for several in shown.values()]
        works = [reference_work(size) for size in sizes]
        works += [frame_work(size, steps=100, frames=TIMED * len(chosen)) for size in sizes]
        check_work("report --images", works)
    # modules live as long as the process: what looks for garbage before each
    # frame need not look there
    gc.freeze()
    # Workers are connected last, and let go whether the report succeeds or not.
    with ExitStack() as stack, telling(progress, "report") as tell:
        return write_report(
            target,
            replace(
                study, scenes=tuple(names), random=RandomScenes(), configurations=tuple(chosen)
            ),
            images=shown,
            model=model,
            command=command,
            fresh=fresh,
            apart=apart,
            progress=tell,
            noted=partial(note, progress),
            cluster=None if place is None else stack.enter_context(connected(place)),
        )


def _study_of(path: Path) -> "Study":
    """Return the study of a file; one that asks for something that a report drops is refused."""
    from airlight.validation.study.settings import Measure
    from airlight.validation.study.study import read_study, standard_study

    study = read_study(path)
    # Growth is timed in the scene of a study of its own, for as long as this one says.
    growing = standard_study("scaling").scenes
    if study.growth and not set(growing) <= set(study.scenes):
        raise InputError(
            f"study {path}: got growth, which is timed in {', '.join(growing)} alone: add it to the "
            "scenes, or leave growth out"
        )
    measure, usual = study.measure, Measure()
    staged = ("slow",) if study.growth else ("slow", "seconds")
    idle = [name for name in staged if getattr(measure, name) != getattr(usual, name)]
    if idle and measure.times != "stages":
        raise InputError(
            f"study {path}: got {', '.join(idle)} of times = 'stages', and times = "
            f"'{measure.times}': leave one of them out"
        )
    dropped = ["sizes"] if len(study.sizes) > 1 else []
    dropped += ["media"] if any(study.media) else []
    dropped += study.asked_of("timed", "limit", "retries")
    if dropped:
        raise InputError(
            f"study {path}: got {', '.join(dropped)}, but a report has one size, the media of its "
            "scenes, and all of them timed, in processes without a limit: leave them out, or "
            f"airlight sweep {path}"
        )
    return study


def _scenes_of_images(
    asked: Sequence[str], images: Any, usual: Sequence[str]
) -> "tuple[list[str], dict[str, tuple[EngineImage, ...]]]":
    """Return the scenes to study and the images by scene, from a folder of images or None.

    Scenes are those `asked` for; without any those of the images, or the
    `usual` ones without images.
    """
    if images is None:
        return list(asked or usual), {}
    from airlight.validation.engine.images import find_images
    from airlight.validation.scenes.names import scene_stem
    from airlight.validation.scenes.registry import SCENES

    # A file is matched by the stem of a scene: the built-in scenes, and the files that the command
    # names.
    shown = find_images(images, {scene_stem(name): name for name in [*SCENES, *asked]})
    names = list(asked or shown)
    wanted = {scene_stem(name) for name in names}
    # A folder without an image of these scenes is a mistake; one with images of some of them is
    # not.
    if not wanted & set(shown):
        raise InputError(
            f"--images: {images} has no image of {', '.join(sorted(wanted))}, only of "
            f"{', '.join(shown)}"
        )
    return names, {name: several for name, several in shown.items() if name in wanted}


def _done(report: "records.Report") -> str:
    """Say how long it took, and how much of it had been measured before."""
    from airlight.reports.page.filters import kept_words

    kept = kept_words(report)
    more = f"; {kept}; --fresh measures again" if kept else ""
    return f"{report.computed} results in {report.seconds:.0f} s{more}"
