# SPDX-License-Identifier: BSD-3-Clause
"""The error report: a study written down as EXR files, pictures, report.json and one page of HTML.

Every result is kept on disk as soon as it is there (`validation.study.scene`): a report that was
killed goes on where it stopped, and one in which nothing changed measures nothing. The files of a
report appear when it is whole.
"""

import gc
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from airlight.analytic.clock import stopwatch
from airlight.errors import InputError
from airlight.realtime.child_process import EndedError
from airlight.realtime.methods.shader.source import is_shader
from airlight.reference.scene.model import Model
from airlight.reference.storage.files import ensure_folder
from airlight.reference.storage.store import Kept, date, fresh_results
from airlight.reports.data.records import (
    SCHEMA,
    Environment,
    Measured,
    Report,
    load_report,
    named_files,
    report_text,
)
from airlight.reports.machine.environment import describe_environment, machine, threads
from airlight.reports.machine.opengl import require_opengl
from airlight.reports.machine.own_process import in_own_process
from airlight.reports.machine.progress import Progress, sharing
from airlight.reports.page.render import render_page
from airlight.reports.report.claims import claims, growth_claims, own_fault, unstudied
from airlight.reports.report.others import other_parts, paper_rows
from airlight.reports.report.scene import folder_of, write_scene
from airlight.reports.report.staged import staged
from airlight.validation.columns import record_of
from airlight.validation.scenes.names import scene_stem
from airlight.validation.scenes.registry import FOG_SCENES
from airlight.validation.study.configuration import Configuration
from airlight.validation.study.run import PROBE, frame_of
from airlight.validation.study.scene import SceneStudy, open_scene
from airlight.validation.study.study import STUDIES, Cell, Study, standard_study
from airlight.validation.study.study_scene import expected_seconds, study_scene
from airlight.validation.study.turns import Apart

if TYPE_CHECKING:
    from airlight.reports.cluster.connect import Client
    from airlight.validation.engine.images import EngineImage
    from airlight.validation.estimates.monte_carlo import ElsewhereFor
    from airlight.validation.study.scene_rows import Judged


def write_report(
    folder: Path | str,
    study: Study,
    *,
    images: Mapping[str, Sequence["EngineImage"]] | None = None,
    model: Model | None = None,
    command: str = "airlight report",
    fresh: bool = False,
    apart: bool = False,
    progress: Progress | None = None,
    noted: Callable[[Sequence[str]], None] = lambda notes: None,
    cluster: "Client | None" = None,
) -> Report:
    """Study scenes and write the report into a folder; return the content of
    report.json, see docs/formats.md.

    Only the first of the sizes of the study counts, and none of its media. `images` from elsewhere
    are judged, by scene, at their size, by the equation of a `model` or of that which their scene
    names. The page names `command` under "how to reproduce". `fresh` computes everything again.
    With `apart` user methods run in separate processes, where a fault becomes a row (`own_faults`);
    else it ends the report. `noted` is called with notes on the scenes before the work. Workers of
    `cluster` compute references and the batches that check them; methods run here. Unusable input
    is refused, and an existing report is not damaged.
    """
    # Mistakes are looked for before anything is measured: names, sizes of images, drivers, scenes.
    names = tuple(study.scene_names())
    _refuse_twins(names)
    shown = dict(images or {})
    sizes = {}
    if shown:
        from airlight.validation.engine.images import images_size

        sizes = {name: images_size(tuple(several)) for name, several in shown.items()}
    environment, took = describe_environment(), stopwatch()
    if any(is_shader(chosen.method) for chosen in study.configurations):
        environment["opengl"] = require_opengl()
    # A user's method may hang: then it runs where it can be ended.
    process = in_own_process if apart else None
    since, notes, of_scenes, referenced = (
        time.time() if fresh else None,
        list[str](),
        [],
        list[Cell](),
    )

    def opened(name: str) -> SceneStudy:
        return open_scene(name, study.of(name).at(sizes.get(scene_stem(name))), machine())

    with fresh_results(since):
        for name in names:
            # Every scene is opened once to be checked and to say how long it will take, and again
            # when its turn comes.
            each = opened(name)
            notes += each.scene.features.notes
            of_scenes.append((f"{each.name}: ", expected_seconds(each)))
            if cluster is not None:
                from airlight.reports.cluster.references import image_of

                referenced.append(image_of(each.loaded, each.size))
        noted(notes)
    # Not before the scenes are known to be right: a mistake leaves no empty folder.
    target = ensure_folder(folder)
    with fresh_results(since), staged(target, images_before) as hidden:
        # The bar gives each part the time that it is expected to take; a cached part takes none,
        # and the page a second for each scene.
        others = other_parts(study)
        whole = [(words, sum(parts.values())) for words, parts in of_scenes]
        whole += [(f"{part.title}, ", part.seconds) for part in others]
        *steps, page = sharing(progress, [*whole, ("", 1.0 * len(names))])
        studied, results = [], list[Kept[Any]]()
        if cluster is not None:
            from airlight.reports.cluster.references import bring_references

            bring_references(cluster, referenced, points=study.points)
        ended = _try_own(names[0], study, process) if names else {}
        for name, (_, parts), step in zip(names, of_scenes, steps):
            # One scene at a time: Mitsuba compiles a virtual call for the materials, media and
            # lights of all scenes that are loaded. A batch of volpath takes eight times as long
            # with ten others.
            gc.collect()
            each = opened(name)
            result = study_scene(
                each,
                images=shown.get(scene_stem(each.path), ()),
                model=model,
                apart=process,
                ended=ended,
                progress=_begins(step, parts),
                spread=_spread(cluster, each),
                workers=threads(),
            )
            _raise_own_faults(result.rows, process)
            results += result.results
            studied.append(write_scene(result, hidden))
            del each, result
        gc.collect()
        # Parts that belong to no scene follow the scenes, with the time of each kind.
        by_kind: dict[str, list[Any]] = {}
        seconds = {"scenes": took().seconds, "stability": 0.0, "scaling": 0.0, "papers": 0.0}
        for part, step in zip(others, steps[len(names) :]):
            of_part = stopwatch()
            found = part.result(step)
            seconds[part.kind] += of_part().seconds
            by_kind.setdefault(part.kind, []).append(found.value)
            results.append(found)
        # A part returns a list of records; the report has all of a kind in one.
        scaling = [each for found in by_kind.get("scaling", ()) for each in found]
        usual = study.name in STUDIES and names == standard_study(study.name).scenes
        kernels = [each for found in by_kind.get("stability", ()) for each in found]
        kept, made = sum(found.loaded for found in results), sorted(found.made for found in results)
        report = Report(
            schema=SCHEMA,
            created=date(),
            command=command,
            seconds=round(took().seconds, 1),
            parts={kind: round(taken, 2) for kind, taken in seconds.items()},
            cached=kept,
            computed=len(results) - kept,
            measured=Measured(first=date(made[0]), last=date(made[-1])) if made else None,
            settings=study.settings,
            environment=record_of(environment, Environment),
            claims=(
                *claims(studied),
                *growth_claims(scaling),
                *(unstudied(names, list(FOG_SCENES)) if usual else []),
            ),
            scenes=tuple(studied),
            stability=tuple(kernels),
            scaling=tuple(scaling),
            papers=tuple(paper_rows(by_kind.get("papers", ()))),
        )
        # Data before the page: the page is drawn from the record alone, as `--from` does.
        page(0.0, "the page")
        (hidden / "report.json").write_text(report_text(report), encoding="utf-8", newline="\n")
        (hidden / "report.html").write_text(
            render_page(report, hidden), encoding="utf-8", newline="\n"
        )
    page(1.0, "done")
    return report


def images_before(folder: Path) -> Iterator[str]:
    """Yield the names of the images of the report in a folder."""
    return named_files(load_report(folder)[0])


def _begins(progress: Progress, seconds: Mapping[str, float]) -> Callable[[str], None]:
    """Return what tells that a part of a scene begins, by its name;
    `seconds`: what each part takes.
    """
    parts = dict(zip(seconds, sharing(progress, seconds.items())))
    return lambda name: parts[name](0.0, "")


def _spread(cluster: "Client | None", study: SceneStudy) -> "ElsewhereFor | None":
    """Return the function that lets workers trace the batches that check
    the reference of a scene.
    """
    if cluster is None:
        return None
    from airlight.reports.cluster.references import image_of, spread

    return spread(cluster, image_of(study.loaded, study.study.checks.size))


def _try_own(scene: str, study: Study, apart: Apart | None) -> dict[Configuration, str]:
    """Render a small frame with every user method: what is at fault there is said before the work.

    Returns the methods that ended their process, with how: they are not called again.
    """
    # A small frame shows most faults of code. Refusals of this scene are no faults.
    ended = {}
    for chosen in study.configurations:
        if not chosen.own:
            continue
        cell = Cell(scene, PROBE, (), chosen)
        try:
            _ = frame_of(cell) if apart is None else apart(frame_of, cell, name=chosen.method)
        except InputError as error:
            fault = own_fault(chosen.method, str(error))
            # In this process the report cannot go on after a fault of the user's method; in another
            # one it does, without the methods that ended their process.
            if fault and apart is None:
                raise InputError(fault) from error
            if fault:
                print(f"airlight: warning: {fault}; the report goes on", file=sys.stderr)
            if isinstance(error, EndedError):
                ended[chosen] = str(error)
    return ended


def _raise_own_faults(rows: "Sequence[Judged]", apart: Apart | None) -> None:
    """Raise the first fault of a user's method that runs in this process."""
    for judged in rows if apart is None else ():
        fault = own_fault(judged.row.method, judged.row.reason)
        if fault:
            raise InputError(fault)


def _refuse_twins(scenes: Sequence[str]) -> None:
    """Refuse scenes whose images would lie in one folder."""
    for name, count in Counter(folder_of(scene) for scene in scenes).items():
        if count > 1:
            raise InputError(
                f"scenes: two scenes are called {name}; give each once, or rename one of the files"
            )
