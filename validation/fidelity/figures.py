# SPDX-License-Identifier: BSD-3-Clause
"""Functions that take the figure of a row from what an experiment gave."""

from collections.abc import Callable, Mapping
from typing import Any

from validation.fidelity.row import Evidence, Figure, NotMeasured, Spread

Take = Callable[[Evidence], Figure]
Data = Mapping[str, Any]


def at(*keys: str | int, scale: float = 1.0) -> Take:
    """Return what takes the number at a place, times `scale`."""

    def take(evidence: Evidence) -> Figure:
        value: Any = evidence
        for key in keys:
            value = value[key]
        return scale * float(value)

    return take


def ratio(above: Take, below: Take) -> Take:
    """Return what divides two figures, their spreads too; what was not measured stays so."""

    def take(evidence: Evidence) -> Figure:
        first, second = above(evidence), below(evidence)
        for figure in (first, second):
            if isinstance(figure, NotMeasured):
                return figure
        if isinstance(first, (int, float)) and isinstance(second, (int, float)):
            return first / second
        a, b = _spread(first), _spread(second)
        return Spread(a.value / b.value, a.low / b.high, a.high / b.low)

    return take


def largest(*takes: Take) -> Take:
    """Return what takes the largest of several figures; what was not measured stays so."""
    return _chosen(max, takes)


def smallest(*takes: Take) -> Take:
    """Return what takes the smallest of several figures; what was not measured stays so."""
    return _chosen(min, takes)


def _chosen(choose: Callable[..., Figure], takes: tuple[Take, ...]) -> Take:
    def take(evidence: Evidence) -> Figure:
        figures = [take(evidence) for take in takes]
        missing = [figure for figure in figures if isinstance(figure, NotMeasured)]
        return missing[0] if missing else choose(figures, key=lambda figure: _spread(figure).value)

    return take


def impossible(reason: str) -> Take:
    """Return what says why there can be no figure."""
    return lambda evidence: NotMeasured(reason)


def rate(timing: Data | None, missing: str | None = None) -> Figure:
    """Return frames a second with their spread from the quartiles of a timing [ms]."""
    if timing is None:
        return NotMeasured(f"not measured: {missing or 'there is no timing'}")
    return Spread(1000 / timing["median_ms"], 1000 / timing["high_ms"], 1000 / timing["low_ms"])


def milliseconds(timing: Data | None, missing: str | None = None) -> Figure:
    """Return the median of a timing with its quartiles [ms]."""
    if timing is None:
        return NotMeasured(f"not measured: {missing or 'there is no timing'}")
    return Spread(timing["median_ms"], timing["low_ms"], timing["high_ms"])


def _spread(figure: Figure) -> Spread:
    assert not isinstance(figure, NotMeasured)
    return figure if isinstance(figure, Spread) else Spread(figure, figure, figure)
