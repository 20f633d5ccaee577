# SPDX-License-Identifier: BSD-3-Clause
"""Phase functions: mean 1, mean cosine, orientation, the same in mpmath, and refusals."""

import mitsuba as mi
import numpy as np
import pytest

from airlight.analytic.phase import (
    Hazy,
    HenyeyGreenstein,
    Isotropic,
    Murky,
    Rayleigh,
    Tabulated,
    phase_from_words,
)
from airlight.errors import InputError

SMOOTH = [
    Isotropic(),
    Rayleigh(),
    Hazy(),
    Murky(),
    HenyeyGreenstein(0.37),
    HenyeyGreenstein(-0.83),
]
TABLE = Tabulated([1.0, 0.3, 0.0, 2.5, 7.0, 11.0])
ALL = [*SMOOTH, TABLE]


def moment(phase, power):
    """Mean over the sphere of cos^power, by Gauss-Legendre between the kinks."""
    nodes, weights = np.polynomial.legendre.leggauss(200)
    ends = np.concatenate([[-1.0], phase.kinks, [1.0]])
    middle, half = 0.5 * (ends[1:] + ends[:-1]), 0.5 * (ends[1:] - ends[:-1])
    c = middle[:, None] + half[:, None] * nodes
    return 0.5 * np.sum(half[:, None] * weights * phase(c) * c**power)


@pytest.mark.claim("phase-mean-one", tolerance="1e-12")
@pytest.mark.parametrize("phase", ALL, ids=str)
def test_mean_over_the_sphere_is_one(phase):
    # rounding of 200 weights, of which a lobe counts few
    assert moment(phase, 0) == pytest.approx(1.0, abs=1e-12)


# Mean cosines: (1/2) int c up^n dc / (mean), with int of c ((1+c)/2)^n = 2 n / ((n+1)(n+2)).
@pytest.mark.claim("phase-forward", tolerance="1e-12")
@pytest.mark.parametrize(
    ("phase", "expected"),
    [
        (Isotropic(), 0.0),
        (Rayleigh(), 0.0),
        (Hazy(), 9 * 8 / 90 / 2),
        (Murky(), 50 * 32 / (33 * 34) / (83 / 33)),
        (HenyeyGreenstein(0.37), 0.37),
        (HenyeyGreenstein(-0.83), -0.83),
    ],
    ids=str,
)
def test_mean_cosine(phase, expected):
    assert moment(phase, 1) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("phase", ALL, ids=str)
def test_mpmath_twin_agrees(phase):
    from mpmath import workdps

    cosines = np.array([-1.0, -0.77, -0.2, 0.0, 0.13, 0.6, 0.99, 1.0])
    with workdps(30):
        expected = [float(phase.mp(c)) for c in cosines]
    np.testing.assert_allclose(phase(cosines), expected, rtol=1e-14, atol=1e-15)


def test_half_angle_form_keeps_the_digits_of_a_sharp_lobe():
    from mpmath import mpf, workdps

    phase = HenyeyGreenstein(1 - 2**-20)
    down = 3e-13  # from the cosine itself only three digits of this would be left
    with workdps(40):
        expected = float(phase.mp(1 - 2 * mpf(down)))
    assert float(phase.from_half(down, 1 - down)) == pytest.approx(expected, rel=1e-14)


@pytest.fixture
def scalar_mitsuba():
    before = mi.variant()
    mi.set_variant("scalar_rgb")
    yield mi
    if before is not None:
        mi.set_variant(before)


@pytest.mark.claim("phase-forward", tolerance="3e-6 relative: float32")
@pytest.mark.parametrize(
    ("plugin", "phase"),
    [
        ({"type": "isotropic"}, Isotropic()),
        ({"type": "rayleigh"}, Rayleigh()),
        ({"type": "hg", "g": 0.6}, HenyeyGreenstein(0.6)),
        ({"type": "hg", "g": -0.3}, HenyeyGreenstein(-0.3)),
        ({"type": "tabphase", "values": "1, 0.3, 0, 2.5, 7, 11"}, TABLE),
    ],
    ids=["isotropic", "rayleigh", "hg0.6", "hg-0.3", "tabphase"],
)
def test_forward_is_forward_in_mitsuba_too(scalar_mitsuba, plugin, phase):
    mi = scalar_mitsuba
    record = mi.MediumInteraction3f()
    record.sh_frame = mi.Frame3f([0, 0, 1])
    record.wi = mi.Vector3f(0, 0, -1)  # light travels along +z; wi points to where it came from
    context = mi.PhaseFunctionContext(mi.load_dict({"type": "independent"}))
    theirs = mi.load_dict(plugin)
    for c in (-1.0, -0.65, 0.1, 0.62, 1.0):
        _, density = theirs.eval_pdf(context, record, mi.Vector3f(np.sqrt(1 - c * c), 0, c))
        # float32 plugin: a few rounding errors of the lobe's steep side
        assert 4 * np.pi * density == pytest.approx(float(phase(c)), rel=3e-6, abs=1e-6)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"words": "haze"}, "did you mean 'hazy'"),
        ({"words": "hg", "g": 1.0}, "g is 1.0; expected a number between -1 and 1"),
        ({"words": "murky:0.2"}, "at most 0 numbers"),
        ({"words": "tabulated"}, "came without a table"),
        ({"words": "tabulated", "table": [1.0, -0.1]}, "value 1 .* is -0.1"),
        ({"words": "tabulated", "table": [0.0, 0.0]}, "at least one above 0"),
    ],
)
def test_refusals(arguments, message):
    with pytest.raises(InputError, match=message):
        phase_from_words(**arguments)
