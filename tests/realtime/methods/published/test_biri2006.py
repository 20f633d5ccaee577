# SPDX-License-Identifier: BSD-3-Clause
"""The frame of Biri 2006: pyramids of spots, one buffer of 8 bits for surfaces and all
lights, Gamma at vertices.
"""

from functools import partial

import numpy as np
import pytest

import airlight.realtime.methods.published.biri2006.mesh as module
from airlight.errors import InputError
from airlight.realtime.frame.image import render_frame
from airlight.realtime.scene.read_scene import read_scene
from airlight.validation.scenes.loading import load_scene
from airlight.validation.scenes.parts import mitsuba_mesh
from airlight.validation.study.configuration import configuration, prepared
from tests.helpers import frames
from tests.helpers.frames import relative_rmse
from tests.helpers.height_fog import SUN, fog_xml
from tests.helpers.occluders import closed_sphere
from tests.helpers.scenes import bounded_medium, clear_scene, spot, tiny_scene


def frame(parameters):
    """A frame of the sphere under the spot."""
    scene = load_scene("sphere-spot", (64, 48)).scene
    return render_frame(
        prepared(read_scene(scene), configuration("shadow-planes-2006", None, parameters))
    )


def test_many_edges_are_the_cone_itself_and_fewer_are_darker_by_the_square(variant):
    """A regular polygon has the fraction 1 - (2 pi / N)^2 / 6 of its circle: four
    times the edges, a sixteenth.
    """
    whole = frame({"order": "exact"}).airlight
    missing = [
        1 - frame({"order": "exact", "cone": sides}).airlight.mean() / whole.mean()
        for sides in (16, 64, 4096)
    ]
    assert 0.01 < missing[0] < 0.05
    # The 3072 pixels and the sphere's shadow in the middle leave a fraction of it to chance.
    assert missing[0] / missing[1] == pytest.approx(16, rel=0.2)
    assert abs(missing[2]) < 1e-5
    many = frame({"order": "exact", "cone": 4096})
    # (2 pi / 4096)^2 / 6 = 4e-7 of the cone's section; rays along its edge see more of
    # that, and float32 adds 1e-5.
    np.testing.assert_allclose(many.airlight, whole, rtol=1e-3, atol=1e-4 * whole.mean())


@pytest.mark.claim(
    "cone-at-vertices", tolerance="second order in the logarithm of the ratio of rows"
)
def test_a_cone_is_meshed_from_the_light_to_the_camera(variant, monkeypatch):
    """Rows at equal ratios: the error falls as the square of the logarithm of the
    ratio, near the light too.
    """
    pixel = frame({"cone": 32, "order": "paper"}).airlight
    errors = []
    for rows, ratio in ((16, 1.5), (32, 1.5**0.5)):
        monkeypatch.setattr(module, "RATIO", ratio)
        vertex = frame(
            {"cone": 32, "order": "paper", "evaluation": "vertex", "rows": rows}
        ).airlight
        # The floor is two triangles: Gamma on it is another matter.
        hidden = np.abs(vertex - pixel)[: vertex.shape[0] // 3]
        errors.append(hidden.mean() / pixel.mean())
    assert 1e-5 < errors[1] < 0.4 * errors[0]


# Bounded media, and the buffer --------------------------------------------------------------------


render = partial(frames.render, method="shadow-planes-2006", precision="double")


def occluder(centre=(0.55, 0.2, 1.35), radius=0.28):
    vertices, faces = closed_sphere(3)
    placed = np.array(centre) + radius * np.asarray(vertices)
    return mitsuba_mesh("occluder", (placed, np.asarray(faces)), (0.5, 0.4, 0.3))


def fog(centre, radius, sigma=0.9):
    return bounded_medium(
        {"type": "sphere", "center": list(centre), "radius": radius}, sigma, (0.9, 0.4, 0.3)
    )


def stored(value, white):
    return np.round(np.clip(value, 0, white) * 255 / white) * white / 255


@pytest.mark.claim("buffer-of-eight-bits", tolerance="1e-9 of white: the same roundings")
def test_the_buffer_holds_surfaces_and_all_lights_pass_by_pass(variant):
    """Two lights over a floor that casts no shadow: four additions, each rounded and clamped."""
    white = 0.21
    lamps = {"lamp": tiny_scene()["lamp"]}
    lamps["other"] = {
        "type": "point",
        "position": [-1.1, 0.2, 1.1],
        "intensity": {"type": "rgb", "value": [2.0, 3.0, 1.0]},
    }
    floor = tiny_scene(ball=None)
    single = [render({**floor, "lamp": lamp}) for lamp in lamps.values()]
    expected = np.zeros_like(single[0].airlight)
    for frame in single:
        expected = stored(expected + frame.surface, white)
        expected = stored(expected + frame.airlight, white)
    frame = render({**floor, **lamps}, buffer="8bit", white=white)
    shown = frame.airlight + frame.surface
    # A value half way between two steps may fall on either side.
    assert np.mean(np.abs(shown - expected) > 1e-9 * white) < 2e-3
    steps = shown * 255 / white
    assert np.abs(steps - np.round(steps)).max() < 1e-6
    assert shown.max() <= white * (1 + 1e-9)
    free = sum(frame.airlight + frame.surface for frame in single)
    assert np.array_equal(shown.max() >= white * (1 - 1e-9), free.max() > white)


@pytest.mark.claim(
    "media-at-vertices", tolerance="errors fall to 0.4 with a quarter of the spacing"
)
def test_vertices_in_a_medium_converge_to_pixels(variant, monkeypatch):
    """One convex occluder before a sphere of fog."""
    scene = clear_scene(ball=fog((0.1, 0.0, 0.4), 0.8), occluder=occluder())
    pixel = render(scene, order="exact").airlight
    errors = []
    for rows, ratio in ((16, 1.5), (64, 1.5**0.25)):
        monkeypatch.setattr(module, "RATIO", ratio)
        vertex = render(scene, order="exact", evaluation="vertex", rows=rows).airlight
        # Three pixels see the occluder: Gamma on its own triangles is not that of finer planes.
        differences = np.sort(np.abs(vertex - pixel).max(axis=-1).ravel())[:-3]
        errors.append(np.sqrt(np.mean(differences**2)) / pixel.mean())
    # Kinks at the bounds, and vertices whose rays miss the medium, are of first order.
    assert 1e-3 < errors[1] < 0.4 * errors[0]
    assert errors[1] < 0.05


@pytest.mark.claim("media-at-vertices", tolerance="relative RMSE 1e-6: rounding")
def test_without_occluders_in_view_a_medium_is_its_end_less_its_entry(variant):
    """Two media, one before the other: Gamma at exit and entry, and what absorbs
    before as a factor of the ray.
    """
    media = {"ball": fog((0.1, -0.9, 0.7), 0.4), "behind": fog((0.2, 0.9, 0.8), 0.5, sigma=0.6)}
    scene = clear_scene(**media, occluder=occluder(centre=(0.3, 0.1, -30.0)))
    pixel = render(scene, kernel="taylor", media="paper").airlight
    vertex = render(scene, kernel="taylor", media="paper", evaluation="vertex").airlight
    assert relative_rmse(vertex, pixel) < 1e-6


def test_the_planes_of_a_soft_spot_are_meshed_as_far_as_those_of_a_hard_one(variant):
    """With rows for occluders alone Gamma stays what it is next to the light, a thousand times too
    large.
    """
    scene = tiny_scene(ball=occluder(), floor=None, lamp=spot(beam=11.0))
    pixel, vertex = (
        render(scene, order="exact", cone=32, evaluation=each).airlight
        for each in ("pixel", "vertex")
    )
    assert relative_rmse(vertex, pixel) < 1


def test_a_pyramid_is_refused_where_no_planes_are_drawn(variant):
    """The image would have the cone itself."""
    with pytest.raises(InputError, match="cone: got 32, and no planes are drawn"):
        frames.renderer(
            tiny_scene(ball=None, floor=None, lamp=spot()), "shadow-planes-2006", cone=32
        )


def test_vertices_need_lights_that_have_a_place(variant, tmp_path):
    """Their rows are counted from the light; height fog has no bounds and lets suns in."""
    (tmp_path / "fog.xml").write_text(fog_xml(SUN))
    scene = load_scene(str(tmp_path / "fog.xml")).scene
    with pytest.raises(InputError, match="evaluation=vertex: needs lights that have a place"):
        frames.renderer(scene, "shadow-planes-2006", evaluation="vertex")


def test_ambient_light_is_added_by_its_formula(variant):
    scene = tiny_scene(ball=occluder())
    without, with_it = (render(scene, ambient=each) for each in (0.0, 0.23))
    depth = 0.31 * np.minimum(without.distance, 1e30)
    expected = 0.23 * np.array([0.9, 0.8, 0.7]) * (1 - np.exp(-depth))[..., None]
    assert with_it.airlight - without.airlight == pytest.approx(expected, rel=1e-5)
