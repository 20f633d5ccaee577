# SPDX-License-Identifier: BSD-3-Clause
"""`airlight report`: the error report."""

import shlex
import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from reports.commands import completion
from reports.commands.options import (
    USUAL_LIMIT,
    ClusterPlace,
    Force,
    Meshes,
    MethodLimit,
    Methods,
    Ranges,
    Settings,
    drawn_from,
)


def report(
    scenes: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="SCENE",
            help="Built-in scenes, random:SEED and Mitsuba XML files; four with --quick, eleven by default.",
            show_default=False,
            autocompletion=completion.scenes,
        ),
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Few scenes, small images: some minutes.")] = False,
    full: Annotated[bool, typer.Option("--full", help="Large images, many samples, all tables: an hour.")] = False,
    method: Methods = None,
    kernel: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help="Airlight kernel of the methods; may be given several times.",
            show_default=False,
            autocompletion=completion.kernels,
        ),
    ] = None,
    settings: Settings = None,
    meshes: Meshes = None,
    ranges: Ranges = None,
    images: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Folder with your engine's images, SCENE.exr or SCENE.NAME.exr, judged against the truth.",
            show_default=False,
        ),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            metavar="DIR",
            help="Folder of the report; airlight-report by default.",
            show_default=False,
        ),
    ] = None,
    redraw: Annotated[
        Path | None,
        typer.Option(
            "--from",
            metavar="FILE",
            help="Draw the page of this report.json again, without measuring.",
            show_default=False,
        ),
    ] = None,
    fresh: Annotated[bool, typer.Option("--fresh", help="Measure again what is kept from earlier runs.")] = False,
    method_limit: MethodLimit = USUAL_LIMIT,
    cluster: ClusterPlace = None,
    force: Force = False,
    json: Annotated[bool, typer.Option("--json", help="Print report.json.")] = False,
) -> None:
    """Measure methods in scenes and write the report, one page.

    The page is report.html; beside it lie report.json and each image as EXR and PNG.

    Results that this machine measured before, with the same code and scenes, come from the cache. Exit status 1 if
    single-scatter or volpath does not confirm the truth within the margin, or a method of your own is at fault: the
    report says what became of it.
    """
    from analytic.errors import InputError
    from reports.data.claims import confirmed
    from reports.data.own_faults import own_faults
    from reports.tables.drawing import sentence_in_text
    from reports.tables.methods import fastest_table
    from reports.tables.terminal import print_json, print_table

    if redraw is not None:
        given = {
            "--quick": quick,
            "--full": full,
            "a scene": scenes,
            "--method": method,
            "--kernel": kernel,
            "--set": settings,
            "--meshes": meshes,
            "--ranges": ranges,
            "--images": images,
            "--fresh": fresh,
            "--cluster": cluster,
            "--method-limit": method_limit != USUAL_LIMIT,
            "--force": force,
        }
        for option, value in given.items():
            if value not in (None, False, []):
                raise InputError(f"report: got --from together with {option}; --from measures nothing, leave that out")
        data, target = _redrawn(redraw, output)
        done = "drawn again"
    else:
        if quick and full:
            raise InputError("report: got both --quick and --full; give one of them, or neither for the default")
        target = output or Path("airlight-report")
        effort = "quick" if quick else "full" if full else "default"
        data = _measured(
            target,
            effort,
            scenes=drawn_from(scenes or [], meshes, ranges),
            methods=method or [],
            kernels=kernel or [],
            settings=settings or [],
            images=images,
            fresh=fresh,
            method_limit=method_limit,
            cluster=cluster,
            force=force,
        )
        done = _kept_words(data)
    if json:
        print_json(data)
    else:
        print("\n".join(f"- {sentence_in_text(claim['text'])}" for claim in data["claims"]))
        if data["scenes"]:
            print_table(fastest_table(data["scenes"]))
        count = len(data["scenes"])
        print(f"{target / 'report.html'}: {count} scene{'' if count == 1 else 's'}, {done}")
    faults = own_faults(data)
    for fault in faults:
        print(f"airlight: error: {fault}", file=sys.stderr)
    if faults or not confirmed(data["scenes"]):
        raise typer.Exit(1)


def _redrawn(path: Path, output: Path | None) -> tuple[dict[str, Any], Path]:
    """Draw the page of a report again."""
    from reports.data.reader import load_report, redraw_report

    data, folder = load_report(path)
    target = output or folder
    redraw_report(data, folder, target)
    return data, target


def _measured(
    target: Path,
    effort_name: str,
    *,
    scenes: list[str],
    methods: list[str],
    kernels: list[str],
    settings: list[str],
    images: Path | None,
    fresh: bool,
    method_limit: float,
    cluster: str | None,
    force: bool,
) -> dict[str, Any]:
    """Measure and write a report; unusable input is refused before the work begins."""
    import gc
    from contextlib import ExitStack
    from dataclasses import replace

    from reference.storage.files import ensure_folder
    from reports.cluster.connect import check_library, connected, parse_place
    from reports.commands.own_methods import named_configurations
    from reports.machine.environment import activate
    from reports.machine.printing import print_notes
    from reports.machine.progress import progress_bar
    from reports.report.asked import notes_on, scenes_of_images
    from reports.report.measure import write_report
    from validation.comparison.engine_images import images_size
    from validation.study.cost import check_work, frame_work, truth_work
    from validation.study.study import RandomScenes, read_study, standard_study

    place = None if cluster is None else parse_place(cluster)
    if place is not None:
        check_library()
    study = standard_study(effort_name)
    if len(scenes) == 1 and scenes[0].endswith(".toml"):
        study, scenes = read_study(Path(scenes[0])), []
    names, shown = scenes_of_images(scenes or None, images, tuple(study.scene_names()))
    chosen = named_configurations(methods, kernels, settings, usual=study.configurations, limit=method_limit)
    if methods and all(":" in name for name in methods):
        print_notes(["what --method names is measured alone; --method all adds the built-in methods"])
    activate()
    print_notes(notes_on(names))
    ensure_folder(target)  # not before the scenes are known to be right: a mistake leaves no empty folder
    # The sizes of an effort are known to be right; those of images are the user's.
    sizes = [images_size(tuple(several)) for several in shown.values()]
    works = [truth_work(size) for size in sizes]
    works += [frame_work(size, steps=100, frames=8 * len(chosen)) for size in sizes]
    check_work("report --images", works, force=force)
    gc.freeze()  # modules live as long as the process: what looks for garbage before each frame need not look there
    with ExitStack() as stack, progress_bar("report") as progress:
        return write_report(
            target,
            replace(study, scenes=tuple(names), random=RandomScenes(), configurations=tuple(chosen)),
            images=shown,
            command=shlex.join(["airlight", *sys.argv[1:]]),
            fresh=fresh,
            method_limit=method_limit,
            progress=progress,
            cluster=None if place is None else stack.enter_context(connected(place)),
        )


def _kept_words(data: dict[str, Any]) -> str:
    """Say how long it took, and how much of it had been measured before."""
    seconds, kept, computed = data["seconds"], data["kept"], data["computed"]
    if not kept:
        return f"{computed} results in {seconds:.0f} s"
    when = data["measured"]
    rest = f"{kept} of {kept + computed}" if computed else f"all {kept}"
    return (
        f"{seconds:.0f} s: {rest} results kept from earlier runs, measured from {when['first']} to {when['last']}; "
        "--fresh measures again"
    )
