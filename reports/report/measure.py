# SPDX-License-Identifier: BSD-3-Clause
"""The error report: studies written down as EXR files, pictures, report.json and one page of HTML.

Every result is kept on disk as soon as it is there (`validation.frames.result_cache`), so a report that was
interrupted goes on where it stopped and one in which nothing changed measures nothing. The files of a report appear
when it is whole.
"""

import json
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from datetime import datetime
from pathlib import Path
from typing import Any

from analytic.errors import InputError
from reference.storage.files import ensure_folder
from reports.data.claims import claims, unstudied
from reports.data.serialize import SCHEMA, plain
from reports.machine.environment import describe_environment
from reports.machine.progress import Interrupted, Progress, part_of
from reports.page.render import render_page
from reports.report.papers import mutations_part, published_part, stability_part
from reports.report.scene import raise_own_error, scene_report
from reports.report.staging import staged
from validation.comparison.engine_images import EngineImage, images_size
from validation.configurations.methods import STANDARD, Configuration
from validation.frames.result_cache import Kept, keeper, now, sweep_results
from validation.frames.scene_study import Effort, open_study
from validation.scenes.registry import SCENES

#: Modules that make what is kept, besides the four sides.
_MAKERS = (
    "data/serialize.py",
    "plotting/pictures.py",
    "plotting/colour_maps.py",
    "papers/biri.py",
    "papers/billeter.py",
    "report/scene.py",
    "report/papers.py",
)
#: Where the parts begin in the progress, with and without the faults of the physics, which take minutes.
_PARTS = ("scenes", "stability", "mutations", "published", "page")
_BEGIN = {False: (0.0, 0.85, 0.9, 0.9, 0.99), True: (0.0, 0.7, 0.71, 0.85, 0.99)}


def write_report(
    folder: Path | str,
    *,
    scenes: Sequence[str],
    effort: Effort,
    configurations: Sequence[Configuration] = STANDARD,
    images: Mapping[str, Sequence[EngineImage]] | None = None,
    command: str = "airlight report",
    fresh: bool = False,
    progress: Progress | None = None,
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
        Measure again what was kept from earlier runs.
    progress
        Called with (share done, what) now and then.

    Returns
    -------
    dict
        The content of `report.json`, see docs/report-schema.md.

    Raises
    ------
    InputError
        If the folder cannot be written, a scene or an image cannot be used, or a method of one's own is at fault;
        nothing that was there before is damaged.
    Interrupted
        At Ctrl-C, with what is kept.
    """
    _refuse_twins(scenes)
    shown = dict(images or {})
    sizes = {name: images_size(tuple(several)) for name, several in shown.items()}
    target = ensure_folder(folder)
    environment = describe_environment()
    sweep_results()
    results: list[Kept] = []
    watch = _Watch(progress, _BEGIN[effort.mutations])
    here = Path(__file__).parent.parent
    machine = {name: str(environment.get(name)) for name in ("processor", "threads", "variant", "llvm", "device")}
    common = keeper(machine, more=[here / name for name in _MAKERS], fresh=fresh)
    try:
        with staged(target) as hidden:
            found = []
            every = watch.within("scenes")
            for number, name in enumerate(scenes):
                stem = Path(name).stem
                tell = part_of(every, number / len(scenes), (number + 1) / len(scenes), before=f"{stem}: ")
                study = open_study(name, effort, size=sizes.get(stem))
                if number == 0:
                    _try_own(study, configurations)
                found.append(
                    scene_report(
                        study,
                        configurations=configurations,
                        images=shown.get(stem, ()),
                        keeper=common,
                        folder=hidden,
                        results=results,
                        tell=tell,
                    )
                )
                watch.part("scenes")
            stability = stability_part(effort, common, results, watch.within("stability"))
            watch.part("stability")
            mutations = mutations_part(effort, common, results, watch.within("mutations"))
            watch.part("mutations")
            papers = published_part(effort, scenes, common, results, watch.within("published"))
            watch.part("published")
            data = {
                "schema": SCHEMA,
                "created": now(),
                "command": command,
                "seconds": watch.seconds(),
                "parts": watch.parts,
                **_counts(results),
                "settings": plain(asdict(effort)),
                "environment": environment,
                "claims": claims(found) + (unstudied(scenes, list(SCENES)) if tuple(scenes) == effort.scenes else []),
                "scenes": found,
                "stability": stability,
                "mutations": mutations,
                "published": papers,
            }
            watch.within("page")(0.0, "the page")
            write_page(data, images=hidden, folder=hidden)
    except KeyboardInterrupt as stop:
        raise Interrupted(_kept_words(results, str(stop))) from None
    watch.within("page")(1.0, "done")
    return data


def write_page(data: Mapping[str, Any], *, images: Path, folder: Path) -> None:
    """Write report.json and the page that is made from it and from the files it names, which lie in `images`."""
    text = json.dumps(data, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
    (folder / "report.json").write_text(text, encoding="utf-8", newline="\n")
    (folder / "report.html").write_text(render_page(dict(data), images), encoding="utf-8", newline="\n")


class _Watch:
    """The time that the parts of a run take, and how far it is."""

    def __init__(self, progress: Progress | None, begin: Sequence[float]) -> None:
        self._progress, self._begin = progress, begin
        self._start = self._last = time.monotonic()
        self.parts: dict[str, float] = {}  #: seconds of this run by part

    def within(self, part: str) -> Progress:
        """Return a function to tell the share done of one of the parts."""
        number = _PARTS.index(part)
        return part_of(self._progress, self._begin[number], (*self._begin, 1.0)[number + 1])

    def part(self, name: str) -> None:
        """Note that a part is over."""
        now = time.monotonic()
        self.parts[name] = round(self.parts.get(name, 0.0) + now - self._last, 2)
        self._last = now

    def seconds(self) -> float:
        """Return the seconds since the start."""
        return round(time.monotonic() - self._start, 1)


def _counts(results: Sequence[Kept]) -> dict[str, Any]:
    """Return how many results were kept, how many computed, and when the first and the last of all."""
    kept = sum(one.cached for one in results)
    order = sorted((one.measured for one in results), key=lambda text: datetime.strptime(text, "%Y-%m-%d %H:%M:%S %z"))
    measured = {"first": order[0], "last": order[-1]} if order else None
    return {"kept": kept, "computed": len(results) - kept, "measured": measured}


def _kept_words(results: Sequence[Kept], more: str) -> str:
    words = f"{len(results)} results are kept" if results else "no result was finished yet"
    return f"{words}{f' ({more})' if more else ''}; nothing was written; run the same command again to go on"


def _try_own(study, configurations: Sequence[Configuration]) -> None:
    """Render a small frame with every method of the user's own: what is at fault there is said before the work."""
    from realtime.errors import InputError as MethodError
    from realtime.frame.renderer import render_frame
    from validation.configurations.methods import prepared

    for one in configurations:
        if one.own:
            try:
                render_frame(prepared(study.probe, one))
            except MethodError as error:
                raise_own_error(one, str(error))


def _refuse_twins(scenes: Sequence[str]) -> None:
    """Refuse scenes whose images would lie in one folder."""
    for name, count in Counter(Path(scene).stem for scene in scenes).items():
        if count > 1:
            raise InputError(f"scenes: two scenes are called {name}; give each once, or rename one of the files")
