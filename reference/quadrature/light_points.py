# SPDX-License-Identifier: BSD-3-Clause
"""Points on lights with extent: each is a point light whose intensity falls off as the cosine to the normal.

The radiance Le of an element dA of the surface, seen under the angle whose cosine to its normal is cos_l, is the
intensity Le cos_l dA. The points are uniform on the surface, so one of N stands for the area A/N. They come from the
unit square by maps that keep areas: a rectangle as it is; a disk by concentric squares (Shirley, Chiu 1997, A low
distortion map between disk and square, J. Graphics Tools 2(3)); a sphere by its heights and azimuths (Archimedes).

The points of the square are Sobol's in base 2, scrambled at random: in each coordinate a digit is flipped or not by a
coin of its own for each value of the digits before it (Owen 1995, Randomly permuted (t,m,s)-nets and (t,s)-sequences).
Each point is then uniform on its own, so every sum over N of them has the right mean, and independent scramblings show
its spread. Sums over nets of that scrambling become normal (Loh 2003, On the asymptotic distribution of scrambled net
quadrature), as Student's intervals of a few replicates take for granted. A random matrix with a digital shift has the
same variance but rarely a large error, often next to none: kurtosis 50 at 128 points of a light in a penumbra, where
nested scrambling has -0.2, and intervals that hold in 99 % of all runs.

What a sphere sends is smooth and periodic in its azimuth. There a lattice does better, (i, 8597 i)/N modulo 1, with a
random shift, folded in the height by a tent, u = 1 - |2 t - 1|, and in the order of the mirrored digits of i, so that
every power of two of them is a lattice. Its spread is a tenth of Sobol's at 256 points; 8597 is the best of 120 odd
numbers at 64, 256 and 1024 points of a sphere beside a ray.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from reference.scene.area_light import TruthAreaLight
from reference.scene.read import TruthLight

Array = NDArray[np.float64]

_LATTICE = np.array([1.0, 8597.0])
REPLICATES = 8  #: independent scramblings


@dataclass(frozen=True)
class PointPlan:
    """How many points stand for a light."""

    error: float = 1e-3  #: standard error over value for which a pilot chooses the points of a ray; 0: all points
    first: int = 16  #: points of each replicate that every ray gets, a power of two
    most: int = 1024  #: points, or scan lines, that no ray exceeds, a power of two
    seed: int = 0  #: of the scramblings
    shared: bool = False  #: whether all surface points have the same scan lines: their errors are then alike
    surfaces: bool = True  #: whether surfaces get the light; if not, theirs is that of other lights alone

    @property
    def rounds(self) -> int:
        """How often the first points can be doubled, and once more."""
        return 1 + int(np.log2(max(1, self.most // max(1, self.first))))


def square_points(plan: PointPlan, number: int, replicate: int, kind: str) -> Array:
    """Return the points of the unit square of a replicate of a light, (plan.most, 2) [1].

    Parameters
    ----------
    plan
        How many, and the seed.
    number, kind
        Of the light.
    replicate
        Number of the replicate.
    """
    generator = np.random.default_rng((plan.seed, number, replicate))
    if kind == "sphere":
        place = np.array([mirrored_digits(i) for i in range(plan.most)])
        place = np.mod(place[:, None] * _LATTICE + generator.random(2), 1.0)
        place[:, 0] = 1 - np.abs(2 * place[:, 0] - 1)
        return place
    digits = max(1, plan.most - 1).bit_length()
    sobol = (qmc.Sobol(2, scramble=False).random(plan.most) * (1 << digits)).astype(np.int64)
    return np.stack([_scrambled(column, digits, generator) for column in sobol.T], axis=1)


def _scrambled(numbers: NDArray[np.int64], digits: int, generator: np.random.Generator) -> Array:
    """Scramble the first binary digits of numbers, (n,), all different: what follows them is random."""
    flips = np.zeros_like(numbers)
    for digit in range(digits):
        before, place = numbers >> (digits - digit), digits - digit - 1
        flips |= generator.integers(0, 2, 1 << digit)[before] << place
    return ((numbers ^ flips) + generator.random(len(numbers))) / (1 << digits)


def mirrored_digits(number: int) -> float:
    """Return a number with its binary digits mirrored at the point: the first 2^k of them are a lattice."""
    return float(int(f"{number:032b}"[::-1], 2)) / 2.0**32


def light_points(light: TruthAreaLight, square: Array) -> Sequence[TruthLight]:
    """Return the points of a light as lights whose mean is the light.

    Parameters
    ----------
    light
        The light.
    square
        Points of the unit square, (n, 2) [1].

    Returns
    -------
    sequence of TruthLight
        Each with the intensity radiance times the whole area [W/sr].
    """
    if light.kind == "sphere":
        height, azimuth = 1 - 2 * square[:, 0], 2 * np.pi * square[:, 1]
        across = np.sqrt(np.maximum(1 - height**2, 0.0))
        normals = np.stack([across * np.cos(azimuth), across * np.sin(azimuth), height], axis=1) @ light.frame
        places = light.centre + light.radius * normals
    else:
        sides = 2 * square - 1
        sides = _concentric(sides) if light.kind == "disk" else sides
        places = light.centre + (light.half * sides) @ light.frame[:2]
        normals = np.broadcast_to(light.normal, places.shape)
    intensity, quarter = light.radiance * light.area, 0.5 * np.pi
    return [
        TruthLight(place, intensity, normal, cutoff=quarter, beam=quarter, cosine=True)
        for place, normal in zip(places, normals, strict=True)
    ]


def _concentric(sides: Array) -> Array:
    """Map [-1, 1]^2 to the unit disk, squares about the middle to circles."""
    a, b = sides.T
    wide = np.abs(a) > np.abs(b)
    radius, other = np.where(wide, a, b), np.where(wide, b, a)
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio = np.where(radius != 0, other / radius, 0.0)
    angle = np.where(wide, 0.25 * np.pi * ratio, 0.5 * np.pi - 0.25 * np.pi * ratio)
    return radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
