# SPDX-License-Identifier: BSD-3-Clause
"""Make the certified CSV files again: `python -m tests.evidence.certified.write NAME ...`,
all of them without a name.

The inputs of a row stay as they are; its certified cells are computed from them, and the file is
written whole. Lines that change are printed. All files take some hours: most of the time goes to
droplets with sizes, for which a processor may round the sums of Mie's series differently, in the
16th digit.
"""

import csv
import sys
from collections.abc import Callable, Mapping
from pathlib import Path

from mpmath import mp

from airlight.analytic.phase import phase_from_words
from tests.evidence.certified import airlight_integral, height_fog, model_rays
from tests.evidence.certified.integral import SLOPES, certified_slopes, integrate_certified

FOLDER = airlight_integral.FOLDER
Row = Mapping[str, str]
_RAY = ("t", "h", "x0", "x1", "sigma_t")


def _droplets(row: Row) -> dict[str, str]:
    """Two quadratures that agree to 18 digits."""
    ray = (float(row[name]) for name in _RAY)
    return {
        "value": str(
            mp.nstr(integrate_certified(*ray, phase_from_words(row["phase"]), digits=18), 18)
        )
    }


def _slopes(row: Row) -> dict[str, str]:
    """The integral and its central differences, to 17 digits."""
    ray, phase = (
        [float(row[name]) for name in _RAY],
        phase_from_words(row["phase"], g=float(row["g"])),
    )
    numbers = [integrate_certified(*ray, phase, digits=17), *certified_slopes(*ray, phase)]
    names = ["value", *(f"d{name}" for name in SLOPES)]
    return {name: str(mp.nstr(number, 17)) for name, number in zip(names, numbers, strict=True)}


#: The function that computes the certified cells of a row, by file.
MAKERS: dict[str, Callable[[Row], dict[str, str]]] = {
    **{
        name: lambda row: {"value": airlight_integral.value(row)}
        for name in airlight_integral.FILES
    },
    "airlight_integral_droplets.csv": _droplets,
    "airlight_slopes.csv": _slopes,
    "height_fog_rays.csv": lambda row: {"value": height_fog.value(row)},
    "model_rays.csv": lambda row: {"value": model_rays.value(row)},
}


def write(path: Path, make: Callable[[Row], dict[str, str]]) -> list[int]:
    """Write a file again; return the lines that changed, counted from 1 for the header."""
    header, rows = airlight_integral.read(path)
    made = [row | make(row) for row in rows]
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, header, lineterminator="\n")
        writer.writeheader()
        writer.writerows(made)
    return [
        line for line, (old, new) in enumerate(zip(rows, made, strict=True), start=2) if old != new
    ]


if __name__ == "__main__":
    for name in sys.argv[1:] or MAKERS:
        print(name, *write(FOLDER / name, MAKERS[name]))
