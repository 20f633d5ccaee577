# SPDX-License-Identifier: BSD-3-Clause
"""Two reports on engines compared: which numbers moved, and which verdicts turned."""

from collections.abc import Iterator

from airlight.errors import InputError
from airlight.reports.diff.compare import Change, Difference, difference_of
from airlight.reports.diff.times import Finding
from airlight.reports.engines.record import MISSING, Cell, Engines, LayerErrors

#: Errors that are equal but for rounding: images in half floats move blocks by 2e-5 of their mean,
#: and kernels of another machine the reference by less.
_RELATIVE, _ABSOLUTE = 0.01, 5e-5


def compare_engines(old: Engines, new: Engines) -> Difference:
    """Return what moved between two reports; those without a common number are refused."""
    before, after = (
        {(cell.scene, cell.engine): cell for cell in report.cells} for report in (old, new)
    )
    findings, compared = [], 0
    for scene, engine in before:
        if (scene, engine) not in after:
            # A report may be on some of the engines and scenes.
            findings.append(Finding("note", scene, engine, "not in the new report"))
            continue
        found, count = _cell(before[scene, engine], after[scene, engine])
        findings += found
        compared += count
    for scene, engine in after:
        if (scene, engine) not in before:
            findings.append(Finding("note", scene, engine, "new"))
    if not compared:
        raise InputError(
            "reports: no number can be compared: no engine was judged in one scene of both; give "
            "two reports on the same engines and scenes"
        )
    return difference_of(findings, compared)


def _cell(old: Cell, new: Cell) -> tuple[list[Finding], int]:
    """Compare an engine in a scene."""
    scene, engine = old.scene, old.engine
    findings = []
    if old.status != new.status:
        said = f"{new.status}, and was {old.status}" + (f": {new.reason}" if new.reason else "")
        # An engine that is not on a machine says nothing of its images.
        absent = MISSING in (old.status, new.status)
        verdict = "note" if absent else "better" if new.layers else "worse"
        return [Finding(verdict, scene, engine, said)], 0
    if old.title != new.title:
        findings.append(Finding("note", scene, engine, f"{new.title} in place of {old.title}"))
    if old.headline and new.headline and old.headline != new.headline:
        findings.append(Finding("note", scene, engine, f"the diagnosis says: {new.headline}"))
    compared = 0
    for layer in old.layers:
        other = new.layer(layer.layer)
        if other is None:
            findings.append(Finding("worse", scene, engine, f"{layer.layer} gone"))
            continue
        # A number that is not known cannot be compared.
        compared += sum(None not in (was, other.blocks[name]) for name, was in layer.blocks.items())
        findings += [
            Finding(verdict, scene, engine, what, was, now)
            for verdict, what, was, now in _layer(layer, other)
        ]
    for layer in new.layers:
        if old.layer(layer.layer) is None:
            said = "right by its equation" if layer.right else "not right by its equation"
            findings.append(Finding("note", scene, engine, f"{layer.layer} new, {said}"))
    return findings, compared


def _layer(old: LayerErrors, new: LayerErrors) -> Iterator[Change]:
    """Yield verdict, number, and both values of all that moved in a layer."""
    if old.right != new.right:
        said = f"{old.layer} {'right' if new.right else 'no longer right'} by its equation"
        yield "better" if new.right else "worse", said, None, None
    for name, was in old.blocks.items():
        now = new.blocks[name]
        if was is None or now is None:
            moved, worse = was is not now, now is None
        else:
            moved, worse = abs(now - was) > _ABSOLUTE + _RELATIVE * was, now > was
        if moved:
            # Another equation is neither worse nor better, but for one of which nothing is known.
            is_note = name == "equation" and now is not None
            verdict = "note" if is_note else "worse" if worse else "better"
            yield verdict, f"{old.layer} {name}", was, now
