# SPDX-License-Identifier: BSD-3-Clause
"""The numbers of a report on engines, as rows and as a sentence for each engine."""

from collections.abc import Iterator, Sequence

from airlight.reports.engines.record import CANNOT, JUDGED, STATUS_WORDS, Cell, Engines, LayerErrors
from airlight.reports.tables.table import Column, Row, Table, Value, Verdict, number, numbers, words
from airlight.reports.tables.table import table as table_of_rows

DASH = "-"
_PERCENT = {"percent": True}
_PARTS = {"equation": "equation", "algorithm": "algorithm", "total": "together"}
EXPLANATION = (
    "Root mean squares over blocks of 8 x 8 pixels, without the worst hundredth. Equation: the "
    "engine's own equation against physics. Algorithm: the image against the engine's equation. "
    "Together: the image against physics. They do not add up."
)


def engines_table(data: Engines) -> Table:
    """Return the errors over blocks of each engine in each scene."""
    columns = (
        *words("scene", "engine", "layer"),
        *numbers(how=_PERCENT, **_PARTS),
        *words(right="right by its equation"),
    )

    def row(cell: Cell, layer: LayerErrors | None) -> Row:
        values: dict[str, Value] = {"scene": cell.scene, "engine": data.title_of(cell.engine)}
        if layer is None:
            return Row(values, reason=f"{STATUS_WORDS[cell.status]}: {cell.reason}")
        right = Verdict(layer.right) if cell.told else None
        judged: dict[str, Value] = {"layer": layer.layer, "right": right}
        return Row(values | judged | layer.blocks)

    rows = [row(cell, layer) for cell in data.cells for layer in cell.layers or (None,)]
    return table_of_rows("Errors of engines", columns, rows, explanation=EXPLANATION)


def numbers_table(data: Engines) -> Table:
    """Return every number of the images that were judged: blocks, bias and RMSE of each part."""
    columns = [*words("scene", "engine", "layer")]
    for part, heading in _PARTS.items():
        signed = {**_PERCENT, "sign": True}
        columns += numbers(how=_PERCENT, **{f"{part}_blocks": f"{heading}, blocks"})
        columns += numbers(how=signed, **{f"{part}_bias": f"{heading}, bias"})
        columns += numbers(how=_PERCENT, **{f"{part}_rmse": f"{heading}, RMSE"})
    columns.append(Column("noise", "blocks, of scatter alone", percent=True))

    def row(cell: Cell, layer: LayerErrors) -> Row:
        values: dict[str, Value] = {"scene": cell.scene, "engine": cell.title, "layer": layer.layer}
        for name, part in layer.parts.items():
            if part is not None:
                values |= {f"{name}_blocks": part.blocks, f"{name}_bias": part.mean}
                values |= {f"{name}_rmse": part.rmse}
        return Row(values | {"noise": layer.noise})

    rows = [row(cell, layer) for cell in data.cells for layer in cell.layers]
    explanation = (
        "Relative to the mean of the reference: bias is the mean of the difference, RMSE the root "
        "of its mean square over pixels, blocks as above. A pixel beside a lamp can make most of an "
        "RMSE."
    )
    return table_of_rows("All numbers", columns, rows, explanation=explanation)


def engine_sentences(data: Engines) -> list[str]:
    """Return a sentence on the airlight of each engine that was judged."""
    return [sentence for engine in data.engines for sentence in _sentence(data, engine)]


def _sentence(data: Engines, engine: str) -> Iterator[str]:
    cells = [cell for cell in data.cells if cell.engine == engine]
    judged = [cell for cell in cells if cell.status == JUDGED]
    layers = [layer for cell in judged if (layer := cell.layer("airlight"))]
    if not layers:
        return
    scenes = f"{len(layers)} scene{'' if len(layers) == 1 else 's'}"
    # Two ranges and two counts.
    found = [layer.blocks["equation"] for layer in layers]
    known = {error for error in found if error is not None}
    equation = "its equation is that of physics"
    if not known:  # a sun in fog without bounds has no physical image
        equation = "how far its equation is off physics is not known"
    elif any(known):
        equation = f"its equation is {_range(found)} off physics"
    algorithm = _range([layer.blocks["algorithm"] for layer in layers])
    right = sum(layer.right for layer in layers)
    words = (
        f"{judged[0].title} in {scenes}: {equation}, its images are {algorithm} off its equation"
    )
    words += f", and {right} of {len(layers)} right by it"
    if not any(cell.told for cell in judged):
        total = _range([layer.blocks["total"] for layer in layers])
        words = f"{judged[0].title} in {scenes}: its equation is not known, and its images are "
        words += f"{total} off physics"
    others = sum(cell.status == CANNOT for cell in cells)
    yield f"{words}; {others} more it does not have." if others else f"{words}."


def _range(errors: Sequence[float | None]) -> str:
    """Return the least and the largest error in words."""
    known = sorted(error for error in errors if error is not None)
    if not known:
        return "by no known number"
    ends = [percent_words(each) for each in (known[0], known[-1])]
    return ends[0] if ends[0] == ends[1] else f"{ends[0].removesuffix(' %')} to {ends[1]}"


def percent_words(error: float | None) -> str:
    """Return an error in per cent, with two digits below 100 %."""
    if error is None:
        return DASH
    return f"{100 * error:.0f} %" if error >= 1 else f"{number(100 * error, 2)} %"
