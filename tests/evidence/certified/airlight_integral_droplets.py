# SPDX-License-Identifier: BSD-3-Clause
"""Make `airlight_integral_droplets.csv`: airlight integrals in fog of droplets, to 18 digits.

    python -m tests.evidence.certified.airlight_integral_droplets --write

Each value is one on which two quadratures in mpmath agree (`integral.py`). The moments of Mie's phase functions
count as exact as float64 has them, whose last digits depend on the processor (1e-14 of a value); a spline through their
series, which `analytic.panels` takes, is 1e-8 off.
"""

import csv
import sys

import numpy as np
from mpmath import mp

from analytic.phase import phase_from_words
from tests.evidence.certified.integral import integrate_certified
from validation.certified.files import FOLDER

FILE = FOLDER / "airlight_integral_droplets.csv"
PHASES = ("hg-draine:5", "hg-draine:12", "hg-draine:50", "mie:2:8", "mie:2:8:0.65")
ROWS = {"hg-draine": 16, "mie": 6}  # of each; a value of `mie` takes some seconds


def cases() -> list[dict[str, str]]:
    """Return rays of many magnitudes without their values, in numbers of float32."""
    random = np.random.default_rng(20081)
    rows = []
    for words in PHASES:
        for _ in range(ROWS[words.partition(":")[0]]):
            distance = 10 ** random.uniform(-1, 1.5)
            angle = random.uniform(0.02, 0.98) * np.pi
            x1 = distance * 10 ** random.uniform(-1, 1)
            sigma_t = 10 ** random.uniform(-2, 0.5) / distance
            numbers = (distance * np.cos(angle), distance * np.sin(angle), 0.0, x1, sigma_t)
            columns = dict(zip(("t", "h", "x0", "x1", "sigma_t"), (repr(float(np.float32(v))) for v in numbers)))
            rows.append({"tag": "droplets", "phase": words, "g": "0", **columns})
    return rows


def value(row: dict[str, str]) -> str:
    """Return J of a row in 18 digits."""
    numbers = (float(row[name]) for name in ("t", "h", "x0", "x1", "sigma_t"))
    return mp.nstr(integrate_certified(*numbers, phase_from_words(row["phase"]), digits=18), 18)


def main() -> None:
    """Write the file."""
    rows = [row | {"value": value(row)} for row in cases()]
    with FILE.open("w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


if __name__ == "__main__" and "--write" in sys.argv[1:]:
    main()
