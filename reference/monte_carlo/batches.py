# SPDX-License-Identifier: BSD-3-Clause
"""Batches of a Monte Carlo estimator: their means, the spread between them, and where
their samples go, in float64.

An estimator traces one batch at a time, each with its own seed. The standard error of the mean
follows from the spread of the batch means, so nothing needs to be known of the law of a single
sample.

**Where the samples of a path tracer go:** more to the pixels whose radiance spreads more. A pooled
bias compares sums over all pixels. With n_p samples of standard deviation s_p in pixel p its
variance is

    sum_p s_p^2 / n_p,    for a given sum of n_p least where n_p is proportional to s_p:    (sum_p s_p)^2 / sum_p n_p

(Neyman 1934; Cochran 1977, *Sampling Techniques*, eq. 5.26). In fog a few pixels hold nearly all of
the variance: they look at the surroundings of a light, or past them. Equal numbers would spend most
samples on the other pixels.

The s_p come from a pilot run, which is used for nothing else. Samples that decide how many more a
pixel gets must not count themselves: a pixel that came out dark by chance would get few more, and
the mean would be too small. A quarter of the samples is shared out equally, so that a pixel whose
pilot met nothing at all has at most four times the variance that it would have had.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from airlight.errors import InputError

Array = NDArray[np.float64]

LAYERS = ("airlight", "surface")
EQUAL = 0.25  #: fraction of allocated samples that is the same for every pixel
LARGEST_SEED = 1 << 20  #: seeds are below this: the streams of one batch are numbered in 32 bits


@dataclass(frozen=True)
class Batches:
    """Running sums of the batch means; `merged` adds batches up in any order."""

    seeds: tuple[int, ...]  #: of the batches, each once
    samples: int  #: samples a pixel in each batch
    mean: Array  #: mean of the batch means, (layers, pixels, 3)
    squares: Array  #: sum of squared deviations from the mean, (layers, pixels, 3)
    totals: Array  #: image means of every batch, (batches, layers, 3)
    layers: tuple[str, ...] = LAYERS  #: what they hold; more may follow the usual two

    @property
    def standard_error(self) -> Array:
        """Standard error of `mean`, (layers, pixels, 3)."""
        count = len(self.seeds)
        return np.sqrt(self.squares / (count * (count - 1)))


def check_samples(samples: int) -> None:
    """Check the number of samples a pixel of a batch.

    Raises ValueError for none, or for more than the 256 that a batch can add up.
    """
    largest = 256  # float32 sums of more lose digits (DESIGN section 6.2)
    if not 1 <= samples <= largest:
        raise ValueError(f"samples: got {samples}, expected 1 to {largest}")


def single_batch(
    seed: int, samples: int, mean: Array, *, layers: tuple[str, ...] = LAYERS
) -> Batches:
    """Return one batch, given its radiance of every pixel, (layers, pixels, 3).

    `seed`: of the batch; `samples`: samples a pixel in it; `mean`: its radiance of every pixel,
    (layers, pixels, 3) [W/(m^2 sr)]; `layers`: their names. Raises InputError for radiance that is
    not finite: no mean and no standard error would follow from it.
    """
    wrong = ~np.isfinite(mean).all(axis=(0, 2))
    if wrong.any():
        raise InputError(
            f"the samples of {int(wrong.sum())} of {wrong.size} pixels are not finite, first of "
            f"pixel {int(np.argmax(wrong))}, row by row; a light may lie on its ray, or a number "
            "of the scene be too large for float32: move the light, or use other units"
        )
    return Batches((seed,), samples, mean, np.zeros_like(mean), mean.mean(axis=1)[None], layers)


def merged(first: Batches, second: Batches) -> Batches:
    """Add up two sets of batches of the same pixels.

    Raises ValueError for batches with other samples a pixel, or with a seed that both hold.
    """
    if first.samples != second.samples or set(first.seeds) & set(second.seeds):
        raise ValueError("batches to merge need the same samples a pixel and different seeds")
    mean, squares = combined_moments(
        (len(first.seeds), first.mean, first.squares),
        (len(second.seeds), second.mean, second.squares),
    )
    return Batches(
        first.seeds + second.seeds,
        first.samples,
        mean,
        squares,
        np.concatenate([first.totals, second.totals]),
        first.layers,
    )


def combined_moments(
    first: tuple[int, Array, Array], second: tuple[int, Array, Array]
) -> tuple[Array, Array]:
    """Return mean and sum of squared deviations of two sets of numbers together.

    The sum has the squares within each set and those between the means of both (Chan, Golub and
    LeVeque 1983, eq. 2.1).

    `first`, `second`: of each set the count of numbers, their mean, and the sum of their squared
    deviations from the mean. The arrays have one shape; the mean is in any unit, here [W/(m^2 sr)],
    the squares in its square. Returns `mean`, `squares`: of all numbers, in the same shape and
    units.
    """
    # Squared deviations within both sets, and of both means from the common one, n m/(n + m) times
    # the square of their difference.
    (n, mean, squares), (m, other_mean, other_squares) = first, second
    difference = other_mean - mean
    return mean + difference * (m / (n + m)), squares + other_squares + difference**2 * (
        n * m / (n + m)
    )


def seed_ranges(seeds: Iterable[int]) -> str:
    """Return seeds in words, as '0-63,128-191'."""
    ranges: list[list[int]] = []
    for seed in sorted(seeds):
        if ranges and seed == ranges[-1][1] + 1:
            ranges[-1][1] = seed
        else:
            ranges.append([seed, seed])
    return ",".join(f"{first}-{last}" if last > first else f"{first}" for first, last in ranges)


def parse_seed_ranges(words: str) -> tuple[int, ...]:
    """Return the seeds that `seed_ranges` named, ascending.

    Raises ValueError if the words name no seeds, the same one twice, or one that no batch has.
    """
    seeds: list[int] = []
    for part in words.split(","):
        first, dash, last = part.partition("-")
        start, end = int(first), int(last if dash else first)
        if not 0 <= start <= end < LARGEST_SEED:
            raise ValueError(f"seeds {part!r}")
        seeds += range(start, end + 1)
    if len(set(seeds)) != len(seeds):
        raise ValueError(f"seeds {words!r} name one twice")
    return tuple(sorted(seeds))


def allocated(
    pilot: Batches, samples: int, *, shape: tuple[int, int], masks: dict[str, NDArray[np.bool_]]
) -> NDArray[np.uint32]:
    """Return how many samples each pixel gets.

    `pilot`: batches of the same estimator with other seeds, two at least; `samples`: samples a
    pixel, on the average; `shape`: height and width of the image; `masks`: by layer the pixels that
    are compared, (height, width); the others get the equal share alone. Returns samples of every
    pixel [1], (layers, pixels), at least 1; their mean is `samples` up to rounding.
    """
    counts = []
    for number, layer in enumerate(LAYERS):
        variance = (pilot.standard_error[number] ** 2).sum(axis=1).reshape(shape)
        # s_p of the derivation from the pilot, all channels together. Pixels that are not compared
        # count as if they had none.
        spread = np.where(masks[layer], np.sqrt(_neighbourhood(variance)), 0)
        mean = spread.mean()
        # Equal numbers where the pilot saw no spread at all.
        fraction = spread / mean if mean > 0 else np.ones(shape)
        counts.append(np.maximum(1, np.rint(samples * (EQUAL + (1 - EQUAL) * fraction))))
    return np.stack(counts).reshape(len(LAYERS), -1).astype(np.uint32)


def _neighbourhood(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the mean over 3 x 3 pixels: the spread of a few batches is noisy,
    and neighbours are alike.
    """
    padded = np.pad(values, 1, mode="edge")
    height, width = values.shape
    shifted = [
        padded[row : row + height, column : column + width]
        for row in range(3)
        for column in range(3)
    ]
    return np.mean(shifted, axis=0)
