# SPDX-License-Identifier: BSD-3-Clause
"""How the page writes numbers, the sentences that it makes of its data, and its tables."""

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, replace
from typing import Any

from airlight.reports.data.records import Report, Scene
from airlight.reports.tables.agreement import agreement_table, left_out_table, trust_table, verdict
from airlight.reports.tables.costs import scaling_tables, stability_summary
from airlight.reports.tables.drawing import DASH, html, sentence_in_html, typeset
from airlight.reports.tables.methods import (
    fastest_table,
    method_row,
    methods_table,
    published_as,
    times_words,
)
from airlight.reports.tables.papers import paper_tables
from airlight.reports.tables.table import Column, Row, Table, table
from airlight.reports.tables.table import number as plain_number
from airlight.validation.study.row import Row as CellRow

#: Kinds of claims as the page names them.
KINDS = {
    "reference": "Reference",
    "left-out": "Left out",
    "image": "Engine",
    "failed": "Failed",
    "published": "Published peer",
    "refused": "Refused",
    "growth": "As the work grows",
    "times": "Times",
    "not-measured": "Not measured",
}
#: By whether a claim is good: a mark, and its words for screen readers.
MARKS = {True: ("✓", "holds"), False: ("✗", "does not hold"), None: ("·", "")}


def number(value: float | None, digits: int = 3) -> str:
    """Return a number with some significant digits, an en dash for none."""
    return typeset(plain_number(value, digits))


def percent(value: float | None, digits: int = 3) -> str:
    """Return a relative value in per cent."""
    return DASH if value is None else f"{number(100 * value, digits)} %"


def words(value: Any) -> str:
    """Return any value of report.json in a line."""
    # The order matters: a truth value is an integer too, and a text is no list.
    if value is None:
        return DASH
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:g}"
    if isinstance(value, Mapping):
        return ", ".join(f"{key} {words(entry)}" for key, entry in value.items())
    if isinstance(value, list | tuple):
        # width and height
        size = len(value) == 2 and all(isinstance(entry, int) for entry in value)
        return (" \N{MULTIPLICATION SIGN} " if size else ", ").join(
            words(entry) for entry in value
        ) or DASH
    return str(value)


def sentence(text: str) -> str:
    """Return a text with a capital at its beginning."""
    return text[:1].upper() + text[1:]


def unbroken(text: str) -> str:
    """Return a text in which no line ends before a unit."""
    return re.sub(r"(?<=\d) (?=%|ms\b|frames/s)", "\N{NO-BREAK SPACE}", text)


def with_code(text: str) -> str:
    """Return a sentence as HTML, in which what stands in backticks is code."""
    from markupsafe import Markup

    return Markup(sentence_in_html(text))


def kept_words(report: Report) -> str:
    """Return how many results of a report are cached from earlier runs; empty where none was."""
    if not report.cached:
        return ""
    whole = report.cached + report.computed
    return f"{report.cached} of {whole} results are cached from earlier runs on this machine with the same code"


def viewer_words(index: Mapping[str, Any]) -> str:
    """Return how many pixels the images of a scene have on the page, and their exposure."""
    # A page that had to be thinned out says so.
    stride, (width, height) = index["stride"], index["full"]
    size = f"{width} \N{MULTIPLICATION SIGN} {height} pixels"
    if stride > 1:
        size += f", of which the page holds one in {stride} along both axes to stay small; the files have all"
    exposure = f"Exposure {number(index['exposure'])}\N{MULTIPLICATION SIGN} at 0 stops."
    return f"{size}. {exposure}"


FILTERS: Mapping[str, Callable[..., str]] = {
    "number": number,
    "percent": percent,
    "words": words,
    "sentence": sentence,
    "unbroken": unbroken,
    "with_code": with_code,
}


_METHODS = (
    *("label", "frame", "frame_rate", "airlight", "surface", "light_moved", "objects_moved"),
    *("relative_rmse", "relative_bias", "p50", "p99", "flip", "nonfinite"),
)


def methods(scene: Scene) -> Table:
    """Return the times and errors of the methods of a scene."""
    # Where nothing casts a shadow, a method without shadows misses nothing and is not marked.
    shadows = scene.plan["shadows"].startswith("vis")

    def row(entry: CellRow) -> Row:
        # A method as its paper prints it has errors on purpose: the remark says so, and the sort
        # below puts these at the end.
        made, peer = method_row(entry, shadows=shadows), published_as(entry)
        return replace(made, remarks=(*made.remarks, f"published peer, {peer}")) if peer else made

    explanation = (
        f"Times at {words(scene.timed)} pixels, medians, below those of a frame their quartiles; "
        "errors at "
        f"{words(scene.size)} pixels, of the airlight against the reference, or of all light where "
        "an image has no "
        "layers (total). A method that knows no shadows is marked; its error is then the light "
        "that shadows take away. "
        "Published peers, at the end, are papers as printed: their errors are theirs. "
    ) + times_words(scene.methods)
    rows = map(row, sorted(scene.methods, key=lambda entry: bool(published_as(entry))))
    return methods_table(
        f"Times and errors of the methods in {scene.name}", rows, *_METHODS, explanation=explanation
    )


def facts(title: str, entries: Any) -> Table:
    """Return the entries of a mapping or a record that are known."""
    known = entries if isinstance(entries, Mapping) else asdict(entries)
    columns = (Column("name", "", words=True), Column("value", "", words=True, long=True))
    return table(
        title,
        columns,
        [
            (key.replace("_", " "), words(value))
            for key, value in known.items()
            if value is not None
        ],
    )


def trust_words(scenes: Sequence[Scene]) -> dict[str, str]:
    """Return in few words, after a mark, whether the reference is confirmed."""
    # One disagreement decides; without one the reference is confirmed only if every comparison
    # agrees, else undecided.
    verdicts = [verdict(entry) for scene in scenes for entry in scene.agreement.values()]
    if not verdicts:
        return {"mark": MARKS[None][0], "words": "Reference not compared"}
    against, agree = verdicts.count(False), verdicts.count(True)
    if against:
        return {
            "mark": MARKS[False][0],
            "words": f"Reference NOT confirmed in {against} of {len(verdicts)} comparisons",
        }
    words = f"Reference confirmed in {agree} of {len(verdicts)} comparisons"
    return {"mark": MARKS[True if agree == len(verdicts) else None][0], "words": words}


def drawn(function: Callable[..., Table | Iterable[Table]]) -> Callable[..., Any]:
    """Return a function that draws what another returns."""

    def draw(*arguments: Any) -> Any:
        from markupsafe import Markup

        made = function(*arguments)
        return Markup(
            "\n".join(html(each) for each in ([made] if isinstance(made, Table) else made))
        )

    return draw


#: Functions that the templates call, by name.
TABLES: dict[str, Callable[..., Any]] = {
    # its heading says it
    "fastest_table": drawn(lambda scenes: replace(fastest_table(scenes), title="")),
    "methods_table": drawn(methods),
    "agreement_table": drawn(agreement_table),
    "trust_table": drawn(trust_table),
    "stability_table": drawn(stability_summary),
    "scaling_tables": drawn(scaling_tables),
    "left_out_table": drawn(left_out_table),
    "facts_table": drawn(facts),
    "paper_tables": drawn(paper_tables),
}
