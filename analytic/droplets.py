# SPDX-License-Identifier: BSD-3-Clause
"""Clouds and fog of water droplets: extinction and phase function, from Mie's theory over
the sizes of the droplets.

The modified gamma distribution (Bouthors 2008, eq. 3) has the number of droplets by radius

    N(r) = N_0 / (Gamma(gamma) r_n) (r/r_n)^(gamma - 1) exp(-r/r_n).

Its moments are <r^k> = r_n^k Gamma(gamma + k)/Gamma(gamma): the mean square radius is gamma
(gamma + 1) r_n^2, the effective radius r_e = <r^3>/<r^2> = (gamma + 2) r_n.

**Extinction.** A droplet takes Q_ext pi r^2 out of a beam, hence

    kappa = N_0 <Q_ext pi r^2> = N_0 pi <r^2> Q,        Q = <Q_ext r^2>/<r^2>.

Equation 4 of the paper prints kappa = N_0 pi r_e^2: it has the square of the effective radius for
the mean square radius, (gamma + 2)^2 for gamma (gamma + 1), and lacks Q. For gamma = 2 the wrong
square is 2.67 times too much, the missing Q 2.14 times too little. `Optics.printed_extinction` is
the printed value.

**Sizes.** With u = r/r_n both averages have the weight u^(gamma + 1) exp(-u). The rule is the
midpoint rule between the quantiles 1e-9 and 1 - 1e-9 of this weight. A sphere without absorption
has resonances too narrow for any rule: the rule samples them at random, and the error falls as
slowly as the number of sizes grows. The sizes of the rule are therefore part of the definition of a
phase function here, and `realtime.droplets` takes the same sizes; `Droplets.sizes` says what more
sizes would change.

**Phase function.** |S_1|^2 + |S_2|^2 of a sphere of N terms is a polynomial of degree 2 N - 1 at
most in the cosine: 2 S_1 and S_2 are sums of pi_n and tau_n, polynomials of degree n - 1 and n, and
products of two of these have at most twice that degree. Hence Gauss-Legendre nodes, one more than
N_largest each way, give all Legendre moments exactly,

    p(cos) = sum_l (2 l + 1) chi_l P_l(cos),      chi_l = (1/2) int p P_l dcos,      chi_0 = 1, chi_1 = g,

and the series equals the function at any cosine. Values come from a cubic spline over the angle
through values of the series at sixteen angles for each of its terms; the spline differs from the
series by less than 1e-8 of the value.

**The modified phase function** (the paper's appendix, after Lenoble 1985) cuts the forward peak:
light that a droplet deflects by less than 5 degrees counts as not scattered. Let f be the fraction
of the light that is cut out of p. The rest is p_cut/(1 - f), of mean 1, and, so that the same light
is scattered into other directions as before,

    kappa' = (1 - albedo f) kappa,        albedo' = albedo (1 - f)/(1 - albedo f).

The paper prints f = 0.5, "converted into 50 % lowered density", and a peak of 51 % of the energy.
Here the function is 0 below the angle, and the density is lowered by the fraction that is cut.

Light of order 1 must not lose its peak, nor count it twice: with kappa' and albedo' it takes the
full phase function divided by 1 - f (the correction of Nakajima and Tanaka 1988, TMS), since
albedo' kappa' p/(1 - f) = albedo kappa p. With kappa' and the albedo itself the divisor is 1 -
albedo f.
"""

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import ClassVar

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from airlight.analytic.mie import angular_functions, coefficients, intensities, summed, terms
from airlight.errors import InputError

Array = NDArray[np.float64]

#: Refractive index of water by the wavelength [um] (Hale and Querry 1973, interpolated; the
#: imaginary part is below 2e-8 and left out: droplets of the sizes here lose less than 1e-5 of the
#: light).
WATER = {0.65: 1.331, 0.55: 1.333, 0.45: 1.337}


@dataclass(frozen=True)
class Droplets:
    """The sizes of droplets, by default the cumulus of Bouthors 2008.

    Raises
    ------
    InputError
        For an effective radius outside 2 to 50 um, or a `gamma` or `number` that is not above 0.
    """

    effective_radius: float = 6.0  #: r_e [um], 2 to 50
    gamma: float = 2.0  #: how narrow the distribution is [1], above 0
    number: float = 4e8  #: N_0, droplets in a volume [1/m^3]

    def __post_init__(self):
        low, high = 2.0, 50.0  # r_e [um]
        if not low <= self.effective_radius <= high:
            raise InputError(
                f"the effective radius is {self.effective_radius} um; expected {low:g} to {high:g} "
                "um, the droplets of "
                "fog and clouds"
            )
        for name in ("gamma", "number"):
            if not 0 < getattr(self, name) < np.inf:
                raise InputError(
                    f"{name} of the droplets is {getattr(self, name)}; expected a number above 0"
                )

    @property
    def scale(self) -> float:
        """r_n [um]."""
        return self.effective_radius / (self.gamma + 2)

    @property
    def mean_square_radius(self) -> float:
        """<r^2> [um^2]."""
        return self.gamma * (self.gamma + 1) * self.scale**2

    @property
    def sizes(self) -> int:
        """How many sizes are averaged."""
        # Up to r_e = 6 um all of them; beyond, fewer in inverse proportion, but at least a quarter.
        # *Measured* at 6 um, green: twice as many move Q by 1.1e-4, g by 4e-5, the phase function
        # by 0.1 % (median), 0.8 % (largest).
        most = 6400
        return round(most * min(1.0, max(0.25, 6 / self.effective_radius)))

    def nodes(self, count: int) -> tuple[Array, Array]:
        """Return `count` radii in increasing order [um] and weights of an
        average weighted by r^2 [1].
        """
        # The weight u^(gamma + 1) exp(-u) is the density of a gamma distribution of shape
        # gamma + 2; the rule leaves out this fraction of it at both ends.
        tail = 1e-9
        low, high = (
            inverse(self.gamma + 2, tail)
            for inverse in (scipy.special.gammaincinv, scipy.special.gammainccinv)
        )
        u = low + (high - low) * (np.arange(count) + 0.5) / count
        # The weight over its largest value, at u = gamma + 1, as the power of u overflows for large
        # gamma. The division by the sum cancels the factor.
        density = np.exp((self.gamma + 1) * np.log(u / (self.gamma + 1)) - (u - self.gamma - 1))
        return u * self.scale, density / density.sum()


@dataclass(frozen=True)
class Optics:
    """How droplets extinguish and scatter light of one wavelength; call it with
    cosines for the phase function.
    """

    droplets: Droplets
    wavelength: float  #: [um]
    index: complex  #: of refraction [1]
    q_extinction: float  #: Q = <Q_ext r^2>/<r^2> [1]
    q_scattering: float  #: <Q_sca r^2>/<r^2> [1]
    chi: Array  #: all Legendre moments that are not zero [1], (terms,)

    @property
    def albedo(self) -> float:
        """Return the single-scattering albedo [1]."""
        return min(self.q_scattering / self.q_extinction, 1.0)

    @property
    def g(self) -> float:
        """Return the mean cosine of the scattering angle [1]."""
        return float(self.chi[1])

    @property
    def extinction(self) -> float:
        """Return kappa = N_0 pi <r^2> Q [1/m]."""
        # 1e-12 turns um^2 into m^2.
        return (
            self.droplets.number
            * np.pi
            * self.droplets.mean_square_radius
            * 1e-12
            * self.q_extinction
        )

    @property
    def mean_free_path(self) -> float:
        """Return 1/kappa [m]."""
        return 1 / self.extinction

    @property
    def printed_extinction(self) -> float:
        """Return kappa as equation 4 of Bouthors 2008 prints it, N_0 pi r_e^2 [1/m]."""
        return self.droplets.number * np.pi * self.droplets.effective_radius**2 * 1e-12

    def series(self, cos_scatter: ArrayLike) -> Array:
        """Return the phase function [1] at cosines of any shape, by its Legendre series."""
        terms = (2 * np.arange(len(self.chi)) + 1) * self.chi
        return np.asarray(
            np.polynomial.legendre.legval(np.asarray(cos_scatter, dtype=np.float64), terms)
        )

    def moments(self, count: int) -> Array:
        """Return the first Legendre moments chi_l [1], (count,)."""
        return np.pad(self.chi[:count], (0, max(count - len(self.chi), 0)))

    @cached_property
    def spline(self) -> "scipy.interpolate.CubicSpline":
        """The phase function [1] over the scattering angle [rad]."""
        # Sixteen angles for each term keep the error below 1e-8 of the value. p is even about both
        # ends, so that its slope there is 0 (`clamped`).
        angles = 16
        angle = np.linspace(0, np.pi, angles * len(self.chi) + 1)
        return scipy.interpolate.CubicSpline(angle, self.series(np.cos(angle)), bc_type="clamped")

    def __call__(self, cos_scatter: ArrayLike) -> Array:
        """Return the phase function [1] at cosines of the scattering angle, of any shape."""
        c = np.asarray(cos_scatter, dtype=np.float64)
        return self.from_half(0.5 - 0.5 * c, 0.5 + 0.5 * c)

    def from_half(self, down: Array, up: Array) -> Array:
        """Return the phase function [1] from sin^2 and cos^2 of half the scattering
        angle, arrays of one shape.
        """
        # The arc tangent of both roots is exact near 0 and near pi, where an arc cosine loses
        # digits.
        return self.spline(2 * np.arctan2(np.sqrt(down), np.sqrt(up)))

    def fraction(self, low: float, high: float) -> float:
        """Return the fraction of the light [1] that is scattered between two angles [degrees]."""
        return _integral(self, low, high)


@lru_cache(maxsize=32)
def optics(
    droplets: Droplets | None = None, wavelength: float = 0.55, *, sizes: int | None = None
) -> Optics:
    """Return how droplets extinguish and scatter light.

    `droplets`: their sizes; the cumulus of Bouthors 2008 by default; `wavelength`: of light in air
    [um], one of `WATER`; `sizes`: how many sizes are averaged; `Droplets.sizes` by default. Raises
    InputError for another wavelength.

    Valid for all `Droplets`. Takes some seconds at r_e = 6 um, and a minute at 50
    um; the results are cached.
    """
    distribution = droplets or Droplets()
    if wavelength not in WATER:
        raise InputError(
            f"the wavelength is {wavelength} um; expected "
            f"{', '.join(f'{each:g}' for each in WATER)} um"
        )
    # The radii of the rule, in increasing order, as sizes x = 2 pi r/wavelength.
    m = complex(WATER[wavelength])
    radius, weight = distribution.nodes(sizes or distribution.sizes)
    x = 2 * np.pi * radius / wavelength
    # N of the largest sphere. The intensities are polynomials of degree 2 N - 1 at most, and so are
    # the Legendre polynomials of the moments: 2 N + 1 Gauss nodes integrate their products exactly.
    count = terms(float(x[-1]))
    nodes, fractions = np.polynomial.legendre.leggauss(2 * count + 1)
    # Small spheres need few terms: each block has as many as its largest sphere.
    block_count = 16
    blocks = [
        (part, *coefficients(x[part], m)) for part in np.array_split(np.arange(len(x)), block_count)
    ]
    # Weighted by r^2 (`Droplets.nodes`): <Q r^2>/<r^2>.
    extinction = scattering = 0.0
    for part, a, b in blocks:
        efficiency = summed(x[part], a, b)
        extinction += float(weight[part] @ efficiency.extinction)
        scattering += float(weight[part] @ efficiency.scattering)
    # This many cosines at a time: pi_n and tau_n of all of them would be 2 N^2 numbers each.
    columns = 1024
    phase = np.empty_like(nodes)
    for start in range(0, len(nodes), columns):
        part_of_nodes = slice(start, start + columns)
        pi, tau = angular_functions(nodes[part_of_nodes], count)
        # A sphere scatters 2 (|S_1|^2 + |S_2|^2)/(x^2 Q_sca) and counts with Q_sca in the mean,
        # which therefore cancels.
        phase[part_of_nodes] = sum(
            2 * (weight[part] / x[part] ** 2) @ intensities(a, b, pi, tau) for part, a, b in blocks
        )
    return Optics(
        distribution,
        wavelength,
        m,
        extinction,
        scattering,
        _moments(nodes, fractions, phase, 2 * count),
    )


@dataclass(frozen=True)
class Modified:
    """The phase function without its forward peak, divided by the fraction of the rest."""

    full: Optics

    angle: ClassVar[float] = 5.0  #: below which the function is 0 [degrees]

    @cached_property
    def removed(self) -> float:
        """The fraction of the light that is cut out of the phase function, and by which
        the density is lowered [1].
        """
        return self.full.fraction(0, self.angle)

    def __call__(self, cos_scatter: ArrayLike) -> Array:
        """Return the phase function [1] at cosines of the scattering angle, of
        any shape; its mean is 1.
        """
        c = np.asarray(cos_scatter, dtype=np.float64)
        return self.from_half(0.5 - 0.5 * c, 0.5 + 0.5 * c)

    def from_half(self, down: Array, up: Array) -> Array:
        """Return the phase function [1] from sin^2 and cos^2 of half the scattering
        angle, arrays of one shape.
        """
        # `down` is sin^2 of half the angle, and so is the edge.
        edge = np.sin(np.deg2rad(0.5 * self.angle)) ** 2
        return np.where(down < edge, 0.0, self.full.from_half(down, up)) / (1 - self.removed)


def _moments(cos_scatter: Array, weights: Array, values: Array, count: int) -> Array:
    """Return (1/2) sum weights values P_l for l < count over that for l = 0, (count,)."""
    weighted = 0.5 * weights * values
    # P_{-1}, which counts 0 times, and P_0; then the recurrence of Legendre polynomials.
    lower, legendre = np.zeros_like(cos_scatter), np.ones_like(cos_scatter)
    sums = np.empty(count)
    for order in range(count):
        sums[order] = weighted @ legendre
        lower, legendre = (
            legendre,
            ((2 * order + 1) * cos_scatter * legendre - order * lower) / (order + 1),
        )
    # chi_0 is 1 by definition: divided by it, values may be in any unit.
    return sums / sums[0]


def _integral(phase: Optics, low: float, high: float) -> float:
    """Return (1/2) int p dcos between two angles [degrees]: half the series, a sum of
    (P_{l+1} - P_{l-1}) chi_l.
    """
    edges = np.cos(np.deg2rad([high, low]))
    # P_0 and P_1 at both edges.
    lower, legendre = np.ones(2), edges.copy()
    # The term of l = 0, (1/2) int dcos.
    total = 0.5 * np.array(edges)
    for order in range(1, len(phase.chi)):
        # (2 l + 1) int P_l dcos = P_{l+1} - P_{l-1}: no quadrature is needed.
        higher = ((2 * order + 1) * edges * legendre - order * lower) / (order + 1)
        total += 0.5 * phase.chi[order] * (higher - lower)
        lower, legendre = legendre, higher
    return float(total[1] - total[0])
