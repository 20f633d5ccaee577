# SPDX-License-Identifier: BSD-3-Clause
"""The tables of the page, from the data of a report."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, replace
from typing import Any

from reports.data.records import MethodRow, Scene
from reports.page.filters import MARKS, words
from reports.tables.agreement import agreement_table, left_out_table, trust_table, verdict
from reports.tables.drawing import html
from reports.tables.kernels import stability_summary
from reports.tables.methods import fastest_table, method_row, methods_table, published_as
from reports.tables.papers import paper_tables
from reports.tables.scaling import scaling_tables
from reports.tables.table import Column, Row, Table, table

_METHODS = (
    *("label", "frame", "frame_rate", "airlight", "surface", "light_moved", "objects_moved"),
    *("relative_rmse", "relative_bias", "p50", "p99", "flip", "nonfinite"),
)


def methods(scene: Scene) -> Table:
    """Return what the methods of a scene cost and how wrong they are."""
    shadows = scene.plan["shadows"].startswith("vis")

    def row(entry: MethodRow) -> Row:
        made, peer = method_row(entry, shadows=shadows), published_as(entry)
        return replace(made, remarks=(*made.remarks, f"published peer, {peer}")) if peer else made

    explanation = (
        f"Times at {words(scene.timed)} pixels, medians, below those of a frame their quartiles; errors at "
        f"{words(scene.size)} pixels, of the airlight against the reference, or of all light where an image has no "
        "layers (total). A method that knows no shadows is marked; its error is then the light that shadows take away. "
        "Published peers, at the end, are papers as printed: their errors are theirs."
    )
    rows = map(row, sorted(scene.methods, key=lambda entry: bool(published_as(entry))))
    return methods_table(f"Times and errors of the methods in {scene.name}", rows, *_METHODS, explanation=explanation)


def facts(title: str, entries: Any) -> Table:
    """Return what is known by name, of a mapping or a record."""
    known = entries if isinstance(entries, Mapping) else asdict(entries)
    columns = (Column("name", "", words=True), Column("value", "", words=True, long=True))
    return table(
        title, columns, [(key.replace("_", " "), words(value)) for key, value in known.items() if value is not None]
    )


def trust_words(scenes: Sequence[Scene]) -> dict[str, str]:
    """Return in few words, after a mark, whether the reference is confirmed."""
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
        return Markup("\n".join(html(each) for each in ([made] if isinstance(made, Table) else made)))

    return draw


#: What the templates call, by name.
TABLES: dict[str, Callable[..., Any]] = {
    "fastest_table": drawn(fastest_table),
    "methods_table": drawn(methods),
    "agreement_table": drawn(agreement_table),
    "trust_table": drawn(trust_table),
    "stability_table": drawn(stability_summary),
    "scaling_tables": drawn(scaling_tables),
    "left_out_table": drawn(left_out_table),
    "facts_table": drawn(facts),
    "paper_tables": drawn(paper_tables),
}
