# SPDX-License-Identifier: BSD-3-Clause
"""Shadow planes of a light at infinity, in bounded media.

Claim: they are as exact as those of a light with a place, whatever lies along the light. The reference casts its own
rays, bisects its lit intervals and shares nothing with this side.
"""

from typing import Any

import mitsuba as mi
import pytest

from tests.helpers.frames import read, relative_rmse, render
from tests.helpers.sunlit import plank, shaded, sun
from validation.estimates.quadrature import reference_image
from validation.scenes.meshes import box, placed
from validation.scenes.parts import mitsuba_mesh


def solid(sides, centre) -> Any:
    """Return a box that casts shadows."""
    return mitsuba_mesh("solid", placed(box(sides), centre), (0.4, 0.5, 0.3))


def scenes() -> dict[str, dict[str, Any]]:
    """Return sunlit scenes with occluders that are meshes, by what is hard about them."""
    beam = solid((0.5, 0.4, 0.3), (0.33, 0.27, 1.75))
    return {
        "two media": shaded(solid=beam, plank=plank(), other=solid((0.2, 0.3, 0.9), (-0.6, 0.1, 2.6))),
        # Four sides of the box are edge-on, and its upright edges are points as the light sees it.
        "parallel to edges": shaded(solid=beam, lamp=sun((0.0, 0.0, -1.0))),
    }


@pytest.mark.parametrize("name", ["two media", "parallel to edges"])
def test_against_the_reference(variant, name):
    scene = scenes()[name]
    reference = reference_image(mi.load_dict(scene)).airlight
    loaded = read(scene, "double")
    unshadowed = render(loaded).airlight
    assert relative_rmse(unshadowed, reference) > 0.02  # there is a shadow
    # The panels of two media leave 3e-6 without any shadow; the rest is the reference's rays, cast in float32.
    allowed = 1e-5 if name == "two media" else 2e-6
    assert relative_rmse(render(loaded, "shadow-planes").airlight, reference) < allowed
    assert relative_rmse(render(scene, "shadow-planes").airlight, reference) < 5e-5
