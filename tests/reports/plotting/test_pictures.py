# SPDX-License-Identifier: BSD-3-Clause
"""Pictures by their formulas, and colours that any two eyes tell apart."""

from itertools import combinations

import numpy as np
import pytest

from airlight.realtime.methods.registry import METHODS
from airlight.reports.plotting.pictures import error_map, preview, tone_curve, tone_mapped
from airlight.reports.plotting.style import COLOURS, LEAST_DIFFERENCE, kernel_styles, report_styles

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
    [
        (0.0, 0),
        (0.001, 3),
        (0.0031308, 10),
        (0.18, 118),
        (0.5, 188),
        (1.0, 255),
        (7.0, 255),
        (-0.5, 0),
    ],
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
    """Reinhard et al. 2002, eq. 4, by hand for a grey pixel; the mean becomes 0.3, and
    nothing above white is cut.
    """
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
    """CIE Lab of a colour as seen without one kind of cones, by the matrices of Machado
    et al. 2009 on linear RGB.
    """
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

    seen = {
        name: lab(value, sight)
        for name, value in (COLOURS | {"reference": "#000000", "paper": "#ffffff"}).items()
    }
    for first, other in combinations(seen, 2):
        difference = float(colour.delta_E(seen[first], seen[other], method="CIE 2000"))
        assert difference > LEAST_DIFFERENCE, (first, other, sight, difference)


def looks(styles):
    return {
        (look["color"], look["marker"], look["fillstyle"], look["markeredgecolor"])
        for look in styles.values()
    }


@pytest.mark.claim("colours-of-figures")
def test_no_two_labels_of_a_chart_look_alike():
    """Every built-in method, a variant and its history, three methods of users, a shader
    and two images of engines.
    """
    users = ["mine.py:fog", "fog.glsl", "my_module:fog", "other:fog", "engine", "a"]
    shown = [(method, method) for method in (*METHODS, *users)]
    more = [
        ("ray-march", "ray-march (steps=9)"),
        ("ray-march+history", "history"),
        ("fog.glsl", "fog (x=1)"),
    ]
    styles = report_styles([*shown, *more])
    fog = {
        label: style
        for label, style in styles.items()
        if label not in ("cloud-octaves", "cloud-collectors")
    }
    # no chart has methods for fog and for clouds
    assert len(looks(fog)) == len(fog) == len(shown) + 1
    # A variant keeps the colour and the marker of its method; methods differ
    # in more than the filling.
    assert styles["ray-march"]["marker"] == styles["history"]["marker"]
    methods = [fog[label] for _, label in shown if label in fog]
    assert len({(look["color"], look["marker"]) for look in methods}) == len(methods)
    crowd = report_styles([(f"mine.py:{number}", f"{number}") for number in range(72)])
    assert len(looks(crowd)) == 72


def test_no_two_kernels_of_a_chart_look_alike():
    styles = kernel_styles(
        ["exact", "taylor", "taylor-printed", "quadrature", "mine:a", "mine:b", "mine:c"]
    )
    assert len(looks(styles)) == 7
    assert styles["quadrature"] == kernel_styles(["quadrature-32"])["quadrature-32"]
