# SPDX-License-Identifier: BSD-3-Clause
"""The pyramid of planes that bounds a spot is the cone in the limit of many edges."""

import numpy as np
import pytest

import realtime.methods.shadow_planes.published_mesh as module
from realtime.frame.renderer import render_frame
from realtime.scene.read_scene import read_scene
from validation.scenes.loading import load_scene
from validation.study.configuration import configuration, prepared


def frame(parameters):
    """A frame of the sphere under the spot."""
    scene = load_scene("sphere-spot", (64, 48)).scene
    return render_frame(prepared(read_scene(scene), configuration("shadow-planes", None, parameters)))


def test_many_edges_are_the_cone_itself_and_fewer_are_darker_by_the_square(variant):
    """A regular polygon has the share 1 - (2 pi / N)^2 / 6 of its circle: four times the edges, a sixteenth missing."""
    whole = frame({}).airlight
    missing = [1 - frame({"cone": sides}).airlight.mean() / whole.mean() for sides in (16, 64, 4096)]
    assert 0.01 < missing[0] < 0.05
    # The 3072 pixels and the sphere's shadow in the middle leave a share of it to chance.
    assert missing[0] / missing[1] == pytest.approx(16, rel=0.2)
    assert abs(missing[2]) < 1e-5
    many = frame({"cone": 4096})
    # (2 pi / 4096)^2 / 6 = 4e-7 of the cone's section; rays along its edge see more of that, and float32 adds 1e-5.
    np.testing.assert_allclose(many.airlight, whole, rtol=1e-3, atol=1e-4 * whole.mean())


@pytest.mark.claim("cone-at-vertices", tolerance="second order in the logarithm of the ratio of rows")
def test_a_cone_is_meshed_from_the_light_to_the_camera(variant, monkeypatch):
    """Rows at equal ratios: the error falls as the square of the logarithm of the ratio, near the light too."""
    pixel = frame({"cone": 32, "order": "paper"}).airlight
    errors = []
    for rows, ratio in ((16, 1.5), (32, 1.5**0.5)):
        monkeypatch.setattr(module, "RATIO", ratio)
        vertex = frame({"cone": 32, "order": "paper", "evaluation": "vertex", "rows": rows}).airlight
        # The floor is two triangles: Gamma on it is another matter.
        hidden = np.abs(vertex - pixel)[: vertex.shape[0] // 3]
        errors.append(hidden.mean() / pixel.mean())
    assert 1e-5 < errors[1] < 0.4 * errors[0]
