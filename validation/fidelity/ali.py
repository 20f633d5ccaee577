# SPDX-License-Identifier: BSD-3-Clause
"""The rows of Ali 2016, whose method is reconstructed from captions: it prints no equation and no table of errors."""

from validation.fidelity.figures import Take, at, impossible, rate, ratio, smallest
from validation.fidelity.row import AtLeast, AtMost, Bound, Row

_COMMAND = "airlight published --paper ali"
_SCENE = "the scene is ours, `fence`: the source prints none"


def _error(name: str) -> Take:
    return at("rows", name, "error")


def _row(item: str, claim: str, bound: float, figure: Take, rule: AtMost | AtLeast, unit: str = "times") -> Row:
    return Row("ali", item, claim, Bound(bound), "ali figures", figure, rule, unit, _COMMAND)


ROWS: tuple[Row, ...] = (
    _row(
        "Fig. 5.8, R2",
        "R4 beats R2, given as long: error of R4 over that of R2",
        1.0,
        ratio(_error("R4"), _error("R2 at the time of R4")),
        AtMost(f"a better picture has a smaller error; {_SCENE}", "differs"),
    ),
    _row(
        "Fig. 5.8, R3",
        "R4 beats R3, given as long: error of R4 over that of R3",
        1.0,
        ratio(_error("R4"), _error("R3 at the time of R4")),
        AtMost(f"a better picture has a smaller error; {_SCENE}", "differs"),
    ),
    _row(
        "Fig. 5.8, R1",
        "32 samples and the filter look like 150: error of R4 over that of R1",
        1.1,
        ratio(_error("R4"), _error("R1")),
        AtMost(f"alike is read as within a tenth; {_SCENE}", "differs"),
    ),
    _row(
        "Fig. 4.8",
        "3 light points are enough with the filter: error over that of 16 points",
        2.0,
        ratio(_error("3 points, hd 3"), _error("16 points, hd 5")),
        AtMost(f"enough is read as twice the error at most; {_SCENE}", "differs"),
    ),
    _row(
        "Fig. 4.9, points",
        "5 light points are enough with the filter: error over that of 16 points",
        2.0,
        ratio(_error("5 points, hd 5"), _error("16 points, hd 5")),
        AtMost(f"enough is read as twice the error at most; {_SCENE}", "differs"),
    ),
    _row(
        "Fig. 4.9, edges",
        "the bilateral filter keeps edges: gradient at the steepest edges over that of the truth",
        0.8,
        at("rows", "R4", "edges"),
        AtLeast(f"kept is read as four fifths of the gradient; {_SCENE}", "differs"),
    ),
    _row(
        "Fig. 4.19",
        "more taps are better: error with 32 taps over the smallest with fewer",
        1.0,
        ratio(_error("32 taps"), smallest(*(_error(f"{count} taps") for count in (4, 8, 16)))),
        AtMost(f"a better picture has a smaller error; {_SCENE}", "differs"),
    ),
    Row(
        "ali",
        "abstract",
        "74 frames a second, without resolution, scene or processor",
        74.0,
        "ali figures",
        lambda evidence: rate(evidence["rows"]["R4"]["timing"]),
        AtLeast("R4 after the light moved, on the processor at hand; the source names neither", "differs"),
        "frames a second",
        _COMMAND,
    ),
    Row(
        "ali",
        "user study",
        "63 % found the shadows strongly positive",
        63.0,
        "nothing",
        impossible("people were asked: no program can ask them again"),
        None,
        "%",
    ),
)
