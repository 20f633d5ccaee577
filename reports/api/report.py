# SPDX-License-Identifier: BSD-3-Clause
"""The Python API for the error report."""

import os
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Literal

from analytic.errors import InputError, nearest
from reports.api.inputs import Progress, one_error, telling
from reports.api.studies import MethodLike, chosen_methods, several

if TYPE_CHECKING:
    from reports.api.tables import Report


@one_error
def report(
    folder: str | os.PathLike[str] = "airlight-report",
    *,
    scenes: Sequence[str] | None = None,
    methods: "Sequence[MethodLike] | None" = None,
    effort: Literal["quick", "default", "full"] = "default",
    images: str | os.PathLike[str] | None = None,
    fresh: bool = False,
    progress: Progress = None,
) -> "Report":
    """Measure methods in scenes and write the error report: one page, its data, EXR files and pictures.

    Parameters
    ----------
    folder
        Where it is written.
    scenes
        Built-in names and paths of Mitsuba XML files; those of `airlight report` by default.
    methods
        As for `bench`; those of `airlight report` by default.
    effort
        'quick' (some minutes), 'default' or 'full' (an hour), as the options of `airlight report`. What was measured
        before, with the same sources on the same machine, is not measured again.
    images
        A folder with EXR files that another renderer wrote, SCENE.exr or SCENE.NAME.exr, to be judged too.
    fresh
        Measure again what was kept.
    progress
        Called with (share done, what); True shows a bar.

    Raises
    ------
    InputError
        For what cannot be used, before the work begins.
    KeyboardInterrupt
        At Ctrl-C; the next report goes on from there.

    Examples
    --------
    >>> import airlight
    >>> report = airlight.report("my-report", scenes=["open-fog"], methods=["unshadowed"])  # doctest: +SKIP
    >>> report.claims[0]  # doctest: +SKIP
    'The truth is confirmed by our own Mitsuba integrator in 1 of 1 comparisons: ...'
    """
    from reference.storage.files import ensure_folder
    from reports.api.tables import Report
    from reports.machine.environment import activate
    from reports.report.asked import notes_on, scenes_of_images
    from reports.report.measure import write_report
    from validation.study.study import STUDIES, standard_study

    if effort not in STUDIES:
        raise InputError(f"effort: got {effort!r}, wanted one of {', '.join(STUDIES)}" + nearest(effort, STUDIES))
    target = ensure_folder(folder)
    activate()
    study = standard_study(effort)
    chosen = study.configurations if methods is None else chosen_methods(methods)
    asked = None if scenes is None else [os.fspath(path) for path in several(scenes)]
    names, shown = scenes_of_images(asked, images, study.scenes)
    notes_on(names)  # refuses a scene that cannot be read, before the work; the notes stand in report.json
    with telling(progress, "report") as callback:
        data = write_report(
            target,
            replace(study, scenes=tuple(names), configurations=chosen),
            images=shown,
            command=f"airlight.report({os.fspath(folder)!r}, ..)",
            fresh=fresh,
            progress=callback,
        )
    return Report(folder=target, data=data)
