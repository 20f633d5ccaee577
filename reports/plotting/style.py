# SPDX-License-Identifier: BSD-3-Clause
"""How every chart looks: one colour and marker for each method and for each kernel, and the
style sheets for papers.

The colours are six of Okabe and Ito 2008, *Color Universal Design*, and two darker ones. Under
normal sight and for anyone who lacks one kind of cones (Machado, Oliveira, Fernandes 2009, severity
1) any two differ by more than `LEAST_DIFFERENCE` in CIEDE2000; no chart leaves a distinction to the
colour alone, each has its marker too. Variants of one method (its kernel, its parameters) keep
colour and marker and differ by the filling of the marker.

Nothing heavy is imported at the top, and nothing is set: `figure_style` changes
matplotlib's settings for a block.
"""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from itertools import cycle
from pathlib import Path
from typing import Any

from airlight.errors import InputError

#: Least difference of any two `COLOURS` in CIEDE2000, under normal sight and
#: without one kind of cones.
LEAST_DIFFERENCE = 10.0

COLOURS: Mapping[str, str] = {
    "blue": "#0072b2",
    "vermillion": "#d55e00",
    "green": "#009e73",
    "purple": "#cc79a7",
    "sky": "#56b4e9",
    "orange": "#e69f00",
    "wine": "#882255",
    "navy": "#1b3a8a",
}

#: Width of a figure [inches] by column.
WIDTHS: Mapping[str, float] = {"single": 3.5, "double": 7.16}

# By method, as a report may be drawn where Mitsuba, and with it the
# registry of methods, is missing.
_METHODS = {
    "unshadowed": ("sky", "o"),
    "ray-march": ("vermillion", "s"),
    "equi-angular": ("vermillion", "8"),
    "shadow-planes": ("blue", "^"),
    "light-volumes": ("green", "D"),
    "shadow-planes-2006": ("blue", "<"),
    "light-volumes-2010": ("green", "d"),
    "min-max": ("purple", "v"),
    "froxel-fog": ("orange", "h"),
    "soft-shafts": ("navy", "p"),
    # No chart has methods for fog and for clouds.
    "cloud-octaves": ("orange", "P"),
    "cloud-collectors": ("blue", "^"),
    "cloud-collectors-2008": ("sky", "<"),
}
_HISTORY = "+history"  # ends the name of a method whose frames are averaged
#: Colours and markers of all others: methods of users, and images of engines.
_OTHERS = (("wine", "X"), ("navy", "*"), ("wine", "P"), ("navy", "d"), ("wine", "<"), ("navy", ">"))
# Kernels that are variants of one idea share the colour.
_KERNELS = {
    "exact": ("blue", "o"),
    "quadrature": ("green", "s"),
    "quadrature-theta": ("green", "^"),
    "taylor": ("vermillion", "v"),
    "taylor-printed": ("vermillion", "x"),
    "equiangular": ("orange", "<"),
    "uniform": ("orange", ">"),
    "table": ("sky", "P"),
    "closed-form": ("wine", "*"),
}
_OTHER_KERNEL = ("navy", "h")
_FILLS = ("full", "none", "left", "right", "top", "bottom")

_SHEETS = Path(__file__).parent / "styles"


def kernel_styles(kernels: Iterable[str]) -> dict[str, dict[str, Any]]:
    """Return the style of the markers and lines of each kernel; 'name-N' looks like 'name'."""
    pairs = {}
    for kernel in kernels:
        # A kernel may be given with its number of panels or terms.
        base, _, digits = kernel.rpartition("-")
        name = base if digits.isdecimal() and base in _KERNELS else kernel
        pairs[kernel] = _KERNELS.get(name, _OTHER_KERNEL)
    return _numbered(pairs)


def reference_style() -> dict[str, Any]:
    """Return matplotlib's properties of the line of what is known: black, without markers."""
    return {"color": "black", "linestyle": "-", "linewidth": 1.3}


def report_styles(shown: Iterable[tuple[str, str]]) -> dict[str, dict[str, Any]]:
    """Return the marker style of every label of a report, the same in its page and in
    all figures made from it.

    `shown` are pairs of a method and a label. Variants of a method, with history too, are numbered
    in the order in which they come. Methods that are not built in take the pairs of `_OTHERS` in
    turn; from the seventh on these come again, with other fillings.
    """
    labels: dict[str, dict[str, None]] = {}
    for method, label in shown:
        labels.setdefault(method.removesuffix(_HISTORY), {})[label] = None
    # All variants of a method share its pair of colour and marker.
    others, pairs = cycle(_OTHERS), dict[str, tuple[str, str]]()
    for method, several in labels.items():
        pair = _METHODS.get(method) or next(others)
        pairs |= dict.fromkeys(several, pair)
    return _numbered(pairs)


@contextmanager
def figure_style(column: str = "double") -> Iterator[float]:
    """Use the style sheets for papers for a block; give the width of the column,
    'single' or 'double' [inches].
    """
    import matplotlib.style

    if column not in WIDTHS:
        raise InputError(f"column: got {column!r}, expected one of {', '.join(WIDTHS)}")
    sheets = [str(_SHEETS / "airlight.mplstyle"), str(_SHEETS / f"{column}.mplstyle")]
    with matplotlib.style.context(sheets, after_reset=True):
        yield WIDTHS[column]


@contextmanager
def page_style() -> Iterator[None]:
    """Use the style sheet of charts on a page for a block."""
    import matplotlib.style

    with matplotlib.style.context(_SHEETS / "page.mplstyle"):
        yield


def _numbered(pairs: Mapping[str, tuple[str, str]]) -> dict[str, dict[str, Any]]:
    """Return the styles of labels by their colours and markers; labels that share a
    pair differ by the filling.
    """
    variants, styles = Counter[tuple[str, str]](), {}
    for label, pair in pairs.items():
        styles[label] = _marker_style(*pair, variants[pair])
        variants[pair] += 1
    return styles


def _marker_style(colour: str, marker: str, variant: int) -> dict[str, Any]:
    # After six variants the fillings come again, with a black edge.
    second_round = (variant // len(_FILLS)) % 2
    return {
        "color": COLOURS[colour],
        "marker": marker,
        "fillstyle": _FILLS[variant % len(_FILLS)],
        "markerfacecoloralt": "white",
        "markeredgecolor": "black" if second_round else COLOURS[colour],
    }
