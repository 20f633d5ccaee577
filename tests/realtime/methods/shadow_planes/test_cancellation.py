# SPDX-License-Identifier: BSD-3-Clause
"""Claim: the default sum of shadow planes keeps its digits where differences of Gamma lose them.

The airlight of a ray that crosses shadow planes is sum_i Gamma(b_i) - Gamma(a_i). If each Gamma has
a relative rounding error eps, the sum has an error of about eps sum_i Gamma, many times the sum
itself where slats let little light through, or where a strong light close to the camera makes Gamma
large before the first shadow. The integrals J(a_i, b_i) of lit segments are positive, so their sum
keeps the digits of its terms. `shadow-planes` adds these, `shadow-planes-2006` Gamma plane by
plane. The reference has its lit intervals from exact geometry.
"""

import mitsuba as mi
import numpy as np
import pytest

from airlight.realtime.frame.image import render_frame
from airlight.realtime.scene.read_scene import read_scene
from airlight.reference.quadrature.image import quadrature_image
from airlight.reference.scene.read import read_reference
from airlight.validation.metrics.errors import FLOOR
from airlight.validation.scenes.meshes import box, joined, placed
from airlight.validation.scenes.parts import camera, fog, mitsuba_mesh, point_light
from airlight.validation.study.configuration import configuration, prepared

SIZE = (20, 16)


def slats():
    """Forty-one slats in fog, one behind the other, alternately upright and horizontal."""
    parts = []
    for number in range(41):
        upright = number % 2
        slat = box((0.023, 0.011, 1.7) if upright else (1.9, 0.011, 0.023))
        step = 0.037 * (number % 13) - 0.21
        place = (
            (step, -1.13 + 0.051 * number, 0.93)
            if upright
            else (0.07, -1.13 + 0.051 * number, 0.93 + step)
        )
        parts.append(placed(slat, place))
    return mi.load_dict(
        {
            "type": "scene",
            "fog": fog(0.37, (0.9, 0.8, 0.7)),
            "sensor": camera((0.03, -4.1, 0.83), (0.05, 0.0, 0.89), fov=37.0, size=SIZE),
            "light": point_light((0.2, 1.61, 1.07), [17.0] * 3),
            "occluders": mitsuba_mesh("occluders", joined(parts), (0.5, 0.4, 0.3)),
        }
    )


def airlight(scene, precision, method="shadow-planes", **parameters):
    renderer = prepared(read_scene(scene, precision), configuration(method, "exact", parameters))
    return np.asarray(render_frame(renderer).airlight, dtype=np.float64)


@pytest.mark.claim(
    "differences-of-gamma",
    tolerance=(
        "1e-4 of each pixel in float32; 1e-6 of 99 % in float64: float32 distances to surfaces"
    ),
)
def test_the_default_keeps_the_digits_that_gamma_loses(variant):
    built = slats()
    reference = quadrature_image(read_reference(built)).airlight

    def errors(image, expected=reference):
        return np.abs(image - expected) / np.maximum(reference, FLOOR * reference.mean())

    segments = airlight(built, "single")
    assert errors(segments).max() < 1e-4
    assert segments.min() >= -1e-5 * reference.mean()
    double = airlight(built, "double")
    assert np.quantile(errors(double), 0.99) < 1e-6
    published = "shadow-planes-2006"
    gamma = np.quantile(errors(airlight(built, "single", published, order="exact")), 0.99)
    plane_by_plane = errors(
        *(airlight(built, precision, published, order="none") for precision in ("single", "double"))
    )
    ours = np.quantile(errors(segments), 0.99)
    assert gamma > ours
    assert np.quantile(plane_by_plane, 0.99) > 20 * ours
