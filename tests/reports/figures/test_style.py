# SPDX-License-Identifier: BSD-3-Clause
from itertools import combinations

import pytest

from realtime.methods.registry import FOG_METHODS, METHODS
from reports.plotting.style import (
    COLOURS,
    LEAST_DIFFERENCE,
    method_style,
)

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
