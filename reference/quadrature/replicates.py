# SPDX-License-Identifier: BSD-3-Clause
r"""How many points of an area light a ray needs, and replicates of their sums whose intervals hold.

Eight independent scramblings of N points each give a mean; their spread S gives the standard error
S/sqrt(8). If the means are normal, (mean - value)/(S/sqrt(8)) has Student's distribution with 7
degrees of freedom, and 2.365 standard errors to either side hold the value in 95 % of all runs.
That holds for an N that is fixed beforehand. If points are doubled until S *of the same points* is
small, N is a stopping time: the S that stopped the doubling is too small on average. With n_k = 2^k
n_0, means of variance sigma_k^2 and S_k^2 = sigma_k^2 chi^2_7/7 the intervals hold the value with

    sum_k  P(S_0, ..., S_{k-1} > e)  P(S_k <= e, |mean - value| < 2.365 S_k/sqrt(8)),

where a round that stops by chance has an S_k below e and far below sigma_k. For independent rounds
with S ~ 1/N this is 92.4 to 95 % as e/sigma_0 varies, for S ~ N^-1/2 it is 90.4 to 95 %: too few.

A pilot therefore decides, and is not counted: eight replicates of other scramblings, with four
times as many points each time, until they predict a small enough standard error at not more than
four times their points. N is then independent of the points that count, and Student's distribution
holds for every N; the total cost is 1.2 to 1.7 times the cost of the points that count. The pilot
assumes S ~ N^-5/4, a little slower than the N^-3/2 of scrambled nets for smooth functions (Owen
1997, Scrambled net variance for integrals of smooth functions), which fog reaches. Where this is
too optimistic, the stated error is larger than the requested one, and right. A ray that could not
reach the error with all its points at that rate gets them all at once.

**Points of the unit square.** They are Sobol's in base 2, scrambled at random: in each coordinate a
digit is flipped or not by a coin of its own for each value of the digits before it (Owen 1995,
Randomly permuted (t,m,s)-nets and (t,s)-sequences). Each point is then uniform on its own, so every
sum over N of them has the right mean, and independent scramblings show its spread. Sums over nets
of that scrambling become normal (Loh 2003, On the asymptotic distribution of scrambled net
quadrature), as Student's intervals of a few replicates take for granted. With few points they can
be skewed, and the intervals of such a ray hold in 93 % of all runs. A random matrix with a digital
shift has the same variance but rarely a large error, often next to none: kurtosis 50 at 128 points
of a light in a penumbra, where nested scrambling has -0.2, and intervals that hold in 99 % of all
runs.

**Pairs.** A smooth function of the first coordinate alone leaves N^-3/2 of a scrambled net, since
each point is anywhere in its stratum. Two points of a stratum of twice the width, mirrored at its
middle, leave nothing of what is linear there, and N^-5/2 of what is smooth; at a kink they leave
N^-2 (Owen 2008, Local antithetic sampling with scrambled nets). With the other coordinate mirrored,
1 - v, what is linear in that goes too. Points that are pairs for one N are none for another: each
number of points therefore has its own set.

The light of a sphere is smooth, and periodic in an angle. There a lattice does better, (i, 1555
i)/N modulo 1, with a random shift, folded in the first coordinate by a tent, u = 1 - |2 t - 1|, and
in the order of the mirrored digits of i, so that every power of two of them is a lattice. For every
N from 16 to 16384 the shortest frequency that all N points see alike is at least 0.76 sqrt(N).

**Rays.** If all rays had the same points, their errors would be the same too, and the mean of an
image no more exact than one pixel. Each ray therefore has random digits of its own, by which its
points are moved: the exclusive or of the digits of coordinates, or a sum modulo 1 in a lattice. A
scrambled net, a mirrored pair and a lattice remain what they are. Whatever the points before they
are moved, each is uniform afterwards, so the mean over the moves is the integral: errors of two
rays are uncorrelated, and the mean over M rays has the variance of one over M.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Kept = Mapping[str, Array]
Keep = Callable[[str, Callable[[], Kept]], Kept]

PILOT = "pilot-"  #: the name of the part of the work that decides
REPLICATES = 8  #: independent scramblings
_AHEAD = 4  # times the points of a pilot: the most that it foresees


def keep_nothing(name: str, work: Callable[[], Kept]) -> Kept:
    """Do a part of the work: the `Keep` that keeps nothing."""
    return work()


@dataclass(frozen=True)
class PointPlan:
    """How many points stand for a light."""

    #: standard error over value for which a pilot chooses the points of a ray; 0: all points
    error: float = 1e-3
    first: int = 16  #: points of each replicate that every ray gets, a power of two
    most: int = 1024  #: points that no ray or surface point exceeds, a power of two
    seed: int = 0  #: of the scramblings
    #: whether surfaces get the light; if not, surfaces show other lights alone
    surfaces: bool = True

    @property
    def rounds(self) -> int:
        """How often the first points can be doubled, and once more."""
        return 1 + int(np.log2(max(1, self.most // max(1, self.first))))

    @property
    def points(self) -> tuple[int, int]:
        """How many points a ray takes at least and at most: of all replicates, with its pilots."""
        if not self.decides:
            return REPLICATES * self.most, REPLICATES * self.most
        return REPLICATES * (sum(self.pilots[:1]) + self.first), REPLICATES * (
            sum(self.pilots) + self.most
        )

    @property
    def decides(self) -> bool:
        """Whether a pilot chooses the points of a ray."""
        return self.error > 0 and self.first < self.most

    @property
    def pilots(self) -> list[int]:
        """The points of each replicate that pilots take, one after the other."""
        # The first pilot takes half of the first points, each further one `_AHEAD` times as many;
        # none takes half of the most points or more, since that would cost as much as to count
        # them.
        counts, count = list[int](), max(1, self.first // 2)
        while 2 * count < self.most:
            counts.append(count)
            count *= _AHEAD
        return counts


def square_points(plan: PointPlan, number: int, replicate: int, kind: str) -> Array:
    """Return the points of the unit square of a replicate of a light, (plan.most, 2) [1].

    `plan`: how many, and the seed; `number`: of the light; `replicate`: number of the replicate;
    `kind`: of the light, or "pairs" for points by twos, mirrored.
    """
    generator = np.random.default_rng((plan.seed, number, replicate))
    if kind == "pairs" and plan.most > 1:
        # Half as many points are one in each stratum of width 1/half. Each is moved to the lower
        # half of its stratum, and its pair is mirrored at the middle of the stratum: u' = (2 k +
        # 1)/half - u, v' = 1 - v.
        half = plan.most // 2
        u, v = square_points(replace(plan, most=half), number, replicate, "").T
        stratum = np.floor(half * u)
        u = 0.5 * (stratum / half + u)
        return np.stack(
            [np.concatenate([u, (2 * stratum + 1) / half - u]), np.concatenate([v, 1 - v])], axis=1
        )
    if kind == "sphere":
        return _folded(_lattice(plan.most) + generator.random(2))
    digits = max(1, plan.most - 1).bit_length()
    sobol = (scipy.stats.qmc.Sobol(2, scramble=False).random(plan.most) * (1 << digits)).astype(
        np.int64
    )
    return np.stack([_scrambled(column, digits, generator) for column in sobol.T], axis=1)


def _scrambled(numbers: NDArray[np.int64], digits: int, generator: np.random.Generator) -> Array:
    """Scramble the first binary digits of numbers, (n,), all different:
    what follows them is random.
    """
    flips = np.zeros_like(numbers)
    for digit in range(digits):
        # One coin for each value of the digits before this one (Owen 1995).
        before, place = numbers >> (digits - digit), digits - digit - 1
        flips |= generator.integers(0, 2, 1 << digit)[before] << place
    # The digits behind the scrambled ones are uniform, so that a point is anywhere in its cell.
    return ((numbers ^ flips) + generator.random(len(numbers))) / (1 << digits)


def _lattice(count: int) -> Array:
    """Return the points of a lattice, (count, 2), the second coordinate not modulo 1; the
    first 2^k of them are a lattice for every k.
    """
    # (i, 1555 i)/N of the derivation, in the order of the mirrored digits of i.
    return np.array([mirrored_digits(i) for i in range(count)])[:, None] * np.array([1.0, 1555.0])


def _folded(lattice: Array) -> Array:
    """Return the points of a lattice, (..., 2), modulo 1 and folded in the first coordinate."""
    place = np.mod(lattice, 1.0)
    place[..., 0] = 1 - np.abs(2 * place[..., 0] - 1)
    return place


@dataclass(frozen=True)
class RayPoints:
    """The points of all replicates for some rays, each moved by what is random for the ray."""

    square: Array  #: replicate after replicate, (points, 2) [1]; of a sphere not folded
    moves: Array  #: uniform, (rays, replicates, 2) [1]
    kind: str  #: of the light, or "pairs"

    @classmethod
    def of(cls, plan: PointPlan, number: int, rays: int, kind: str, part: int = 0) -> "RayPoints":
        """Return the points of a light for rays; `part` is the number of the first ray."""
        replicates = range(REPLICATES)
        if kind == "sphere":
            square = np.tile(_lattice(plan.most), (REPLICATES, 1))
        else:
            square = np.concatenate(
                [square_points(plan, number, replicate, kind) for replicate in replicates]
            )
        # The last 1 keeps this generator apart from those of the points.
        generator = np.random.default_rng((plan.seed, number, plan.most, part, 1))
        return cls(square, generator.random((rays, REPLICATES, 2)), kind)

    def __len__(self) -> int:
        return len(self.square)

    def __getitem__(self, rays: slice | Index) -> Array:
        """Return the points of rays, (rays, points, 2) [1]."""
        moves = np.repeat(self.moves[rays], len(self.square) // REPLICATES, axis=1)
        if self.kind == "sphere":
            return _folded(self.square + moves)
        # The exclusive or of 52 digits, which are all that a number from 0.5 to 1 has. The half
        # puts each point in the middle of its cell, so that no coordinate is 0 or 1.
        scale = float(1 << 52)
        digits = ((part * scale).astype(np.int64) for part in (self.square, moves))
        return (np.bitwise_xor(*digits) + 0.5) / scale


def mirrored_digits(number: int) -> float:
    """Return a number with its binary digits mirrored at the point: the first
    2^k of them are a lattice.
    """
    return float(int(f"{number:032b}"[::-1], 2)) / 2.0**32


Sums = Callable[[str, PointPlan, Index], Array]


def replicate_means(rays: int, known: Array, plan: PointPlan, sums: Sums) -> tuple[Array, Index]:
    """Return the means of every ray and replicate, (rays, columns, replicates), and of
    how many points, (rays,).

    `rays`: how many; `known`: what else they receive, to which errors are relative too, (rays,
    columns); `plan`: the error to reach, and how many points a ray has; `sums`: called with
    `PILOT`, or an empty name for what counts, the plan with its seed and as many points, `most`, as
    these rays get, and the numbers of some rays; returns what all points give in each replicate,
    added up, (rays, columns, replicates).
    """
    counts = np.full(rays, plan.most)
    if plan.decides:
        counts = _planned(rays, known, plan, sums)
    means = np.zeros((*known.shape, REPLICATES))
    for count in sorted(set(counts.tolist())):
        active = np.flatnonzero(counts == count)
        means[active] = sums("", replace(plan, most=count), active) / count
    return means, counts


def _planned(rays: int, known: Array, plan: PointPlan, sums: Sums) -> Index:
    """Return how many points each ray needs."""
    counts, active = np.full(rays, plan.most), np.arange(rays)
    floor: Array | None = None
    for count in plan.pilots:
        if not len(active):
            break
        # Another seed: N must be independent of the points that count.
        pilot = replace(plan, seed=plan.seed + (1 << 30), most=count)
        mean = sums(PILOT, pilot, active) / count
        value = mean.mean(axis=-1) + known[active]
        # The error of a ray below a twentieth of the mean over rays need not be small relative to
        # its value. The first pilot, of all rays, gives this floor; rays that meet a point light,
        # an infinite value, have no part in it.
        if floor is None:
            finite = np.isfinite(value).all(axis=1)
            floor = 0.05 * value[finite].sum(axis=0) / max(1, np.count_nonzero(finite))
        # Standard error over the allowed one, in the channel where that is largest.
        excess = (
            standard_error(mean) / (plan.error * np.maximum(value, floor) + np.finfo(float).tiny)
        ).max(axis=1)
        # S ~ N^-5/4: the number of points at which the error is the allowed one, over the first.
        needed = np.clip(count * excess ** (1 / 1.25) / plan.first, 1.0, plan.most / plan.first)
        # A pilot is believed up to `_AHEAD` times its points. Other rays go to the next pilot,
        # unless they need all points anyway: then they keep `plan.most`.
        near = needed * plan.first <= _AHEAD * count
        foreseen = plan.first << np.ceil(np.log2(needed)).astype(int)
        counts[active[near]] = np.maximum(foreseen[near], count)
        active = active[~near & (foreseen < plan.most)]
    return counts


def standard_error(replicates: Array) -> Array:
    """Return the standard errors of the means over the replicates, the last axis."""
    return replicates.std(axis=-1, ddof=1) / np.sqrt(replicates.shape[-1])
