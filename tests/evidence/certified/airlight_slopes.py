# SPDX-License-Identifier: BSD-3-Clause
"""Write airlight_slopes.csv: derivatives of the airlight integral to 15 digits (`integral.certified_slopes`).

Run it in the root of a checkout: python -m tests.evidence.certified.airlight_slopes. It takes some minutes.
"""

import csv

import numpy as np
from mpmath import mp

from analytic.phase import PhaseFunction
from tests.evidence.certified.integral import SLOPES, certified_slopes, integrate_certified
from validation.certified.files import FOLDER

COUNT = 40


def main() -> None:
    generator = np.random.default_rng(23)
    rows = []
    while len(rows) < COUNT:
        # Numbers of float32, so that both precisions start from the same.
        foot = float(np.float32(generator.uniform(-2, 6)))
        height = float(np.float32(10 ** generator.uniform(-2, 0.7)))
        x0 = 0.0 if len(rows) % 3 else float(np.float32(generator.uniform(0, 2)))
        x1 = float(np.float32(x0 + 10 ** generator.uniform(-0.5, 1)))
        sigma_t = float(np.float32(10 ** generator.uniform(-2, 0.5)))
        g = 0.0 if len(rows) % 4 == 0 else float(np.float32(generator.uniform(-0.85, 0.85)))
        phase = PhaseFunction("hg", g=g) if g else PhaseFunction("isotropic")
        case = (foot, height, x0, x1, sigma_t)
        value = integrate_certified(*case, phase, digits=17)
        slopes = certified_slopes(*case, phase)
        numbers = [mp.nstr(number, 17) for number in (value, *slopes)]
        rows.append([phase.name, repr(g), *(repr(number) for number in case), *numbers])
    path = FOLDER / "airlight_slopes.csv"
    with path.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["phase", "g", "t", "h", "x0", "x1", "sigma_t", "value", *(f"d{name}" for name in SLOPES)])
        writer.writerows(rows)


if __name__ == "__main__":
    main()
