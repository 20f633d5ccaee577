# SPDX-License-Identifier: BSD-3-Clause
"""Functions that are faster than Dr.Jit's where their arguments allow it, look-ups in
tables, and nodes as constants.

**The diamond angle: an azimuth without trigonometry.** The square |x| + |y| = 1 takes the place of
the circle: on each of its sides the angle is linear in y/(|x| + |y|). A full turn goes from 0 to 4,
from the x axis over the y axis; it is monotone in the angle, and exact to rounding.

**Exponentials and a hyperbolic sine for bounded arguments.** Dr.Jit's exp guards overflow,
underflow and NaN, which costs more than the function itself on a processor: 24 of them take 3.0 ms
for 480 000 lanes on two AVX-512 cores, 24 of these 1.9 ms. The quadrature kernel spends most of its
time here.

**Gauss-Legendre nodes as Python numbers: constants in the kernels that Dr.Jit records.**
"""

from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from airlight.realtime.numerics.array_types import four_numbers, is_single

TURN = 4.0  #: a full turn


def diamond_angle(x, y):
    """Return the azimuth of (x, y), Dr.Jit arrays, in [0, 4) in diamond
    angles; 0 for the origin.
    """
    return _diamond_angle(x, y, dr.select)


def host_diamond_angle(x, y):
    """Return the azimuth of (x, y), float32 NumPy arrays, as `diamond_angle` does."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return _diamond_angle(x, y, np.where)


def host_direction(angle):
    """Return the unit vectors (..., 2) at diamond angles, NumPy, of any turn."""
    angle = np.asarray(angle, dtype=np.float64) % TURN
    # The point of the square |x| + |y| = 1 at this angle, then scaled to the circle.
    x = np.where(angle < 2, 1 - angle, angle - 3)
    y = np.where(angle < 1, angle, np.where(angle < 3, 2 - angle, angle - 4))
    return np.stack([x, y], axis=-1) / np.hypot(x, y)[..., None]


def _diamond_angle(x, y, select):
    total = abs(x) + abs(y)
    # Each side of the square is linear in y/(|x| + |y|), which rises on its right half and falls on
    # its left.
    fraction = y / total
    upper = select(x >= 0, fraction, 2 - fraction)
    lower = select(x < 0, 2 - fraction, 4 + fraction)
    angle = select(y >= 0, upper, lower)
    # 4 + fraction rounds to 4 just below the axis: that is azimuth 0. The origin has no direction
    # and gets 0, too.
    return select((total > 0) & (angle < TURN), angle, 0)


#: Coefficients of 2^f on [-1/2, 1/2], highest power first: a Remez fit of degree 6 with
#: relative error below 1.5e-8.
EXP2 = (
    1.5353362e-4,
    1.3398874e-3,
    9.6184373e-3,
    5.5503325e-2,
    2.4022648e-1,
    6.9314720e-1,
    1.0,
)
#: Coefficients of sinh(y)/y in y^2 for |y| up to `WIDEST`, highest power first:
#: relative error below 2e-8.
SINH = (2.9275649e-6, 1.9801041e-4, 8.3337125e-3, 1.6666654e-1, 1.0)
WIDEST = 1.65  #: largest argument of `sinh_bounded`
LOG2_E = 1.4426950408889634  #: log2(e)


def exp_bounded(x):
    """Return exp(x) for float32 lanes on a processor, `drjit.exp` elsewhere.

    Valid for x <= 88; below -87 the result stays at 1.2e-38 instead of falling to zero. Relative
    error below 2e-7. NaN stays NaN. A number that is made of bits has no derivative: where one is
    asked for, `drjit.exp` is taken.
    """
    Float = type(x)
    if not is_single(Float) or dr.backend_v(Float) != dr.JitBackend.LLVM or dr.grad_enabled(x):
        return dr.exp(x)
    return _scaled_power(*_power_of_two(x))


def exp_expm1_bounded(x):
    """Return exp(x), and exp(x) - 1 without the cancellation beside 0; valid for x <= 88.

    Relative errors in float32 are below 2e-7 and 5e-7.

    The polynomial of 2^f has the term 1 apart, so that float32 lanes on a processor pay no more
    than for exp(x). Elsewhere the rounding of exp(x) is taken back by its logarithm (Kahan).
    """
    Float = type(x)
    if not is_single(Float) or dr.backend_v(Float) != dr.JitBackend.LLVM or dr.grad_enabled(x):
        power = dr.exp(x)
        # Near 0 the rounding of exp(x) spoils power - 1, which belongs to log(power) and not to x:
        # the factor x / log(power) corrects that (Kahan).
        less = dr.select(
            dr.abs(x) > 1, power - 1, dr.select(power == 1, x, (power - 1) * (x / dr.log(power)))
        )
        return power, less
    # 2^f = 1 + rest, by Horner's scheme without the last coefficient, which is 1.
    f, n = _power_of_two(x)
    value = Float(EXP2[0])
    for coefficient in EXP2[1:-1]:
        value = dr.fma(value, f, coefficient)
    # 2^n by the bits of its exponent. exp(x) - 1 is 2^n rest + (2^n - 1): for n = 0 it is the rest
    # alone, and nothing cancels.
    Int = dr.int32_array_t(Float)
    scale, rest = dr.reinterpret_array(Float, (Int(n) + 127) << 23), value * f
    return dr.fma(scale, rest, scale), dr.fma(scale, rest, scale - 1)


def opacity(depth):
    """Return 1 - exp(-depth) without the cancellation beside 0; valid as `exp_expm1_bounded`."""
    return -exp_expm1_bounded(-depth)[1]


def exp2_bounded(x):
    """Return 2^x for float32 lanes on a processor, `drjit.exp2` elsewhere.

    Valid for |x| <= 125, unchecked: beyond, the result means nothing. Relative error below 2e-7.
    Where a derivative is asked for, it is `drjit.exp2` too.
    """
    Float = type(x)
    if not is_single(Float) or dr.backend_v(Float) != dr.JitBackend.LLVM or dr.grad_enabled(x):
        return dr.exp2(x)
    # |x - n| <= 1/2, where the polynomial of 2^f serves.
    n = dr.round(x)
    return _scaled_power(x - n, n)


def sinh_bounded(y):
    """Return sinh y in float32 without the cancellation of two exponentials.

    Valid for |y| <= 1.65. Relative error below 2e-7.
    """
    square = dr.square(y)
    value = type(y)(SINH[0])
    for coefficient in SINH[1:]:
        value = dr.fma(value, square, coefficient)
    return value * y


def _power_of_two(x):
    """Return f and n of exp(x) = 2^(n + f), n a whole number and |f| <= 1/2, for x >= -87;
    below -87 they are the parts for -87.

    The fused steps keep f exact up to the rounding of log2(e) in two parts.
    """
    # log2(e) in two parts: the float32 nearest to it, and the rest. The first fused step takes n
    # from the product before it is rounded.
    high, low = 1.4426950216293335, 1.9259629911266175e-8
    clamped = dr.maximum(x, -87.0)
    n = dr.round(clamped * high)
    return dr.fma(clamped, low, dr.fma(clamped, high, -n)), n


def _scaled_power(f, n):
    """Return 2^(n + f) for n a whole number and |f| <= 1/2."""
    Float = type(f)
    value = Float(EXP2[0])
    for coefficient in EXP2[1:]:
        value = dr.fma(value, f, coefficient)
    # Times 2^n: n is added to the exponent, which begins at bit 23 of a float32.
    Int = dr.int32_array_t(Float)
    return dr.reinterpret_array(Float, dr.reinterpret_array(Int, value) + (Int(n) << 23))


@lru_cache
def unit_nodes(count: int) -> tuple[tuple[float, float], ...]:
    """Return the nodes and weights of the Gauss-Legendre rule on [0, 1];
    the weights add up to 1.
    """
    # From [-1, 1], where the rule is defined, to [0, 1].
    xi, weight = np.polynomial.legendre.leggauss(count)
    return tuple((float(0.5 + 0.5 * x), float(0.5 * w)) for x, w in zip(xi, weight))


def summed(count: Any, term: Callable[[Any], Any], zero: Any) -> Any:
    """Return the sum of `term(number)` over the numbers below `count`, in one loop: the kernel
    does not grow with them.

    `zero` is the sum of nothing, one for each lane.
    """
    _, total = dr.while_loop(
        state=(mi.UInt32(0), zero),
        cond=lambda number, total: number < count,
        body=lambda number, total: (number + 1, total + term(number)),
        labels=("number", "total"),
    )
    return total


def cell_of(position, count) -> tuple[Any, Any]:
    """Return the entry before a position, and the fraction of the way to the next, of `count`
    entries at whole numbers.

    Positions are clipped to the entries; the last entry begins no cell.
    """
    Float = type(position)
    # The last entry is the end of the cell before it, with the fraction 1.
    inside = dr.clip(position, 0, count - 1)
    entry = dr.minimum(dr.uint32_array_t(Float)(inside), count - 2)
    return entry, inside - Float(entry)


def between_entries(
    table, places: Sequence[tuple[Any, int]], width: int = 1, first: Any = 0
) -> list[Any]:
    """Return the numbers of a table, `width` an entry, linear between entries along
    each of some coordinates.

    `places`: by coordinate the place from 0 to 1, and how many entries there are; entries along the
    last coordinate lie side by side; `first`: index of the first entry.
    """
    Float = type(table)
    # The corners of the cell, each with its entry and its part: every coordinate doubles them.
    corners: list[tuple[Any, Any]] = [(first, Float(1))]
    for fraction, count in places:
        entry, weight = cell_of(fraction * (count - 1), count)
        corners = [
            (index * count + entry + step, part * (weight if step else 1 - weight))
            for index, part in corners
            for step in (0, 1)
        ]
    if width == 4:  # read at once
        return list(
            sum(part * dr.gather(four_numbers(Float), table, index) for index, part in corners)
        )
    return [
        sum(part * dr.gather(Float, table, index * width + number) for index, part in corners)
        for number in range(width)
    ]
