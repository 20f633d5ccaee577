# SPDX-License-Identifier: BSD-3-Clause
"""Curves and primaries are those of their standards."""

import numpy as np
import pytest

from airlight.validation.engine.curves import (
    PRIMARIES,
    agx,
    blender_filmic,
    exponential,
    filmic,
    from_srgb,
    gamma,
    reinhard,
    srgb_in_8_bits,
    to_pq,
    to_srgb,
)
from airlight.validation.engine.transforms import VALUES
from airlight.validation.fog_model.view import EDGES


def test_pq_has_the_values_of_its_standard():
    """SMPTE ST 2084: 10 000 cd/m^2 is 1, 100 cd/m^2 is 0.508, black is 7e-7."""
    np.testing.assert_allclose(
        to_pq(np.array([0.0, 1.0, 100.0, 200.0]), 100.0), [0.0, 0.508078, 1.0, 1.0], atol=1e-6
    )


def test_primaries_keep_white_and_are_those_of_their_standards():
    """ITU-R BT.2087 has the matrix of Rec. 2020; the ACES documents have that of ACEScg,
    by Bradford's adaptation.
    """
    for matrix in PRIMARIES.values():
        np.testing.assert_allclose(matrix.sum(axis=1), 1, atol=1e-12)
    expected = [[0.6274, 0.3293, 0.0433], [0.0691, 0.9195, 0.0114], [0.0164, 0.0880, 0.8956]]
    np.testing.assert_allclose(PRIMARIES["Rec. 2020"], expected, atol=6e-5)
    expected = [
        [0.61310, 0.33952, 0.04738],
        [0.07019, 0.91635, 0.01345],
        [0.02062, 0.10957, 0.86981],
    ]
    np.testing.assert_allclose(PRIMARIES["ACEScg (AP1)"], expected, atol=1e-4)
    # SMPTE EG 432-1 has the same white; ACES 2065-1 has that of the ACES documents.
    expected = [[0.8225, 0.1775, 0.0], [0.0332, 0.9668, 0.0], [0.0171, 0.0724, 0.9105]]
    np.testing.assert_allclose(PRIMARIES["Display P3"], expected, atol=1e-4)
    expected = [[0.4397, 0.3830, 0.1774], [0.0898, 0.8134, 0.0968], [0.0175, 0.1115, 0.8709]]
    np.testing.assert_allclose(PRIMARIES["ACES 2065-1 (AP0)"], expected, atol=2e-4)


def test_decoding_undoes_the_srgb_curve():
    values = np.array([0.0, 0.001, 0.02, 0.5, 3.0])
    np.testing.assert_allclose(from_srgb(to_srgb(values)), values, rtol=1e-6)


@pytest.mark.parametrize(
    ("edge", "middle"), [("linear", 0.5), ("square", 0.25), ("smoothstep", 0.5)]
)
def test_edges_of_spots_go_from_dark_to_full(edge, middle):
    np.testing.assert_allclose(EDGES[edge](np.array([0.0, 0.5, 1.0])), [0, middle, 1])


def test_tone_curves_are_their_formulas_by_hand():
    x = np.array([-1.0, 0.0, 0.5, 1.0])
    np.testing.assert_allclose(reinhard(x), [-1.0, 0.0, 1 / 3, 0.5])
    np.testing.assert_allclose(exponential(x), [0.0, 0.0, 1 - 1 / np.sqrt(np.e), 1 - 1 / np.e])
    # 0.5 (1.255 + 0.03)/(0.5 (1.215 + 0.59) + 0.14) = 0.6425/1.0425, and 2.54/3.16 at 1.
    np.testing.assert_allclose(
        filmic(np.append(x, 1e6)), [0.0, 0.0, 0.6425 / 1.0425, 2.54 / 3.16, 1.0]
    )
    np.testing.assert_allclose(gamma(x, 2.0), [0.0, 0.0, np.sqrt(0.5), 1.0])
    # A quarter is 0.5371 of sRGB's curve, 136.96 of 255.
    np.testing.assert_allclose(
        255 * srgb_in_8_bits(np.array([-1.0, 0.25, 1.0, 9.0])), [0, 137, 255, 255]
    )
    for name, curve in (("x/(1 + x)", reinhard), ("ACES", filmic)):
        np.testing.assert_allclose(VALUES[f"{name}, sRGB"](x), to_srgb(curve(x)))


@pytest.mark.parametrize(("curve", "grey"), [(blender_filmic, 0.5), (agx, 0.461)])
def test_blenders_view_transforms_rise_over_their_stops_and_keep_greys(curve, grey):
    """They have ten stops below middle grey and 6.5 above it; Blender writes it as 0.50
    by Filmic and 0.46 by AgX.
    """
    np.testing.assert_allclose(curve(np.full((1, 3), 0.18)), grey, atol=5e-4)
    stops = np.linspace(-12.0, 8.0, 400)
    greys = curve(0.18 * 2.0 ** stops[:, None] * np.ones(3))
    np.testing.assert_allclose(greys, greys[:, :1] * np.ones(3), atol=1e-12)
    value = greys[:, 0]
    assert value[0] < 1e-4
    assert value[-1] == pytest.approx(1)
    assert (np.diff(value) >= -1e-12).all()
    inside = (stops > -8.0) & (stops < 6.4)
    assert (np.diff(value[inside]) > 0).all()


def test_agx_lessens_saturation_and_keeps_hues():
    red, green, blue = agx(np.diag([0.5, 0.5, 0.5]))
    for own, number in ((red, 0), (green, 1), (blue, 2)):
        assert own.argmax() == number
        assert own[number] > 0.4
