# SPDX-License-Identifier: BSD-3-Clause
"""`airlight figures`: figures and tables for papers."""

import importlib
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from reports.commands import completion

if TYPE_CHECKING:
    from types import ModuleType

#: Figure -> its module, and what its `compute` takes: 'quick', 'report' (required), 'published' (a report, optional).
#: A figure's name is its module's `NAME`; its summary is there too.
FIGURES: dict[str, tuple[str, tuple[str, ...]]] = {
    "polynomials": ("polynomials", ("rays",)),
    "phase-functions": ("phase_functions", ()),
    "kernel-errors": ("kernel_errors", ("quick", "progress")),
    "kernel-speed": ("kernel_speed", ("quick", "progress")),
    "convergence": ("convergence", ("quick", "progress")),
    "z-distribution": ("z_distribution", ("quick", "progress")),
    "decomposition": ("decomposition", ("quick", "progress")),
    "slab-orders": ("slab_orders", ("quick", "progress")),
    "cloud-transport": ("cloud_transport", ()),
    "cloud-images": ("cloud_images", ("quick", "progress")),
    "map-size": ("map_size", ("quick", "progress")),
    "scaling": ("scaling", ("quick", "progress")),
    "published": ("published", ("quick", "progress", "published")),
    "paper-images": ("paper_images", ("quick",)),
    "shafts-strip": ("shafts_strip", ("quick", "progress")),
    "frame-speed": ("frame_speed", ("report",)),
    "strip": ("strip", ("report", "scene", "methods")),
    "methods-table": ("methods_table", ("report",)),
}


def figures(
    names: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[FIGURE]... [SCENE]",
            help=f"Figures: {', '.join(FIGURES)}; all by default. A scene of the report is the strip's, the first "
            "with shadows by default.",
            show_default=False,
            autocompletion=completion.figures_and_scenes(*FIGURES),
        ),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            metavar="DIR",
            help="Folder of the figures; airlight-figures by default.",
            show_default=False,
        ),
    ] = None,
    report: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR", help="Folder of a report; airlight-report by default, if it is there.", show_default=False
        ),
    ] = None,
    source: Annotated[
        Path | None,
        typer.Option(
            "--from",
            metavar="DIR",
            help="Draw again from the data in this folder; nothing is measured.",
            show_default=False,
        ),
    ] = None,
    column: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help="Width: single (3.5 inches) or double (7.16 inches).",
            autocompletion=completion.one_of("single", "double"),
        ),
    ] = "double",
    style: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help="A style sheet of matplotlib on top of ours, by name or path; may be given several times.",
            show_default=False,
        ),
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Fewer rays, smaller images, shorter timings.")] = False,
    rays: Annotated[
        int, typer.Option(min=64, max=1_000_000, metavar="N", help="polynomials: rays to count.")
    ] = 100_000,
    methods: Annotated[
        str | None,
        typer.Option(
            metavar="LABELS",
            help="strip: labels of the report, separated by ';'; the best of each by default.",
            show_default=False,
        ),
    ] = None,
) -> None:
    """Write figures and tables for papers, with their data.

    Figures are PDF and PNG, tables LaTeX, data CSV. Computing writes the data, drawing only reads them: the same
    data give the same bytes. Figures of whole frames and images are made from a report (`airlight report`); the
    others are measured here.
    """
    from analytic.errors import InputError, nearest
    from reference.storage.files import ensure_folder
    from reports.figures.files import plot
    from reports.machine.progress import part_of, progress_bar
    from reports.plotting.style import WIDTHS

    scene = None
    words = [name for name in names or () if name not in FIGURES]
    if words:
        if len(words) > 1 or words[0] not in _scene_names(report):
            raise InputError(
                f"figure: got {words[0]!r}, wanted one of {', '.join(FIGURES)}; or a scene of the report, for the strip"
                + nearest(words[0], FIGURES)
            )
        scene, names = words[0], [name for name in names or () if name in FIGURES] or None
    if column not in WIDTHS:
        raise InputError(f"--column: got {column!r}, wanted one of {', '.join(WIDTHS)}" + nearest(column, WIDTHS))
    drawing: dict[str, Any] = {"column": column, "extra": tuple(style or ())}
    if source is not None:
        _redraw(names, source, ensure_folder(output or source), drawing)
        return
    report_path = _report_folder(report)
    given = {"quick": quick, "rays": rays, "report": report_path, "scene": scene, "methods": methods}
    chosen = _chosen(names, report_path)
    if (scene or methods) and "strip" not in chosen:
        raise InputError(
            "a scene and --methods choose images of the figure strip, which is not asked for: leave them out"
        )
    folder = ensure_folder(output or "airlight-figures")
    with progress_bar("figures") as progress:
        for number, name in enumerate(chosen):
            progress(number / len(chosen), name)
            step = part_of(progress, number / len(chosen), (number + 1) / len(chosen), before=f"{name}: ")
            _compute(name, folder, given | {"progress": step})
            plot(_module(name), folder, **drawing)
            _print_files(name, folder)


def _module(name: str) -> "ModuleType":
    return importlib.import_module(f"reports.figures.{FIGURES[name][0]}")


def _report_folder(report: Path | None) -> Path | None:
    """Return the folder of the requested report, or the default one if it exists."""
    from reports.data.reader import load_report
    from reports.figures.report import FOLDER

    if report is not None:
        return load_report(report)[1]
    return FOLDER if (FOLDER / "report.json").is_file() else None


def _scene_names(report: Path | None) -> set[str]:
    """Return the built-in scenes and those of a report."""
    from reports.data.reader import read_report

    folder = _report_folder(report)
    own = [] if folder is None else [scene["name"] for scene in read_report(folder)["scenes"]]
    return {*completion.scene_names(), *own}


def _chosen(names: list[str] | None, report: Path | None) -> list[str]:
    """Return the named figures, or all except those whose report is missing."""
    from analytic.errors import InputError
    from reports.data.reader import read_report
    from reports.figures.report import FOLDER

    need = [] if report else [name for name in names or FIGURES if "report" in FIGURES[name][1]]
    reason = f"made from a report: write one with `airlight report -o {FOLDER}`, or name its folder by --report"
    if names:
        if need:
            raise InputError(f"{', '.join(need)}: {reason}")
        return names
    if need:
        print(f"Left out: {', '.join(need)}: {reason}.")
    if report is None or not read_report(report).get("papers"):
        need.append("published")
        print(
            "Left out: published: no report holds the claims of the papers; named, they are measured in some minutes."
        )
    return [name for name in FIGURES if name not in need]


def _compute(name: str, folder: Path, given: dict[str, Any]) -> None:
    """Write the data of a figure; only what measures starts Mitsuba."""
    takes = FIGURES[name][1]
    settings = {key: given[key] for key in takes if key != "published"}
    if "published" in takes:
        settings["report"] = given["report"]
    if "report" not in takes:
        from reports.machine.environment import activate

        activate()
    _module(name).compute(folder, **settings)


def _redraw(names: list[str] | None, source: Path, target: Path, drawing: dict[str, Any]) -> None:
    """Draw the named figures, or all, from data in a folder."""
    from analytic.errors import InputError
    from reports.figures.files import plot

    chosen = names or [name for name in FIGURES if (source / f"{name}.csv").is_file()]
    if not chosen:
        raise InputError(f"--from: {source} holds no data of a figure; write some with `airlight figures -o {source}`")
    for name in chosen:
        plot(_module(name), source, output=target, **drawing)
        _print_files(name, target)


def _print_files(name: str, folder: Path) -> None:
    made = [suffix for suffix in (".pdf", ".png", ".tex", ".csv") if (folder / f"{name}{suffix}").is_file()]
    print(f"{folder / name}{', '.join(made)}: {_module(name).SUMMARY}", flush=True)
