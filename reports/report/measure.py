# SPDX-License-Identifier: BSD-3-Clause
"""The error report: studies written down as EXR files, pictures, report.json and one page of HTML.

Every result is kept on disk as soon as it is there (`validation.study.results`): a report that was killed goes on
where it stopped, and one in which nothing changed measures nothing. The files of a report appear when it is whole.
"""

import sys
import time
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import Any

from analytic.errors import InputError
from realtime.errors import InputError as MethodError
from realtime.frame.renderer import render_frame
from reference.storage.files import ensure_folder
from reference.storage.kept import fresh_results
from reports.cluster.connect import Cluster
from reports.cluster.references import Picture, bring_truths, spread
from reports.data.claims import claims, growth_claims, unstudied
from reports.data.own_faults import own_fault
from reports.data.reader import SCHEMA, report_text
from reports.machine.environment import describe_environment
from reports.machine.own_process import EndedError, in_own_process
from reports.machine.progress import Progress, part_of
from reports.page.render import render_page
from reports.report.claims import paper_parts, paper_rows
from reports.report.expected import PAGE_SECONDS, other_seconds, scene_seconds, shares
from reports.report.papers import OtherPart, other_parts
from reports.report.scene import OwnMethods, SceneKeys, folder_of, scene_report
from reports.report.staging import staged
from validation.comparison.engine_images import EngineImage, images_size
from validation.metrics.errors import plain
from validation.scenes.loading import scene_stem
from validation.scenes.random_scene import is_random
from validation.scenes.registry import FOG_SCENES, SCENES
from validation.study.configuration import STANDARD, Configuration, prepared
from validation.study.results import CachedResult, cached_result, now
from validation.study.run import Apart, render_by_name
from validation.study.scene import Effort, SceneStudy, open_study


def write_report(
    folder: Path | str,
    *,
    scenes: Sequence[str],
    effort: Effort,
    configurations: Sequence[Configuration] = STANDARD,
    images: Mapping[str, Sequence[EngineImage]] | None = None,
    command: str = "airlight report",
    fresh: bool = False,
    method_limit: float | None = None,
    progress: Progress | None = None,
    cluster: Cluster | None = None,
) -> dict[str, Any]:
    """Study scenes and write the report.

    Parameters
    ----------
    folder
        Where `report.html`, `report.json` and a folder for each scene go.
    scenes
        Built-in names and paths of Mitsuba XML files.
    effort
        How much work to do.
    configurations
        What to measure.
    images
        By scene, images from elsewhere to judge; such a scene is studied at their size.
    command
        The command line that the page names under "how to reproduce".
    fresh
        Compute everything again, references, batches and rays too.
    method_limit
        Methods of the user's own run in processes of their own, so long at most in each scene [s], and what is at fault
        there stands in their rows (`own_faults`). None: they run in this process, and a fault ends the report.
    progress
        Called with (share done, what) now and then.
    cluster
        Whose workers compute truths, the batches that check them, and faults of the physics; methods run here.

    Returns
    -------
    dict
        The content of `report.json`, see docs/formats.md.

    Raises
    ------
    InputError
        If the folder cannot be written, a scene or an image cannot be used, or a method of one's own that runs in
        this process is at fault; nothing that was there before is damaged.
    """
    _refuse_twins(scenes)
    shown = dict(images or {})
    sizes = {name: images_size(tuple(several)) for name, several in shown.items()}
    target = ensure_folder(folder)
    environment = describe_environment()
    results: list[CachedResult] = []
    start = time.monotonic()
    efforts = {name: effort.of(name).at(sizes.get(scene_stem(name))) for name in scenes}
    apart = None if method_limit is None else partial(in_own_process, limit=method_limit)
    ended: dict[Configuration, str] = {}
    seconds = dict.fromkeys(("scenes", "stability", "scaling", "papers"), 0.0)
    with fresh_results(time.time() if fresh else None), staged(target) as hidden:
        keys = {name: SceneKeys.of(name, each) for name, each in efforts.items()}
        others = [*other_parts(effort, scenes), *paper_parts(effort, scenes)]
        steps = _steps(progress, keys, configurations, others)
        if cluster is not None:
            with _timed(seconds, "scenes"):
                bring_truths(cluster, [_picture(name, each.image) for name, each in efforts.items()])
        studied = []
        with _timed(seconds, "scenes"):
            for number, (name, sized_effort) in enumerate(efforts.items()):
                study = open_study(name, sized_effort)
                if number == 0:
                    ended = _try_own(study, configurations, apart)
                studied.append(
                    scene_report(
                        study,
                        configurations=configurations,
                        images=shown.get(scene_stem(name), ()),
                        keys=keys[name],
                        folder=hidden,
                        results=results,
                        own=OwnMethods(apart, ended),
                        progress=steps[name],
                        spread=None if cluster is None else spread(cluster, _picture(name, sized_effort.checked)),
                    )
                )
        by_kind: dict[str, list[CachedResult]] = {}
        for number, part in enumerate(others):
            step = part_of(steps[str(number)], 0.0, 1.0, before=f"{part.title}, ")
            with _timed(seconds, part.kind):
                results.append(cached_result(part.key, partial(part.compute, step)))
            by_kind.setdefault(part.kind, []).append(results[-1])
        stability = by_kind.get("stability")
        scaling = [record for result in by_kind.get("scaling", ()) for record in result.data["scaling"]]
        data = {
            "schema": SCHEMA,
            "created": now(),
            "command": command,
            "seconds": round(time.monotonic() - start, 1),
            "parts": seconds,
            **_counts(results),
            "settings": plain(asdict(effort)),
            "environment": environment,
            "claims": claims(studied)
            + growth_claims(scaling)
            + (unstudied(scenes, list(FOG_SCENES)) if tuple(scenes) == effort.scenes else []),
            "scenes": studied,
            "stability": stability[-1].data["kernels"] if stability else [],
            "scaling": scaling,
            "papers": paper_rows(by_kind),
        }
        steps["page"](0.0, "the page")
        write_page(data, images=hidden, folder=hidden)
    steps["page"](1.0, "done")
    return data


def write_page(data: Mapping[str, Any], *, images: Path, folder: Path) -> None:
    """Write report.json and the page that is made from it and from the files it names, which lie in `images`."""
    (folder / "report.json").write_text(report_text(data), encoding="utf-8", newline="\n")
    (folder / "report.html").write_text(render_page(dict(data), images), encoding="utf-8", newline="\n")


def _steps(
    progress: Progress | None,
    keys: Mapping[str, SceneKeys],
    configurations: Sequence[Configuration],
    others: Sequence[OtherPart],
) -> dict[str, Progress]:
    """Return the progress of each part: a scene by its name, another part by its number, and the 'page'."""
    seconds = {
        name: sum(scene_seconds(scene_stem(name), of_scene.effort.image, of_scene.named(configurations)).values())
        for name, of_scene in keys.items()
    }
    seconds |= {str(number): other_seconds(part.key, part.kind) for number, part in enumerate(others)}
    seconds["page"] = PAGE_SECONDS * len(keys)
    names = {name: f"{scene_stem(name)}: " for name in keys}
    return {name: part_of(progress, *share, before=names.get(name, "")) for name, share in shares(seconds).items()}


@contextmanager
def _timed(seconds: dict[str, float], part: str) -> Iterator[None]:
    """Add the time that a block takes to that of a part [s]."""
    start = time.monotonic()
    yield
    seconds[part] = round(seconds.get(part, 0.0) + time.monotonic() - start, 2)


def _picture(name: str, size: tuple[int, int]) -> Picture:
    """Return a scene of the command line as workers load it."""
    return Picture(name if name in SCENES or is_random(name) else str(Path(name).resolve()), size)


def _counts(results: Sequence[CachedResult]) -> dict[str, Any]:
    """Return how many results were kept, how many computed, and when the first and the last of all."""
    kept = sum(result.cached for result in results)
    times = [result.measured for result in results]
    order = sorted(times, key=lambda text: datetime.strptime(text, "%Y-%m-%d %H:%M:%S %z"))
    measured = {"first": order[0], "last": order[-1]} if order else None
    return {"kept": kept, "computed": len(results) - kept, "measured": measured}


def _try_own(
    study: SceneStudy, configurations: Sequence[Configuration], apart: Apart | None
) -> dict[Configuration, str]:
    """Render a small frame with every method of the user's own: what is at fault there is said before the work.

    Returns those that ended their process, with how: they are not called again.
    """
    ended = {}
    for configuration in configurations:
        if not configuration.own:
            continue
        try:
            if apart is None:
                render_frame(prepared(study.probe, configuration))
            else:
                name = str(study.loaded.path or study.loaded.name)
                size = study.probe.camera.width, study.probe.camera.height
                apart(render_by_name, name, size, configuration, name=configuration.method)
        except (InputError, MethodError) as error:
            fault = own_fault(configuration.method, str(error))
            if fault and apart is None:
                raise InputError(fault) from error
            if fault:
                print(f"airlight: warning: {fault}; the report goes on", file=sys.stderr)
            if isinstance(error, EndedError):
                ended[configuration] = str(error)
    return ended


def _refuse_twins(scenes: Sequence[str]) -> None:
    """Refuse scenes whose images would lie in one folder."""
    for name, count in Counter(folder_of(scene) for scene in scenes).items():
        if count > 1:
            raise InputError(f"scenes: two scenes are called {name}; give each once, or rename one of the files")
