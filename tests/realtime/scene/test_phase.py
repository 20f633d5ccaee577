# SPDX-License-Identifier: BSD-3-Clause
"""Phase functions, and droplets, on the side under test are those of the reference, which
has them by another route.
"""

import mitsuba as mi
import numpy as np
import pytest

from airlight.analytic.droplets import Droplets, Modified, optics
from airlight.analytic.phase import phase_from_words
from airlight.errors import InputError
from airlight.realtime.droplets import droplet_series, fraction_cut
from airlight.realtime.scene.phase import named_phase


def phases():
    yield "isotropic", 0.0, named_phase("isotropic")
    yield "rayleigh", 0.0, named_phase("rayleigh")
    yield "hazy", 0.0, named_phase("hazy")
    yield "murky", 0.0, named_phase("murky")
    for g in (-0.93, -0.2, 1e-4, 0.61, 0.97):
        yield "hg", g, named_phase("hg", g=g)


@pytest.mark.claim("phase-two-sides", tolerance="1e-5 relative: float32")
def test_against_the_analytic_side(variant):
    """The same functions written twice, in float32 here and in float64 there."""
    cosine = np.linspace(-1, 1, 2001).astype(np.float32)
    for name, g, phase in phases():
        value = np.broadcast_to(
            np.array(phase.evaluate(mi.Float(cosine)), dtype=np.float64), cosine.shape
        )
        expected = phase_from_words(name, g=g)(cosine.astype(np.float64))
        # float32: the sharpest lobe, g = 0.97, amplifies the rounding of 1 - g by 3/2 g/(1 - g).
        assert np.max(np.abs(value / expected - 1)) < 1e-5, (name, g)


@pytest.mark.claim(
    "phase-two-sides", tolerance="2e-5 relative in float32, 1e-6 in float64: a table's own error"
)
@pytest.mark.parametrize(
    "words",
    [
        "hg-draine:5",
        "hg-draine:50",
        "mie-modified:2:8",
        *(pytest.param(words, marks=pytest.mark.slow) for words in ("mie", "mie:2:8")),
    ],
)
def test_droplets_are_those_of_the_analytic_side(variant, words):
    angle = np.concatenate([np.linspace(0.1, np.pi, 700), np.geomspace(1e-4, 0.08, 80)])
    down = np.sin(0.5 * angle) ** 2
    for Float, tolerance in ((mi.Float32, 2e-5), (mi.Float64, 1e-6)):
        rounded = np.array(Float(down), dtype=np.float64)
        up = np.array(Float(np.cos(0.5 * angle) ** 2), dtype=np.float64)
        phase = named_phase(words, Float=Float)
        value = np.array(phase.evaluate_half(Float(rounded), Float(up)), dtype=np.float64)
        expected = phase_from_words(words).from_half(rounded, up)
        assert value == pytest.approx(expected, rel=tolerance, abs=1e-12)


@pytest.mark.claim(
    "droplets-two-sides", tolerance="1e-7 relative: series of Mie's theory leave out terms of 1e-8"
)
@pytest.mark.parametrize(
    "droplets", [pytest.param(Droplets(), marks=pytest.mark.slow), Droplets(2.0, 8.0)]
)
def test_two_routes_give_one_phase_function(droplets):
    series = droplet_series(droplets.effective_radius, droplets.gamma)
    reference = optics(droplets)
    angle = np.concatenate([np.linspace(0, np.pi, 901), np.geomspace(1e-5, 0.1, 50)])
    assert series.values(angle) == pytest.approx(reference.series(np.cos(angle)), rel=1e-7)
    assert series.efficiency == pytest.approx(reference.q_extinction, rel=1e-10)
    assert series.extinction_per_droplet * 1e-12 * droplets.number == pytest.approx(
        reference.extinction, rel=1e-10
    )
    assert series.fraction_below(np.deg2rad(5)) == pytest.approx(reference.fraction(0, 5), abs=1e-9)
    assert fraction_cut(droplets.effective_radius, droplets.gamma) == pytest.approx(
        Modified(reference).removed, abs=1e-9
    )


@pytest.mark.claim("droplets-refused")
@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((1.9,), "effective radius"),
        ((51.0,), "2 to 50"),
        ((6.0, 0.0), "gamma"),
        ((6.0, 2.0, 0.6), "wavelength"),
    ],
)
def test_impossible_droplets_are_refused(arguments, words):
    with pytest.raises(InputError, match=words):
        droplet_series(*arguments)
