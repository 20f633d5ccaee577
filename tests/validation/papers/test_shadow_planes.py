# SPDX-License-Identifier: BSD-3-Clause
"""Claim: the figures of Biri's planes are errors against the quadrature, steps of a display
and lit lengths of rays.
"""

import mitsuba as mi
import numpy as np
import pytest

from airlight.validation.papers import shadow_planes
from airlight.validation.papers.shadow_planes import _lit_length, drawn, stencil


def test_lit_lengths_by_hand():
    assert _lit_length([(0.2, 0.5), (0.4, 0.7)]) == pytest.approx(0.5)
    assert _lit_length([(0.1, 0.3), (0.9, 1.2), (1.1, 1.3)]) == pytest.approx(0.7)
    assert _lit_length([(0.0, 1.3)]) == 0


def test_a_stencil_of_shadows_apart_and_of_a_surface_in_a_shadow_by_hand():
    shadows = [(0.1, 0.3), (0.6, 0.8)]
    assert drawn(shadows, -1) == pytest.approx(0.6)
    # By stage 5 the stencil is below 0 from each plane that faces away to the next:
    # no other plane is drawn.
    assert drawn(shadows, 1) == pytest.approx(1 - 0.8 - 0.3)
    behind = [(0.4, 0.5), (0.9, 1.2)]  # the surface lies in a shadow
    assert drawn(behind, -1) == pytest.approx(0.8)


def test_the_stencil_of_section_5_1_5_is_right_and_that_of_stage_5_is_not(monkeypatch):
    monkeypatch.setattr(shadow_planes, "_RAYS", 400)
    figures = stencil()
    assert figures["section 5.1.5"] == 1
    assert 0.05 < figures["stage 5"] < 0.7  # rays with one shadow, a fifth, and some more


def test_pixels_near_the_lamp_are_those_within_ten_degrees(variant):
    scene = mi.load_dict(shadow_planes._lamp_in_fog(0.3))
    shadow_planes.resize(scene, (64, 48))
    near = shadow_planes._close_to_lamp(scene)
    # The lamp stands 3 degrees above the middle: a circle of 10 degrees where
    # the view has 58.3 across.
    scale = 32 / np.tan(np.radians(58.3 / 2))
    assert near.sum() == pytest.approx(np.pi * (scale * np.tan(np.radians(10))) ** 2, rel=0.1)
    row, column = np.nonzero(near)
    assert abs(column.mean() - 31.5) < 2
    assert row.mean() < 23.5
