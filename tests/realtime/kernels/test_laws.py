# SPDX-License-Identifier: BSD-3-Clause
"""Claim: the default kernel obeys the laws that follow from J = int_{x0}^{x1} exp(-sigma_t
(x + r)) p(cos) / r^2 dx.

With r^2 = h^2 + (x - t)^2, t the foot:

* units: J(c lengths, sigma_t / c) = J / c. For c a power of two no digit changes in floating point:
  what differs comes from a constant with a unit, an epsilon against division by zero for instance.
* additivity: J(x0, m) + J(m, x1) = J(x0, x1).
* camera: moving it back by d adds the way d: J(t + d, x0 + d, x1 + d) =
  exp(-sigma_t d) J(t, x0, x1).
* reversal: in a vacuum a ray may be looked along from its other end: J(t, x0, x1; p(cos)) = J(x0 +
  x1 - t, x0, x1; p(-cos)).
* phase: J is linear in p, and 'hg' with g = 0 and a table of ones are isotropic.
* swap of camera and light, which no single ray obeys: the light scattered at a point P reaches the
  camera C from the light L with exp(-sigma_t (|CP| + |PL|)) p(cos) / (|CP|^2 |PL|^2) per volume,
  symmetric in C and L. With dV = |CP|^2 dx dw, over all directions w in which C sees a body B,

      int J_{C,L}(w) dw = int_B exp(-sigma_t (|CP| + |PL|)) p(cos) / (|CP|^2 |PL|^2) dV = int J_{L,C}(w) dw.
"""

from dataclasses import replace

import numpy as np
import pytest

from airlight.realtime.kernels.exact import exact
from airlight.validation.kernels.cases import evaluate_cases
from airlight.validation.kernels.rays import hard_rays, table, wide_rays
from tests.helpers.kernel_values import take

pytestmark = pytest.mark.usefixtures("variant")

#: Rounding of exponents up to 60, twice, and of sums; what the nodes of float64 leave, twice.
LIMITS = {"single": 2e-5, "double": 2e-10}
LENGTHS = ("foot", "height", "x0", "x1")
# lengths times 1024 have 1/r^2 a millionth: of what is dimmer float32 flushes terms below 1e-38
SMALL = 1e-26


@pytest.fixture(scope="module", params=["isotropic", "hg", "droplets"])
def rays(request):
    if request.param == "droplets":
        return wide_rays(256, "hg-draine:12", reference=False)
    rays = hard_rays(2048)
    return take(rays, np.asarray(rays.phase) == request.param)


@pytest.fixture(params=LIMITS)
def precision(request):
    return request.param


def J(cases, precision, **options):
    return evaluate_cases(cases, exact, precision, **options)


def largest_difference(first, second, rows=30):
    size = np.maximum(np.abs(first), np.abs(second))
    large = size > SMALL
    assert large.sum() >= rows
    return np.max(np.abs(first - second)[large] / size[large])


def representable(precision, *sums):
    """Return where each sum, sum = d + part, is a number of this precision:
    then moving loses no digit.
    """
    dtype = np.float32 if precision == "single" else np.float64
    exactly = np.ones(len(sums[0][0]), dtype=bool)
    for total, d, part in sums:
        with np.errstate(invalid="ignore"):
            back = (total - d == part) & (total - part == d)
        exactly &= (back | np.isinf(total)) & (total.astype(dtype) == total)
    return exactly


@pytest.mark.claim(
    "laws-of-the-integral",
    tolerance="2e-5 in float32, 2e-10 in float64; units and intensity exactly",
)
def test_units_and_intensity_change_no_digit(rays, precision):
    scaled = replace(
        rays, sigma_t=rays.sigma_t / 1024, **{name: 1024 * getattr(rays, name) for name in LENGTHS}
    )
    assert largest_difference(1024 * J(scaled, precision), J(rays, precision)) == 0
    np.testing.assert_array_equal(J(rays, precision, intensity=37.0), J(rays, precision))


@pytest.mark.claim("laws-of-the-integral")
def test_a_camera_moves_back_along_its_ray(rays, precision):
    d = 2.0 ** np.floor(np.log2(np.hypot(rays.foot, rays.height)) - 1)
    moved = replace(rays, foot=rays.foot + d, x0=rays.x0 + d, x1=rays.x1 + d)
    kept = representable(
        precision, (moved.foot, d, rays.foot), (moved.x0, d, rays.x0), (moved.x1, d, rays.x1)
    )
    expected = J(rays, precision) * np.exp(-rays.sigma_t * d)
    assert largest_difference(J(take(moved, kept), precision), expected[kept]) < LIMITS[precision]


@pytest.mark.claim("laws-of-the-integral")
def test_camera_and_light_may_be_swapped(precision):
    """Over spheres of radius R on the line from camera to light, b from the one and e from
    the other, on either side.

    At the angle asin(R sin(u)/b) to the axis a ray is inside between b cos - R cos u and b cos + R
    cos u, so that a Gauss-Legendre rule in u converges at once. For a body that both see alike the
    law would prove nothing: b != e.
    """
    spheres = np.array(
        [
            (2.0, 3.25, 1.25, 0.5, 1),
            (6.0, 2.5, 2.0, 0.0, 1),
            (2.0, 4.5, 1.0, 0.75, -1),
            (8.0, 3.0, 2.5, 0.25, -1),
        ]
    )
    phases = (("isotropic", 0.0), ("rayleigh", 0.0), ("hg", 0.5), ("hg", -0.5))

    def seen(b, e, R, sigma_t, side):
        nodes, weights = np.polynomial.legendre.leggauss(64)
        u, weights = 0.25 * np.pi * (nodes + 1), 0.25 * np.pi * weights
        sine = R / b * np.sin(u)
        cosine = np.sqrt(1 - sine**2)
        light = b + side * e  # where it lies on the axis
        # dw = 2 pi sin d(angle), d(angle) = (R/b) cos u / cos du
        weights = 2 * np.pi * weights * sine * (R / b) * np.cos(u) / cosine
        ends = b * cosine - R * np.cos(u), b * cosine + R * np.cos(u)
        shape = (len(phases), len(spheres), len(u))
        columns = (light * cosine, np.abs(light) * sine, *ends, sigma_t)
        foot, height, x0, x1, sigma_t = (
            np.broadcast_to(column, shape).ravel() for column in columns
        )
        phase, g = (np.repeat(column, shape[1] * shape[2]) for column in zip(*phases))
        tags = np.full(len(foot), "swap")
        cases = table(phase, g, foot=foot, height=height, x0=x0, x1=x1, sigma_t=sigma_t, tags=tags)
        return np.sum(weights * J(cases, precision).reshape(shape), axis=-1)

    b, e, *others = spheres.T[:, None, :, None]
    assert seen(b, e, *others) == pytest.approx(seen(e, b, *others), rel=LIMITS[precision] / 10)
