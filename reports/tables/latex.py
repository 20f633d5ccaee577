# SPDX-License-Identifier: BSD-3-Clause
"""LaTeX tables in plain LaTeX with booktabs: numbers with units and uncertainties, text escaped."""

import math
from collections.abc import Sequence

_SPECIAL = str.maketrans(
    {
        "\\": r"\textbackslash{}",
        "{": r"\{",
        "}": r"\}",
        "$": r"\$",
        "&": r"\&",
        "%": r"\%",
        "#": r"\#",
        "_": r"\_",
        "~": r"\textasciitilde{}",
        "^": r"\textasciicircum{}",
        "<": r"\textless{}",
        ">": r"\textgreater{}",
        "\u00d7": r"$\times$",
        "\u00b1": r"$\pm$",
        "\u2013": "--",
    }
)
_NONE = "--"


def escape(text: str) -> str:
    """Return text as LaTeX sets it, with the characters that mean something there escaped."""
    return text.translate(_SPECIAL)


def number(value: float | None, digits: int = 3) -> str:
    r"""Return a number as mathematics, with some significant digits: $1.2\times10^{-6}$ where it is small or large."""
    if value is None or math.isnan(value):
        return _NONE
    if math.isinf(value):
        return r"$\infty$" if value > 0 else r"$-\infty$"
    rounded = float(f"{value:.{digits - 1}e}")  # first: 999.9 is 1000, another power of ten
    if rounded == 0:
        return "$0$"
    power = math.floor(math.log10(abs(rounded)))
    if -3 <= power < max(digits, 4):
        return f"${rounded:.{max(0, digits - 1 - power)}f}$"
    return rf"${rounded / 10.0**power:.{digits - 1}f}\times10^{{{power}}}$"


def with_quartiles(median: float | None, low: float | None, high: float | None) -> str:
    """Return a median with the distances to its quartiles as indices, to the same digit: $12.3_{-0.4}^{+0.5}$."""
    if median is None or low is None or high is None:
        return _NONE
    widest = max(high - median, median - low, abs(median) * 1e-3)
    places = max(0, 1 - math.floor(math.log10(widest))) if widest > 0 else 1
    return f"${median:.{places}f}_{{-{median - low:.{places}f}}}^{{+{high - median:.{places}f}}}$"


def table(
    columns: str, headers: Sequence[Sequence[str]], body: Sequence[Sequence[str] | str], *, comment: Sequence[str] = ()
) -> str:
    r"""Return a `tabular` with booktabs' rules; the preamble needs ``\usepackage{booktabs}``.

    Parameters
    ----------
    columns
        As LaTeX wants them, 'lrr'.
    headers
        Rows of LaTeX above the rule.
    body
        Rows of LaTeX, or a text that becomes a heading over the whole width.
    comment
        Lines of comment at the top.
    """
    lines = [f"% {line}" for line in comment]
    lines += [r"\begin{tabular}{" + columns + "}", r"\toprule"]
    lines += [" & ".join(row) + r" \\" for row in headers]
    lines.append(r"\midrule")
    for number, row in enumerate(body):
        if isinstance(row, str):
            lines += [r"\addlinespace"] if number else []
            lines.append(rf"\multicolumn{{{len(columns)}}}{{l}}{{{row}}} \\")
        else:
            lines.append(" & ".join(row) + r" \\")
    lines += [r"\bottomrule", r"\end{tabular}"]
    return "\n".join(lines) + "\n"
