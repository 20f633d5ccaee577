# SPDX-License-Identifier: BSD-3-Clause
"""Pictures by their formulas, and colours that any two eyes tell apart."""

from itertools import combinations

import numpy as np
import pytest

from realtime.methods.registry import FOG_METHODS, METHODS
from reports.plotting.pictures import error_map, preview, tone_curve, tone_mapped
from reports.plotting.style import COLOURS, LEAST_DIFFERENCE, method_style

MAGENTA = (255, 0, 255)


def one_pixel(*values):
    return np.array([[values]], dtype=np.float64)


def relative(error, *, level=1.0):
    """The map of a pixel with a relative error in all channels."""
    reference = np.full((1, 1, 3), level)
    return error_map(reference, reference * (1 + error))[0, 0].astype(int)


@pytest.mark.parametrize(
    ("linear", "encoded"),
    # IEC 61966-2-1: 12.92 v below 0.0031308, 1.055 v^(1/2.4) - 0.055 above, times 255.
    [(0.0, 0), (0.001, 3), (0.0031308, 10), (0.18, 118), (0.5, 188), (1.0, 255), (7.0, 255), (-0.5, 0)],
)
def test_tone_mapping_is_srgb(linear, encoded):
    picture = tone_mapped(one_pixel(linear, linear, linear), 1.0)
    assert picture.dtype == np.uint8
    assert tuple(picture[0, 0]) == (encoded,) * 3


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_pixels_that_are_not_finite_are_magenta(bad):
    image = np.full((2, 2, 3), 0.5)
    image[0, 1, 2] = bad
    for picture in (tone_mapped(image, 1.0), error_map(image, np.full((2, 2, 3), 0.5))):
        assert tuple(picture[0, 1]) == MAGENTA
        assert all(tuple(picture[p]) != MAGENTA for p in [(0, 0), (1, 0), (1, 1)])
    assert tuple(error_map(np.full((2, 2, 3), 0.5), image)[0, 1]) == MAGENTA


def test_error_map_is_red_where_too_bright_and_blue_where_too_dark():
    bright, dark = relative(0.3), relative(-0.3)
    assert bright[0] > bright[2] + 50
    assert dark[2] > dark[0] + 50


def test_dark_pixels_are_measured_against_a_thousandth_of_the_mean():
    reference = np.full((1, 1000, 3), 1.0)
    reference[0, 0] = 0
    test = reference.copy()
    test[0, 0] = 1e-5  # 1e-2 of the floor of 0.999e-3
    np.testing.assert_allclose(error_map(reference, test)[0, 0].astype(int), relative(0.01), atol=2)


@pytest.mark.claim("previews-tone-curve")
def test_previews_follow_the_stated_curve():
    """Reinhard et al. 2002, eq. 4, by hand for a grey pixel; the mean becomes 0.3, and nothing above white is cut."""
    rng = np.random.default_rng(5)
    radiance = rng.exponential(3.0, (40, 50, 1)) * np.ones(3)
    curve = tone_curve(radiance)
    assert curve.exposure * radiance.mean() == pytest.approx(0.3)
    assert curve.white == pytest.approx(curve.exposure * np.percentile(radiance, 99.9))
    x = curve.exposure * radiance[7, 9, 0]
    linear = x * (1 + x / curve.white**2) / (1 + x)
    encoded = 1.055 * linear ** (1 / 2.4) - 0.055
    assert preview(radiance, curve)[7, 9, 0] == pytest.approx(255 * encoded, abs=0.6)
    white = np.full((1, 1, 3), curve.white / curve.exposure)
    assert preview(white, curve)[0, 0].tolist() == [255, 255, 255]
    assert f"{curve.exposure:.3g} times the radiance" in curve.words


_SIGHTS = ("normal", "Protanomaly", "Deuteranomaly", "Tritanomaly")


def lab(hexadecimal: str, sight: str):
    """CIE Lab of a colour as seen without one kind of cones, by the matrices of Machado et al. 2009 on linear RGB."""
    import colour
    import numpy as np

    linear = colour.cctf_decoding(colour.notation.HEX_to_RGB(hexadecimal), function="sRGB")
    if sight != "normal":
        linear = np.clip(colour.matrix_cvd_Machado2009(sight, 1.0) @ linear, 0, 1)
    return colour.XYZ_to_Lab(colour.RGB_to_XYZ(linear, "sRGB", apply_cctf_decoding=False))


@pytest.mark.slow
@pytest.mark.claim("colours-of-figures", tolerance="CIEDE2000 above 10")
@pytest.mark.parametrize("sight", _SIGHTS)
@pytest.mark.filterwarnings("ignore")  # colour-science warns of optional packages
def test_any_two_colours_differ_for_every_sight(sight):
    import colour

    seen = {name: lab(value, sight) for name, value in (COLOURS | {"reference": "#000000", "paper": "#ffffff"}).items()}
    for first, other in combinations(seen, 2):
        difference = float(colour.delta_E(seen[first], seen[other], method="CIE 2000"))
        assert difference > LEAST_DIFFERENCE, (first, other, sight, difference)


def test_one_colour_and_one_marker_for_each_method():
    # No chart has methods for fog and for clouds.
    clouds = [name for name in METHODS if name not in FOG_METHODS]
    for names in (clouds, FOG_METHODS):
        looks = [method_style(name) for name in names]
        assert len({look["color"] for look in looks}) == len({look["marker"] for look in looks}) == len(names)
    own = method_style("my_module:fog")
    assert own == method_style("my_module:fog")
    assert own["color"] not in {look["color"] for look in looks}
