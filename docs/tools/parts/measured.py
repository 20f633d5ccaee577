# SPDX-License-Identifier: BSD-3-Clause
"""Tables of what was measured, from the report and the records in `docs/data`."""

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

from airlight.reports.data import records
from airlight.reports.tables.agreement import left_out_table
from airlight.reports.tables.costs import cost_table
from airlight.reports.tables.drawing import markdown
from airlight.reports.tables.methods import COLUMNS, fastest_table, method_row, raced
from airlight.reports.tables.papers import count_words, paper_tables
from airlight.reports.tables.table import Column, Name, Row, Table, number
from airlight.validation.columns import record_of
from airlight.validation.kernels.records import KernelCost
from airlight.validation.papers.claims import Claim
from airlight.validation.statistics.records import Fraction, MultipleScattering
from airlight.validation.study.row import Row as CellRow
from parts.listed import table
from parts.shown import scene_picture

DATA = Path(__file__).resolve().parents[2] / "data"
_METHOD = ("frame", "light_moved", "relative_rmse", "relative_bias", "p99", "max")


@dataclass(frozen=True)
class KeptScene:
    """The numbers that the documentation keeps of a scene."""

    name: str
    size: records.Size
    plan: Mapping[str, str]
    counts: Mapping[str, int]
    reference: records.Reference
    multiple: MultipleScattering
    methods: tuple[CellRow, ...]


@cache
def data() -> dict[str, Any]:
    """Return the numbers that the documentation keeps."""
    kept = json.loads((DATA / "report.json").read_text(encoding="utf-8"))
    records.rename_old_keys(kept)
    return kept


@cache
def kept_scenes() -> tuple[KeptScene, ...]:
    """Return the kept numbers of every scene; other keys of a method and its errors
    have their usual values.
    """

    def row(entry: Mapping[str, Any]) -> dict[str, Any]:
        # The kept file leaves out what no page shows.
        error = entry["error"] and {"pixels": 0, "bias": None, "rmse": None} | entry["error"]
        return {**entry, "error": error}

    scenes = (
        {**scene, "methods": [row(entry) for entry in scene["methods"]]}
        for scene in data()["scenes"]
    )
    return tuple(record_of(scene, KeptScene) for scene in scenes)


def provenance() -> str:
    """Return on what machine, when and how the numbers of a page were measured."""
    # The folder of the report is left out of its command: a reader has another.
    report = data()["report"]
    versions = report["versions"]
    command = report["command"].split(" -o ")[0]
    sizes = dict.fromkeys("{} x {}".format(*scene.size) for scene in kept_scenes())
    timed = "{} x {}".format(*report["timed"])
    return (
        f"*Measured {report['created'][:10]} on {report['processor']}, {report['threads']} "
        "threads, "
        f"{report['variant']}, mitsuba {versions['mitsuba']}, drjit {versions['drjit']}, by "
        f"`{command}`. Times are medians of whole frames of {timed} pixels, kernels compiled "
        "before, the "
        "geometry static; `light moved`: a frame after it moved. Errors are those of the airlight "
        "of images of "
        f"{' and '.join(sizes)} pixels against the `quadrature` reference: relative RMSE and bias "
        "over the mean, and "
        "quantiles of |test - ref| / max(ref, 0.001 mean(ref)).*"
    )


def claims() -> str:
    """Return the sentences at the top of the report."""
    return "\n".join(f"> - {claim}" for claim in data()["claims"])


def fastest() -> str:
    """Return which method is the fastest within an error, scene by scene."""
    # A race is between times of one run, and an old report does not say which are.
    if not any(raced(scene.methods) for scene in kept_scenes()):
        unknown = "does not say which of its times are of one run: nothing is the fastest"
        return f"The report at hand {unknown}."
    return markdown(replace(fastest_table(kept_scenes(), code=True), title=""))


def expected(name: str) -> str:
    """Return the time and the error of one configuration of each method in one scene."""
    scene = next(each for each in kept_scenes() if each.name == name)
    report, chosen = data()["report"], dict[str, CellRow]()
    for entry in scene.methods:
        if entry.times and entry.error and entry.kernel in (None, "exact"):
            chosen.setdefault(entry.method, entry)
    said = (
        f"The scene `{name}`, {' x '.join(map(str, report['timed']))} pixels, "
        f"{report['processor']}, {report['threads']} threads, {report['created'][:10]}, by "
        "`airlight report`: the median time of a frame, and the error of its airlight against the "
        "reference."
    )
    rows = [
        [entry.label, number(entry.times.frame.median_ms), number(entry.error.relative_rmse, 2)]
        for entry in chosen.values()
        if entry.times and entry.error
    ]
    return f"{said}\n\n{table(('method', 'frame [ms]', 'relative RMSE'), rows)}"


def method(name: str) -> str:
    """Return a method's costs and errors in every scene."""
    rows, notes = [], []
    for scene in kept_scenes():
        # Numbers in a table; refusals and times that were not measured as a list below.
        for entry in scene.methods:
            if entry.method != name:
                continue
            label = _inside(entry.label)
            if entry.reason or entry.error is None:
                notes.append(
                    f"- {scene.name}, {label}: {entry.reason or entry.note or 'not measured'}"
                )
            else:
                row = method_row(entry)
                rows.append(Row(row.values | {"scene": Name(scene.name), "label": label}))
    if not rows:
        return f"The report at hand did not measure `{name}`."
    columns = (
        Column("scene", "scene", words=True),
        Column("label", "configuration", words=True),
        *list(COLUMNS.values())[1:],
    )
    shown = Table("", columns, tuple(rows)).only("scene", "label", *_METHOD)
    parts = [markdown(shown)]
    if notes:
        parts.append("Refused or left out:\n\n" + "\n".join(notes))
    return "\n\n".join(part for part in parts if part)


def _inside(label: str) -> str:
    """Return the kernel and the parameters, which stand in the brackets of a label."""
    return label.split(" (", 1)[1].rstrip(")") if " (" in label else "-"


def kernel_costs(phase: str) -> str:
    """Return the costs and errors of kernels of the default sizes for one phase function."""
    from airlight.realtime.kernels.registry import KERNELS

    kernels = data()["kernels"]
    if kernels is None:
        return "No costs of kernels are at hand: `airlight study kernels` measures them."
    costs = []
    for cost in (record_of(each, KernelCost) for each in kernels["costs"]):
        # A kernel with a number is shown at its default only.
        default = (
            next(iter(KERNELS[cost.family].parameters.values()), None)
            if cost.family in KERNELS
            else None
        )
        if cost.phase == phase and cost.size in (default, None):
            # Whichever time the study could take stands in the column.
            costs.append(replace(cost, device=cost.time))
    return markdown(
        cost_table("", costs, code=True).only("kernel", "device", "median", "p99", "max")
    )


def left_out() -> str:
    """Return for every scene the fraction of light that single scattering leaves out."""
    fractions = left_out_table(kept_scenes(), code=True)
    keys = ("scene", "medium", "medium_interval", "everything", "everything_interval")
    return markdown(replace(fractions.only(*keys), title=""))


def _percent(found: Fraction) -> str:
    value, low, high = (
        math.nan if each is None else 100 * each for each in (found.value, *found.interval)
    )
    interval = "" if math.isnan(low) else f" ({low:.1f}..{high:.1f})"
    return "an unknown part" if math.isnan(value) else f"{value:.1f} %{interval}"


def scenes() -> str:
    """Return the gallery: every built-in scene with its picture, what it
    is for and what it holds.
    """
    from airlight.validation.scenes.registry import SCENES

    kept = {scene.name: scene for scene in kept_scenes()}
    return "\n".join(_scene(record, kept.get(name)) for name, record in SCENES.items())


def _scene(record: Any, kept: KeptScene | None) -> str:
    words = [f"## `{record.name}`", "", scene_picture(record.name)]
    words += [record.purpose, "", f"- Published: {record.published}."]
    # A scene that the kept report did not measure has its picture and its purpose only.
    if kept:
        count, lights = kept.counts, kept.plan["lights"]
        words.append(
            f"- {count['shapes']} shapes, {count['triangles']} triangles, lights: {lights}."
        )
        words.append(f"- Medium: {kept.plan['medium']}; extinction: {kept.plan['extinction']}.")
        reference = kept.reference
        if reference.relative_error is not None:
            error = number(reference.relative_error, 2)
            kind = f" ({reference.kind})" if reference.kind else ""
            words.append(
                f"- Reference: mean airlight {number(reference.mean)} W/(m^2 sr), relative error "
                f"{error}{kind}."
            )
        words.append(
            f"- Single scattering leaves out {_percent(kept.multiple.medium)} of the airlight."
        )
    return "\n".join([*words, ""])


@cache
def _papers() -> dict[str, Any]:
    """Return what `airlight paper --json` printed."""
    return json.loads((DATA / "papers.json").read_text(encoding="utf-8"))


def _judged() -> dict[str, Any]:
    """Return the result of `airlight paper --json`."""
    return _papers()["result"]


def verdicts() -> str:
    """Return the verdict on every claim of the papers, a section for each."""
    rows = [record_of(row, Claim) for row in _judged()["papers"] if row["verdict"]]
    parts = []
    for shown in paper_tables(rows, plain=False):
        parts.append(f"## {shown.title}\n\n{shown.explanation}")
        parts.append(markdown(replace(shown, title="", explanation="")))
    return "\n\n".join(parts)


def judged() -> str:
    """Return how many claims have each verdict, and what measured them."""
    command, record = _papers()["command"], _judged()
    made = record["environment"]
    rows = [record_of(row, Claim) for row in record["papers"] if row["verdict"]]
    rest = f" {record['left_out']} more were not measured." if record["left_out"] else ""
    return (
        f"{count_words(rows)}.{rest} Measured {record['measured'][:10]} by `{command}`, commit "
        f"{made['build']['commit'][:12]}, on {made['processor']}, {made['threads']} threads, "
        f"mitsuba {made['versions']['mitsuba']}, drjit {made['versions']['drjit']}."
    )


def cycles() -> str:
    """Return the faults that were set in Blender's Cycles, and what the diagnosis said of each."""
    record = json.loads((DATA / "cycles-faults.json").read_text(encoding="utf-8"))
    # Faulty and right images are counted apart: naming a fault and calling a right image right are
    # two abilities.
    faults = [row for row in record["rows"] if row["injected"] != "right"]
    right = [row for row in record["rows"] if row["injected"] == "right"]
    said = (
        f"{sum(row['right'] for row in faults)} of {len(faults)} faults are named first; "
        f"{sum(row['right'] for row in right)} of {len(right)} right images are called right "
        f"({record['measured']}, "
        f"Blender {record['blender']}, 160 x 120 pixels)."
    )
    return _faults(said, record["rows"])


def numpy_faults() -> str:
    """Return the faults that were set in a renderer in NumPy, and what
    the diagnosis said of each.
    """
    record = json.loads((DATA / "numpy-faults.json").read_text(encoding="utf-8"))
    rows = record["rows"]
    said = (
        f"{sum(row['right'] for row in rows)} of {len(rows)} images are called what they are "
        f"({record['measured']}, "
        f"64 x 48 pixels, {100 * record['noise']:g} % of noise, the kind of pixel not told)."
    )
    return _faults(said, rows)


def diagnosis_limits() -> str:
    """Return how often the diagnosis names a fault of a right image, and finds that of a
    faulty one, by its limits.
    """
    record = json.loads((DATA / "diagnosis-calibration.json").read_text(encoding="utf-8"))
    width, height = record["size"]
    said = (
        f"The limits are an evidence of {record['evidence']:g} and {100 * record['left']:g} % of "
        "the error "
        f"({record['measured']}, {width} x {height} pixels, `{record['command']}`)."
    )
    head = (
        "right, first scenes",
        "faults, first scenes",
        "right, other scenes",
        "faults, other scenes",
    )
    parts = [
        table(
            [first, *head],
            [[key, *_counted(record[part], key)] for key in record[part]["measured"]],
        )
        for first, part in (("error of the engine", "by_error"), ("least evidence", "by_limit"))
    ]
    return "\n\n".join(
        [said, "Right images that were given a name, and faults that were named first:", *parts]
    )


def _counted(counts: dict[str, Any], key: str) -> list[str]:
    cells = []
    # The scenes by which the limits were chosen, then others.
    for name in ("calibrated", "measured"):
        count = counts[name][key]
        cells += [f"{count['false']} of {count['right']}", f"{count['found']} of {count['faulty']}"]
    return cells


def _faults(said: str, rows: list[dict[str, Any]]) -> str:
    head = ("injected fault", "expected name", "named first", "words", "error", "left")
    # A record of several scenes has a column for them.
    several = "scene" in rows[0]
    cells = [[*([row["scene"]] if several else []), *_diagnosed(row)] for row in rows]
    return f"{said}\n\n" + table([*(["scene"] if several else []), *head], cells, 4 + several)


def _diagnosed(row: dict[str, Any]) -> list[str]:
    """Return the cells of an injected fault and of what the diagnosis said."""
    # A wrong answer is bold.
    first = f"`{row['first']}`" if row["right"] else f"**`{row['first']}`**"
    says = row["says"] + (f" (with {' and '.join(row['together'])})" if row["together"] else "")
    errors = (f"{100 * row[key]:.2g} %" for key in ("residual", "left"))
    return [row["words"], f"`{row['injected']}`", first, says, *errors]
