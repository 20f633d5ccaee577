# SPDX-License-Identifier: BSD-3-Clause

import numpy as np
import pytest

from analytic.errors import InputError
from validation.metrics.colour import ciede2000, colour_difference, delta_e_itp

# Sharma, Wu and Dalal 2005, table 1: L*, a*, b* of two colours and their CIEDE2000 to four digits.
# fmt: off
SHARMA = np.array([
    (50.0000, 2.6772, -79.7751, 50.0000, 0.0000, -82.7485, 2.0425),
    (50.0000, 3.1571, -77.2803, 50.0000, 0.0000, -82.7485, 2.8615),
    (50.0000, 2.8361, -74.0200, 50.0000, 0.0000, -82.7485, 3.4412),
    (50.0000, -1.3802, -84.2814, 50.0000, 0.0000, -82.7485, 1.0000),
    (50.0000, 0.0000, 0.0000, 50.0000, -1.0000, 2.0000, 2.3669),
    (50.0000, 2.4900, -0.0010, 50.0000, -2.4900, 0.0009, 7.1792),
    (50.0000, 2.4900, -0.0010, 50.0000, -2.4900, 0.0011, 7.2195),
    (50.0000, -0.0010, 2.4900, 50.0000, 0.0009, -2.4900, 4.8045),
    (50.0000, -0.0010, 2.4900, 50.0000, 0.0011, -2.4900, 4.7461),
    (50.0000, 2.5000, 0.0000, 50.0000, 0.0000, -2.5000, 4.3065),
    (50.0000, 2.5000, 0.0000, 73.0000, 25.0000, -18.0000, 27.1492),
    (50.0000, 2.5000, 0.0000, 61.0000, -5.0000, 29.0000, 22.8977),
    (50.0000, 2.5000, 0.0000, 56.0000, -27.0000, -3.0000, 31.9030),
    (50.0000, 2.5000, 0.0000, 58.0000, 24.0000, 15.0000, 19.4535),
    (60.2574, -34.0099, 36.2677, 60.4626, -34.1751, 39.4387, 1.2644),
    (63.0109, -31.0961, -5.8663, 62.8187, -29.7946, -4.0864, 1.2630),
    (61.2901, 3.7196, -5.3901, 61.4292, 2.2480, -4.9620, 1.8731),
    (22.7233, 20.0904, -46.6940, 23.0331, 14.9730, -42.5619, 2.0373),
    (36.4612, 47.8580, 18.3852, 36.2715, 50.5065, 21.2231, 1.4146),
    (90.8027, -2.0831, 1.4410, 91.1528, -1.6435, 0.0447, 1.4441),
    (90.9257, -0.5406, -0.9208, 88.6381, -0.8985, -0.7239, 1.5381),
    (6.7747, -0.2908, -2.4247, 5.8714, -0.0985, -2.2286, 0.6377),
    (2.0776, 0.0795, -1.1350, 0.9033, -0.0636, -0.5514, 0.9082),
])




def perceptual_quantiser(luminance):
    """Return the PQ value of a luminance [cd/m^2], SMPTE ST 2084 equation 5.1."""
    y = (luminance / 10000) ** (2610 / 16384)
    return ((3424 / 4096 + 2413 / 128 * y) / (1 + 2392 / 128 * y)) ** (2523 / 32)


def grey(value):
    return np.full((1, 1), value)


def test_published_pairs_of_ciede2000():
    difference = ciede2000(SHARMA[:, :3], SHARMA[:, 3:6])
    assert difference == pytest.approx(SHARMA[:, 6], abs=0.5e-4 + 1e-9)  # half a unit of the last digit




def test_published_pair_of_delta_e_itp():
    # The example of colour-science, BT.2124's own formula: dI = 0.00137, dT = 0.00172, dP = -0.00114.
    first = np.array([0.4885468072, -0.04739350675, 0.07475401302])
    second = np.array([0.4899203231, -0.04567508203, 0.07361341775])
    by_hand = 720 * np.sqrt(0.0013735159**2 + (0.00171842472 / 2) ** 2 + 0.00114059527**2)
    assert delta_e_itp(first, second) == pytest.approx(by_hand, rel=1e-8)
    assert by_hand == pytest.approx(1.42657228, rel=1e-8)


@pytest.mark.parametrize(("a", "b"), [(0.5, 0.6), (0.01, 0.02), (1.0, 4.0)])
def test_grey_differs_in_lightness_alone(a, b):
    difference = colour_difference(grey(a), grey(b), exposure=0.0)
    expected = 720 * abs(perceptual_quantiser(203 * a) - perceptual_quantiser(203 * b))
    # The rounded matrices give white a luminance that is wrong by 1e-4.
    assert difference.itp_mean == pytest.approx(expected, rel=2e-3)
    light = [116 * np.cbrt(min(v, 1.0)) - 16 for v in (a, b)]
    if a > 0.01:
        middle = sum(light) / 2
        weight = 1 + 0.015 * (middle - 50) ** 2 / np.sqrt(20 + (middle - 50) ** 2)
        assert difference.ciede2000_mean == pytest.approx(abs(light[1] - light[0]) / weight, rel=1e-3, abs=1e-9)


@pytest.mark.parametrize("factor", [1e-30, 1e30])
def test_the_default_exposure_takes_the_unit_out(factor):
    rng = np.random.default_rng(2)
    reference = rng.gamma(0.7, 1.0, (16, 12, 3))
    test = reference * rng.normal(1, 0.05, reference.shape)
    here, there = colour_difference(reference, test), colour_difference(factor * reference, factor * test)
    assert there.exposure == pytest.approx(here.exposure - np.log2(factor), abs=1e-9)
    for name in ("ciede2000_mean", "ciede2000_max", "itp_mean", "itp_max", "clipped", "clipped_itp"):
        assert getattr(there, name) == pytest.approx(getattr(here, name), rel=1e-9), name
    assert 0.9 / np.percentile(reference, 99) == pytest.approx(2.0**here.exposure, rel=1e-12)


@pytest.mark.parametrize(
    ("shapes", "message"),
    [
        (((3, 4, 3), (4, 3, 3)), "two sizes: the reference is 4 x 3"),
        (((3, 4, 2), (3, 4, 2)), "2 channels has no colour; wanted one"),
    ],
)
def test_refuses_what_does_not_fit(shapes, message):
    with pytest.raises(InputError, match=message):
        colour_difference(*map(np.ones, shapes))
