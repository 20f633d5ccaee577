# SPDX-License-Identifier: BSD-3-Clause
"""Rays that kernels are tried on: quasi-random, exact float32 numbers, with the
reference from `analytic`.

Two sets, each the same on every machine:

* `hard_rays` covers every magnitude: optical depth 1e-6 to 60 (of the shortest way camera, segment,
  light), height over distance 1e-7 to 1, scale 1e-6 to 1e6, |g| up to 0.95, light before and behind
  the camera, segments from 1e-3 to 1e3 distances and unbounded ones, all phase functions.
* `wide_rays` is the set W on which costs are compared: optical depth 1e-4 to 60 at the distance of
  the light (what is dimmer than exp(-60) float32 flushes to zero on the way), angle to the light
  1e-3 to 179.999 degrees, uniform, length 1e-3 to 100 distances, from the camera on. With
  extinction 1 the optical depth is the distance itself: J obeys J(c lengths, sigma_t / c) = J / c.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import qmc

from airlight.analytic.phase import PHASE_NAMES
from airlight.reference.storage.store import Inputs, stored
from airlight.validation.arrays import Array
from airlight.validation.kernels.case_files import Cases, integrate_cases
from airlight.validation.kernels.cases import TABLE

COLUMNS = ("tag", "phase", "g", "t", "h", "x0", "x1", "sigma_t", "value")


@dataclass(frozen=True)
class RayInputs(Inputs):
    """The inputs of the integrals of rays."""

    kind = "kernel-rays"
    cases: Cases


def hard_rays(count: int = 100_000) -> Cases:
    """Return rays that cover every magnitude, with tags and the true J."""
    # Ten coordinates of a Sobol point, one for each choice.
    u = _sobol(count, 10)
    distance = _log(u[:, 0], 1e-6, 1e6)
    height = distance * _log(u[:, 1], 1e-7, 1.0)
    # Seven rays of ten have the light before the camera. The height is a fraction of the distance:
    # down to 1e-7, rays that nearly meet the light.
    foot = np.where(u[:, 2] < 0.7, 1.0, -1.0) * np.sqrt(np.maximum(distance**2 - height**2, 0.0))
    start = np.where(u[:, 3] < 0.5, 0.0, distance * _log(u[:, 4], 1e-3, 30.0))
    length = distance * _log(u[:, 5], 1e-3, 1e3)
    # Everything is rounded to float32 numbers: both precisions, and the reference, see the same
    # ray.
    foot, height, x0 = _rounded(foot), _rounded(height), _rounded(start)
    x1 = np.where(u[:, 6] < 0.1, np.inf, _rounded(x0 + length))
    thickness = _log(u[:, 7], 1e-6, 60.0)
    # The optical depth belongs to the way from the camera to the beginning of the segment and on to
    # the light.
    sigma_t = _rounded(thickness / (x0 + np.hypot(x0 - foot, height)))
    phase = np.asarray(PHASE_NAMES)[
        np.minimum((u[:, 8] * len(PHASE_NAMES)).astype(int), len(PHASE_NAMES) - 1)
    ]
    # Few values of g, since the reference takes one at a time.
    gs = np.linspace(-0.95, 0.95, 39).astype(np.float32).astype(np.float64)
    g = np.where(phase == "hg", gs[np.minimum((u[:, 9] * len(gs)).astype(int), len(gs) - 1)], 0.0)
    # A ray gets the first tag that fits.
    tags = np.select(
        [
            (height < 1e-3 * distance) & (x0 < foot) & (foot < x1),
            np.isinf(x1),
            foot <= 0,
            thickness > 5,
            thickness < 1e-3,
            length < 1e-2 * distance,
            x1 < foot,
        ],
        ["near_light", "infinite", "behind", "thick", "thin", "sliver", "beyond"],
        "generic",
    )
    return with_reference(
        table(phase, g, foot=foot, height=height, x0=x0, x1=x1, sigma_t=sigma_t, tags=tags)
    )


def wide_rays(
    count: int, phase: str = "isotropic", g: float = 0.0, *, reference: bool = True
) -> Cases:
    """Return the set W (see the module) for one phase function, with the extinction 1/m,
    and with the true J or not.
    """
    u = _sobol(count, 3)
    distance = _log(u[:, 0], 1e-4, 60.0)
    angle = np.radians(1e-3 + (180.0 - 2e-3) * u[:, 1])
    # The camera is at 0: distance and angle to the light give foot and height.
    foot, height = _rounded(distance * np.cos(angle)), _rounded(distance * np.sin(angle))
    x1 = _rounded(distance * _log(u[:, 2], 1e-3, 100.0))
    names = np.full(count, phase)
    # g as float32 has it, for the kernel and the reference alike.
    g_exact = np.full(count, float(np.float32(g)))
    zeros, ones = np.zeros(count), np.ones(count)
    cases = table(
        names,
        g_exact,
        foot=foot,
        height=height,
        x0=zeros,
        x1=x1,
        sigma_t=ones,
        tags=np.full(count, "wide"),
    )
    return with_reference(cases) if reference else cases


def table(
    phase, g, *, foot: Array, height: Array, x0: Array, x1: Array, sigma_t: Array, tags
) -> Cases:
    """Return columns as cases without values: lengths [m], extinction [1/m], names of
    phase functions, and tags.
    """
    names, words = (tuple(str(cell) for cell in column) for column in (phase, tags))
    return Cases(
        names,
        np.asarray(g),
        foot,
        height,
        x0,
        x1,
        sigma_t,
        None,
        words,
        None,
        None,
        None,
        COLUMNS,
        (),
    )


def with_reference(cases: Cases) -> Cases:
    """Return cases with J to about 1e-12, from the cache where it was computed before."""
    inputs = RayInputs(cases)
    return replace(
        cases,
        value=stored(
            inputs, lambda: integrate_cases(cases, rtol=1e-12, table=TABLE)[0], Array
        ).value,
    )


def case_row(cases: Cases, k: int) -> str:
    """Return case `k` as a line of CSV under `cases.header`, with digits enough to run it again."""
    if cases.rows:
        return ",".join(cases.rows[k])
    numbers = (cases.g, cases.foot, cases.height, cases.x0, cases.x1, cases.sigma_t)
    value = "" if cases.value is None else repr(float(cases.value[k]))
    words = [repr(float(column[k])) for column in numbers]
    return ",".join([cases.tag[k] if cases.tag else "", cases.phase[k], *words, value])


def _sobol(count: int, dimensions: int) -> Array:
    largest = 1 << 20
    if not 1 <= count <= largest:
        raise ValueError(f"count: got {count}, expected 1 to {largest} rays")
    exponent = max(1, int(np.ceil(np.log2(count))))  # a power of two keeps the points balanced
    return qmc.Sobol(dimensions, rng=np.random.default_rng(20101)).random_base2(exponent)[:count]


def _log(u: Array, low: float, high: float) -> Array:
    return low * (high / low) ** u


def _rounded(column: Array) -> Array:
    return np.asarray(column).astype(np.float32).astype(np.float64)
