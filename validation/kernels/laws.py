# SPDX-License-Identifier: BSD-3-Clause
"""Laws that the airlight integral obeys exactly, and by how much a kernel misses them.

From J = int_{x0}^{x1} exp(-sigma_t (x + r)) p(cos) / r^2 dx, r^2 = h^2 + (x - t)^2:

* unit scaling: J(c lengths, sigma_t / c) = J / c. For c a power of two no digit changes in floating point: what differs
  comes from a constant with a unit, an epsilon against division by zero for instance.
* additivity: J(x0, m) + J(m, x1) = J(x0, x1).
* camera shift: moving the camera back by d adds the way d: J(t + d, x0 + d, x1 + d) = exp(-sigma_t d) J(t, x0, x1).
* reversal: in a vacuum the ray may be looked along from its other end: J(t, h, x0, x1; p(cos)) = J(x0 + x1 - t, h, x0,
  x1; p(-cos)). Extinction breaks it: the way to the camera changes.
* intensity: L is linear in the intensity, which J does not contain: J must not change at all.
* phase: J is linear in p: the mean of two tables gives the mean of their J.
* same phase: 'hg' with g = 0 and a table of ones are isotropic.

Swapping camera and light. A single ray has no such law: the ray from the light has no more than one point in common
with the ray from the camera. But the light scattered at one point P reaches the camera C from the light L with
exp(-sigma_t (|CP| + |PL|)) p(cos) / (|CP|^2 |PL|^2) per volume, which is symmetric in C and L, since the angle of
scattering is the same both ways. With dV = |CP|^2 dx dw, summed over all directions w in which C sees a body B,

    int J_{C,L}(w) dw = int_B exp(-sigma_t (|CP| + |PL|)) p(cos) / (|CP|^2 |PL|^2) dV = int J_{L,C}(w) dw

where J runs over the part of each ray inside B. Here B is a sphere of radius R whose centre lies on the line CL, b from
C and e from L. At the angle asin(R sin(u)/b) to the axis the ray is inside between b cos - R cos u and b cos + R cos u,
so that a Gauss-Legendre rule in u converges at once: "swap" compares the two sums. For a body that both see alike,
all of space for one, it would hold by symmetry and prove nothing, so b and e differ.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from analytic.cases import Cases
from validation.kernels.rays import table
from validation.kernels.values import TABLE, Kernel, evaluate_cases, take

Array = NDArray[np.float64]

_SMALL = 1e-30  # J below this may be denormal in float32 before or after scaling
_SCALE = 1024.0


@dataclass(frozen=True)
class Law:
    """By how much a kernel misses a law, relative to J [1]; None where it refuses every case."""

    name: str
    rows: int  #: cases compared in double precision
    single: float | None  #: largest deviation in float32
    double: float | None  #: largest deviation in float64


@dataclass(frozen=True)
class _Tried:
    """A kernel, the cases to try it on, and what it gives for them as they are."""

    function: Kernel
    cases: Cases
    precision: str
    J: Array

    def evaluate(self, cases: Cases, **options) -> Array:
        return evaluate_cases(cases, self.function, self.precision, **options).J


def laws(function: Kernel, cases: Cases, names: Sequence[str] | None = None) -> list[Law]:
    """Return by how much a kernel misses each law.

    Parameters
    ----------
    function
        A kernel function.
    cases
        Rays to try, see `validation.kernels.rays.hard_rays`; exact float32 numbers.
    names
        Which laws; all by default.
    """
    J = {precision: evaluate_cases(cases, function, precision).J for precision in ("single", "double")}
    laws = []
    for name in names or _LAWS:
        law = _LAWS[name]
        worst = {precision: _largest(*law(_Tried(function, cases, precision, J[precision]))) for precision in J}
        laws.append(Law(name, worst["double"][1], worst["single"][0], worst["double"][0]))
    return laws


def _largest(first: Array, second: Array) -> tuple[float | None, int]:
    """Return the largest relative deviation and the number of rows; infinite where one side is not finite."""
    compared = ~(np.isnan(first) & np.isnan(second))
    first, second = first[compared], second[compared]
    size = np.maximum(np.abs(first), np.abs(second))
    large = ~(size < _SMALL)
    if not large.any():
        return None, 0
    with np.errstate(invalid="ignore"):
        deviation = np.abs(first[large] - second[large]) / size[large]
    return float(np.max(np.where(np.isfinite(deviation), deviation, np.inf))), int(large.sum())


def _scaling(tried: _Tried) -> tuple[Array, Array]:
    cases = tried.cases
    scaled = replace(
        cases,
        foot=cases.foot * _SCALE,
        height=cases.height * _SCALE,
        x0=cases.x0 * _SCALE,
        x1=cases.x1 * _SCALE,
        sigma_t=cases.sigma_t / _SCALE,
    )
    return tried.evaluate(scaled) * _SCALE, tried.J


def _additivity(tried: _Tried) -> tuple[Array, Array]:
    cases = tried.cases
    beyond = cases.x0 + np.hypot(cases.foot, cases.height)
    middle = np.where(np.isinf(cases.x1), beyond, cases.x0 + 0.37 * (np.minimum(cases.x1, 1e38) - cases.x0))
    middle = middle.astype(np.float32).astype(np.float64)
    first = tried.evaluate(replace(cases, x1=middle))
    second = tried.evaluate(replace(cases, x0=middle))
    return first + second, tried.J


def _shift(tried: _Tried) -> tuple[Array, Array]:
    cases = tried.cases
    d = 2.0 ** np.floor(np.log2(np.hypot(cases.foot, cases.height)) - 1)
    moved = replace(cases, foot=cases.foot + d, x0=cases.x0 + d, x1=cases.x1 + d)
    exact = _representable(
        tried.precision, (moved.foot, d, cases.foot), (moved.x0, d, cases.x0), (moved.x1, d, cases.x1)
    )
    return tried.evaluate(take(moved, exact)), tried.J[exact] * np.exp(-cases.sigma_t * d)[exact]


def _representable(precision: str, *sums: tuple[Array, Array, Array]) -> NDArray[np.bool_]:
    """Return where each sum, sum = d + part, is a number of this precision: then moving loses no digit."""
    dtype = np.float32 if precision == "single" else np.float64
    exact = np.ones(len(sums[0][0]), dtype=bool)
    for total, d, part in sums:
        with np.errstate(invalid="ignore"):
            back = (total - d == part) & (total - part == d)
        exact &= (back | np.isinf(total)) & (total.astype(dtype) == total)
    return exact


def _reversal(tried: _Tried) -> tuple[Array, Array]:
    cases = tried.cases
    known = np.isin(cases.phase, ("isotropic", "rayleigh", "hg")) & np.isfinite(cases.x1)
    cases = take(replace(cases, sigma_t=np.zeros(len(cases.x0))), known)
    total = cases.x0 + cases.x1
    foot = total - cases.foot
    exact = _representable(tried.precision, (total, cases.x0, cases.x1), (total, cases.foot, foot))
    exact &= foot.astype(np.float32 if tried.precision == "single" else np.float64) == foot
    back = take(replace(cases, foot=foot, g=-cases.g), exact)
    return tried.evaluate(take(cases, exact)), tried.evaluate(back)


def _intensity(tried: _Tried) -> tuple[Array, Array]:
    cases = tried.cases
    strong = tried.evaluate(cases, intensity=37.0)
    return strong, tried.J


def _phase(tried: _Tried) -> tuple[Array, Array]:
    cases = tried.cases
    cases = _with_phase(cases, "tabulated")
    tables = np.array([TABLE, TABLE[::-1]])
    first, second = (tried.evaluate(cases, table=each) for each in tables)
    return 0.5 * (first + second), tried.evaluate(cases, table=tables.mean(axis=0))


def _same_phase(tried: _Tried) -> tuple[Array, Array]:
    cases = tried.cases
    isotropic = tried.evaluate(_with_phase(cases, "isotropic"))
    lobe = tried.evaluate(_with_phase(cases, "hg"))
    ones = tried.evaluate(_with_phase(cases, "tabulated"), table=np.ones(9))
    same = np.concatenate([lobe, ones])
    return same, np.where(np.isnan(same), np.nan, np.tile(isotropic, 2))


def _with_phase(cases: Cases, phase: str) -> Cases:
    return replace(cases, phase=(phase,) * len(cases.x0), g=np.zeros(len(cases.x0)))


#: b, e and R of the spheres, sigma_t; b and e on either side of the sphere or both on one.
_SPHERES = (
    (2.0, 3.25, 1.25, 0.5, 1),
    (1.75, 5.0, 1.5, 0.125, 1),
    (6.0, 2.5, 2.0, 0.0, 1),
    (2.0, 4.5, 1.0, 0.75, -1),
    (8.0, 3.0, 2.5, 0.25, -1),
)
_SWAP_PHASES = (("isotropic", 0.0), ("rayleigh", 0.0), ("hazy", 0.0), ("hg", 0.5), ("hg", -0.5), ("murky", 0.0))


def _swap(tried: _Tried) -> tuple[Array, Array]:
    return _seen_spheres(tried, _SPHERES), _seen_spheres(tried, tuple((e, b, *others) for b, e, *others in _SPHERES))


def _seen_spheres(tried: _Tried, spheres) -> Array:
    """Return int J dw over spheres of radius R at a distance b from the camera, for every phase function.

    The light is at e behind the sphere (side 1) or before it (-1); behind the camera where e > b.
    """
    nodes, weights = np.polynomial.legendre.leggauss(64)
    u, weights = 0.25 * np.pi * (nodes + 1), 0.25 * np.pi * weights
    b, e, R, sigma_t, side = np.array(spheres).T[:, None, :, None]
    sine = R / b * np.sin(u)
    cosine = np.sqrt(1 - sine**2)
    light = b + side * e  # where it lies on the axis
    # dw = 2 pi sin d(angle), d(angle) = (R/b) cos u / cos du
    weights = 2 * np.pi * weights * sine * (R / b) * np.cos(u) / cosine
    columns = (light * cosine, np.abs(light) * sine, b * cosine - R * np.cos(u), b * cosine + R * np.cos(u), sigma_t)
    shape = (len(_SWAP_PHASES), len(spheres), len(u))
    foot, height, x0, x1, sigma_t = (np.broadcast_to(column, shape).ravel() for column in columns)
    rows = shape[1] * shape[2]
    phase, g = (np.repeat(column, rows) for column in zip(*_SWAP_PHASES))
    tags = np.full(len(foot), "swap")
    rays = table(phase, g, foot=foot, height=height, x0=x0, x1=x1, sigma_t=sigma_t, tags=tags)
    return np.sum(weights * tried.evaluate(rays).reshape(shape), axis=-1).ravel()


_LAWS: dict[str, Callable[[_Tried], tuple[Array, Array]]] = {
    "unit scaling": _scaling,
    "additivity": _additivity,
    "camera shift": _shift,
    "reversal": _reversal,
    "intensity": _intensity,
    "phase": _phase,
    "same phase": _same_phase,
    "swap": _swap,
}
