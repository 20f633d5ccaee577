# SPDX-License-Identifier: BSD-3-Clause
"""The column `value` of `airlight_integral.csv` and `airlight_integral_rays.csv`, with proof.

Every value is enclosed by ball arithmetic (Arb in FLINT, through python-flint; Johansson,
"Numerical integration in arbitrary-precision ball arithmetic", ICMS 2018): each operation returns
an interval that holds the exact result, and `acb.integral` bounds the error of its quadrature by
the integrand's size on ellipses in the complex plane. A value is given only where both ends of its
enclosure round to the same 20 digits. Nothing of this project is imported: phase functions,
geometry and change of variables are written here once more.

The inputs are the other columns, and count as exact. The binary numbers in the files are those of
single precision, written in full, so that kernels in single and in double precision are asked for
the same integral.

The integral
------------
With the distance s = x - foot from the foot of the perpendicular, r = sqrt(h^2 + s^2) and p the
phase function of the cosine c = -s/r of the scattering angle, DESIGN section 2 defines

    J = int_{x0}^{x1} exp(-sigma_t (x + r)) p(c) / r^2 dx.

Substitute s = h sinh w: r = h cosh w, dx = h cosh w dw, x + r = foot + h e^w, c = -tanh w, hence

    J = exp(-sigma_t foot)/h  int_{w0}^{w1} exp(-sigma_t h e^w) p(-tanh w) / cosh w dw,      w = asinh((x - foot)/h).

**Sharp parts.** Over x the integrand peaks at the foot within a width h, down to 1e-8 m of a
segment of 10 m. Over w it has no peak: the singularities of 1/cosh w, of the polynomials in tanh w
and of the Henyey-Greenstein function that are nearest to a real w all lie at a distance of pi/2
from it, wherever it is. (For the last one 1 + g^2 - 2 g c, with c = -tanh w, is ((1 - g)^2 + (1 +
g)^2 e^{2w}) / (1 + e^{2w}), which is zero where e^{2w} is a negative number.) Hence panels of about
unit length do, and `acb.integral` halves the range until they are that short. The exponential is
entire; where it falls off like exp(-e^w) the halving goes on. No mark has to be set by hand.

**Branch.** The power -3/2 of Henyey and Greenstein is the only function with a branch cut, along
the negative numbers; the flag `analytic` makes it non-finite on balls that meet the cut, so that no
panel is trusted across it.

**An infinite x1.** The range is cut at a finite W, and what is cut off is added as a ball. With
p <= p_max and 1/cosh w < 2 e^{-w}

    0 < int_W^inf exp(-sigma_t h e^w) p / cosh w dw < 2 p_max exp(-sigma_t h e^W) e^{-W},

W = max(w0, 0) + 100 log 2 leaves 2^-100 of the whole at most, up to the constant and the forward
peak of p, in a vacuum too.

**Rays by origin, direction and light.** v = light - origin, and the direction d counts as exact;
what is left of a length other than 1 is divided out: foot = (v . d)/|d| and h = |v x d|/|d|, in
ball arithmetic as all the rest.
"""

import csv
from collections.abc import Mapping
from pathlib import Path

from flint import acb, arb, ctx
from mpmath import mp

FOLDER = Path(__file__).resolve().parents[3] / "validation/certified"
FILES = ("airlight_integral.csv", "airlight_integral_rays.csv")
DIGITS = 20
PRECISION = 128  # bits that are carried, of which 20 digits are 67


def enclosure(row: Mapping[str, str], *, precision: int = PRECISION) -> arb:
    """Return a ball that holds J [1/m] of a row of either file, given by the text of its cells."""
    with ctx.workprec(precision):
        foot, height = _foot_and_height(row)
        x0, x1, sigma_t, g = (arb(float(row[name])) for name in ("x0", "x1", "sigma_t", "g"))
        w0 = ((x0 - foot) / height).asinh()
        unbounded = not x1.is_finite()
        # max(w0, 0), as a number: any W is right, and an infinite ball would not be
        w1 = (
            arb(max(float(w0), 0.0)) + 100 * arb.const_log2()
            if unbounded
            else ((x1 - foot) / height).asinh()
        )

        def integrand(w: acb, analytic: bool) -> acb:
            down = 1 / (1 + (-2 * w).exp())  # sin^2 of half the scattering angle, (1 - c)/2
            up = 1 / (1 + (2 * w).exp())  # cos^2, (1 + c)/2
            return (
                (-sigma_t * height * w.exp()).exp()
                * _phase(row["phase"], g, down, up, analytic)
                / w.cosh()
            )

        # The tolerance is relative, as the values span 28 orders of magnitude; the
        # smallest number stands for zero.
        integral = acb.integral(
            integrand, w0, w1, rel_tol=arb(2) ** (24 - precision), abs_tol=arb(2) ** -5000
        ).real
        if unbounded:
            tail = 2 * _largest_phase(row["phase"], g) * (-sigma_t * height * w1.exp() - w1).exp()
            integral += tail.union(arb(0))
        return (-sigma_t * foot).exp() / height * integral


def digits(ball: arb, count: int = DIGITS) -> str:
    """Return the number that a ball encloses in so many digits, rounded to nearest; zeros
    at the end are left out.
    """
    with ctx.workprec(8 * PRECISION):  # ends are rounded outwards to the current precision
        words = {_word(end, count) for end in (ball.lower(), ball.upper())}
    if len(words) != 1:
        raise ArithmeticError(
            f"{ball} leaves open which {count} digits it has: {' or '.join(sorted(words))}"
        )
    return words.pop()


def value(row: Mapping[str, str]) -> str:
    """Return the text of the cell `value` of a row; where its rounding is a
    close call, from more bits.
    """
    for precision in (PRECISION, 2 * PRECISION, 4 * PRECISION):
        try:
            return digits(enclosure(row, precision=precision))
        except ArithmeticError as reason:
            undecided = reason
    raise undecided


def read(path: Path) -> tuple[list[str], list[dict[str, str]]]:
    """Return the header and the rows of one of the files."""
    with path.open(newline="") as file:
        reader = csv.DictReader(file)
        rows = list(reader)
    return list(reader.fieldnames or ()), rows


def _foot_and_height(row: Mapping[str, str]) -> tuple[arb, arb]:
    """Return the foot and the height of the light over a ray [m]."""
    if "t" in row:
        return arb(float(row["t"])), arb(float(row["h"]))
    origin, d, light = ([arb(float(row[point + axis])) for axis in "xyz"] for point in "odl")
    v = [light[axis] - origin[axis] for axis in range(3)]
    length = sum((c * c for c in d), arb(0)).sqrt()
    cross = [v[i] * d[j] - v[j] * d[i] for i, j in ((1, 2), (2, 0), (0, 1))]
    return sum((a * b for a, b in zip(v, d)), arb(0)) / length, sum(
        (c * c for c in cross), arb(0)
    ).sqrt() / length


def _phase(name: str, g: arb, down: acb, up: acb, analytic: bool) -> acb:
    """Return the phase function, of mean 1 over the sphere, from (1 - c)/2 and (1 + c)/2."""
    if name == "isotropic":
        return acb(1)
    if name == "rayleigh":
        return 3 * (1 + (up - down) ** 2) / 4
    if name == "hazy":
        return (1 + 9 * up**8) / 2
    if name == "murky":
        return 33 * (1 + 50 * up**32) / 83
    # 1 + g^2 - 2 g c is (1 - g)^2 + 4 g (1 - c)/2, and (1 + g)^2 - 4 g (1 +
    # c)/2: all terms positive
    if name == "hg":
        base = (1 - g) ** 2 + 4 * g * down if g >= 0 else (1 + g) ** 2 - 4 * g * up
        return (1 - g * g) * base.rsqrt(analytic=analytic) ** 3
    raise ValueError(
        f"the phase function is called {name!r}; expected isotropic, rayleigh, hazy, murky or hg"
    )


def _largest_phase(name: str, g: arb) -> arb:
    """Return a bound of a phase function: its value at the forward or backward peak."""
    bounds = {"isotropic": arb(1), "rayleigh": arb(2), "hazy": arb(5), "murky": arb(21)}
    return bounds[name] if name in bounds else (1 + abs(g)) / (1 - abs(g)) ** 2


def _word(number: arb, count: int) -> str:
    """Return an exact binary number in so many decimal digits."""
    mantissa, exponent = (int(part) for part in number.man_exp())
    with mp.workprec(8 * PRECISION):
        return str(mp.nstr(mp.ldexp(mp.mpf(mantissa), exponent), count))
