# SPDX-License-Identifier: BSD-3-Clause
"""Regressions over many frames whose standard errors hold for pixels that are
correlated in place and time.

The pixels of a block, with all their frames, are left out in turn (a jackknife): no independence is
assumed within a block. A regression needs only the matrix of the products of a block's columns, so
frames are read one by one, and memory holds these matrices alone. Blocks are collected in at most
100 groups, neighbours in different ones.
"""

import numpy as np

from airlight.validation.arrays import Array
from airlight.validation.statistics.estimate import UNKNOWN, Estimate
from airlight.validation.statistics.samples import widened

BLOCK = 8  #: side of a block [pixels]


def products(columns: Array, side: int = BLOCK) -> Array:
    """Return the sums of the products of columns by group of blocks, (groups, columns, columns).

    `columns`: (columns, height, width, channels); `side`: of a block [elements of an image].
    """
    count, height, width, channels = columns.shape
    # The scatter of 100 groups gives a standard error to 7 %. Block number b is in group b modulo
    # their number: neighbours in a row are in different groups. Blocks of zeros fill the last turn.
    rows, across = -(-height // side), -(-width // side)
    groups = min(100, rows * across)
    sums = np.zeros((-(-rows * across // groups) * groups, count, count))
    # A row of blocks at a time; pixels beyond the image are zero, and add nothing.
    padded = np.zeros((count, side, across * side, channels), columns.dtype)
    for row in range(rows):
        strip = columns[:, row * side : (row + 1) * side]
        padded[:, strip.shape[1] :] = 0
        padded[:, : strip.shape[1], :width] = strip
        blocks = (
            padded.reshape(count, side, across, side * channels)
            .transpose(2, 0, 1, 3)
            .reshape(across, count, -1)
        )
        sums[row * across : (row + 1) * across] = blocks @ blocks.transpose(0, 2, 1)
    return sums.reshape(-1, groups, count, count).sum(axis=0)


def regression(sums: Array) -> tuple[Estimate, ...]:
    """Return the coefficients of the last column on the others; unknown where the
    columns do not tell them apart.

    Their errors are not known where one group alone tells them apart.
    """
    total = sums.sum(axis=0)
    unknowns = len(total) - 1
    if not told_apart(total[:-1, :-1]):
        return (UNKNOWN,) * unknowns
    coefficients = np.linalg.solve(total[:-1, :-1], total[:-1, -1])
    without = total - held(sums)
    if not all(told_apart(each) for each in without[:, :-1, :-1]):
        return tuple(Estimate(float(value)) for value in coefficients)
    left_out = np.linalg.solve(without[:, :-1, :-1], without[:, :-1, -1:])[..., 0]
    return estimates(coefficients, left_out)


def relative_root(sums: Array, value: int, *, to: int, values: int = 0) -> Estimate:
    """Return the root mean square of a column, counted by column `values`, over the mean of
    another, which is positive.

    Its error is not known where one group holds all of that mean: without the group
    nothing is relative to it.
    """
    # The first entry is of all pixels, the others are without one group each.
    several = _left_out(sums)
    square = several[:, value, value] / np.maximum(several[:, values, values], 1e-300)
    lower = several[:, 0, to]
    lit = lower > 0
    if not lit[0]:
        return UNKNOWN
    ratios = np.sqrt(square[lit]) * several[lit, 0, 0] / lower[lit]
    return estimates(ratios[:1], ratios[1:, None])[0] if lit.all() else Estimate(float(ratios[0]))


def _left_out(sums: Array) -> Array:
    """Return the products of all pixels, then those without each group."""
    total = sums.sum(axis=0)
    return np.concatenate([total[None], total - held(sums)])


def held(sums: Array) -> Array:
    """Return the groups that hold something, to be left out in turn; none
    where one of them holds all.

    The first column of a pixel that counts is not zero.
    """
    some = sums[sums[:, 0, 0] > 0]
    return some if len(some) > 1 else some[:0]


def estimates(numbers: Array, left_out: Array) -> tuple[Estimate, ...]:
    """Return numbers, (numbers,), with the errors of the jackknife; `left_out`: the numbers without
    each group, (groups, numbers).

    Groups that change nothing, such as dark ones, are no samples. With deviations d of the numbers
    without a group from their mean, pi/2 (sum |d|)^2 / sum d^2 groups count: all of them where d is
    normal, hardly more than one where a single group decides. That less one, and at least one, are
    the degrees of freedom.
    """
    groups = len(left_out)
    if groups < 2:
        return tuple(Estimate(float(value)) for value in numbers)
    apart = np.abs(left_out - left_out.mean(axis=0))
    square = (apart**2).sum(axis=0)
    # A number that no group changes has no deviations, and an error of zero.
    counting = np.pi / 2 * apart.sum(axis=0) ** 2 / np.where(square > 0, square, 1.0)
    errors = widened(
        np.sqrt(square * (groups - 1) / groups), np.clip(counting - 1, 1.0, groups - 1)
    )
    return tuple(
        Estimate(float(value), float(error)) for value, error in zip(numbers, errors, strict=True)
    )


def parts_of_error(products: Array) -> tuple[Estimate, Estimate]:
    """Return squared bias and variance from the mean products of errors of pairs of runs: b^2 and
    V of `validation.motion.noise` from G, (runs, runs).
    """
    count = len(products)

    def parts(total: Array, trace: Array, runs: int) -> Array:
        return np.stack(
            [(total - trace) / (runs * (runs - 1)), (trace - total / runs) / (runs - 1)], axis=-1
        )

    total, trace = products.sum(), np.trace(products)
    split = parts(total, trace, count)
    if count < 3:
        return Estimate(float(split[0])), Estimate(float(split[1]))
    # Without run i the sums lack its row and its column.
    diagonal = np.diag(products)
    left_out = parts(total - 2 * products.sum(axis=1) + diagonal, trace - diagonal, count - 1)
    squared_bias, variance = estimates(split, left_out)
    return squared_bias, variance


def told_apart(matrix: Array) -> bool:
    """Return whether the products of columns tell their coefficients apart."""
    # The determinant of the correlations of the columns is at most 1; below 1e-10 it is rounding.
    scale = np.sqrt(np.diag(matrix))
    return bool((scale > 0).all()) and bool(np.linalg.det(matrix / np.outer(scale, scale)) > 1e-10)
