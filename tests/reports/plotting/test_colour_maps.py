# SPDX-License-Identifier: BSD-3-Clause
import numpy as np
import pytest

from reports.plotting.colour_maps import NOT_FINITE, signed_colours, unsigned_colours

pytestmark = pytest.mark.slow  # colour-science is slow to import, and no map changes with the code
STRIDE = 8  # steps between compared colours: the rounding to 8 bits is then small beside their difference


def lab(colours):
    import colour

    return colour.XYZ_to_Lab(colour.sRGB_to_XYZ(colours / 255))


def ucs(colours):
    import colour

    return colour.XYZ_to_CAM16UCS(colour.sRGB_to_XYZ(colours / 255))


def arms(colours):
    """The colours from the middle to the blue end, and to the red end."""
    middle = len(colours) // 2
    return colours[middle::-1], colours[middle:]


def test_steps_of_the_signed_map_are_even_in_the_space_that_it_was_made_in():
    """On either arm within 5 %: rounding to 8 bits moves a colour by 0.2, two of them 0.3 of a step of 5.4."""
    for arm in arms(signed_colours()):
        steps = np.linalg.norm(np.diff(ucs(arm[::STRIDE]), axis=0), axis=1)
        np.testing.assert_allclose(steps, steps.mean(), rtol=0.05)


def test_signed_map_has_a_bright_middle_and_arms_of_one_length():
    colours = signed_colours()
    assert len(colours) == 255
    assert colours[127].min() >= 245
    lengths = [np.linalg.norm(np.diff(ucs(arm[::STRIDE]), axis=0), axis=1).sum() for arm in arms(colours)]
    assert lengths[0] == pytest.approx(lengths[1], rel=0.05)
    for arm in arms(colours):  # darker and darker towards the ends
        assert np.all(np.diff(lab(arm[::STRIDE])[:, 0]) < 0)
    assert colours[0, 2] > 2 * colours[0, 0]  # blue
    assert colours[-1, 0] > 2 * colours[-1, 2]  # red


@pytest.mark.parametrize("kind", ["Protanomaly", "Deuteranomaly", "Tritanomaly"])
@pytest.mark.filterwarnings("ignore:.*simulation of tritanomaly")
def test_signs_are_told_apart_without_one_kind_of_cones(kind):
    """Equal errors of either sign, from a tenth of the scale on, differ by five just noticeable differences or more."""
    import colour

    colours = signed_colours() / 255
    seen = np.clip(colours @ colour.matrix_cvd_Machado2009(kind, 1.0).T, 0, 1)
    first = 127 // 10
    down, up = lab(255 * seen[127 - first :: -1][: 127 - first]), lab(255 * seen[127 + first : 254])
    assert colour.delta_E(down, up, method="CIE 2000").min() > 5


def test_colour_of_what_is_not_finite_is_in_no_map():
    import colour

    hole = lab(np.array([NOT_FINITE], dtype=float))
    for colours in (signed_colours(), unsigned_colours("viridis"), unsigned_colours("magma")):
        seen = lab(colours.astype(float))
        assert colour.delta_E(seen, np.broadcast_to(hole, seen.shape), method="CIE 2000").min() > 15
