# SPDX-License-Identifier: BSD-3-Clause
"""Claim: what a method states of its own error holds where rounding and tables are at
their worst, and not by far.
"""

from types import SimpleNamespace

import mitsuba as mi
import numpy as np
import pytest

from airlight.realtime.scene.read_scene import read_scene
from airlight.reference.quadrature.reference import reference_image
from airlight.reference.scene.read import read_reference
from airlight.validation.scenes.loading import load_scene
from airlight.validation.scenes.parts import camera, fog, point_light, tabulated_phase
from airlight.validation.study import stated_errors as bounds
from airlight.validation.study.configuration import configuration
from airlight.validation.study.reference import of_image
from airlight.validation.study.run import run
from airlight.validation.study.study import Cell, Measure
from tests.helpers.frames import render
from tests.helpers.scenes import bounded_medium

pytestmark = pytest.mark.usefixtures("variant", "own_cache")

HALF, SIGMA_T, ALBEDO, INTENSITY = np.array([0.31, 0.27, 0.23]), 13.7, 0.43, 5.3
LAMP = np.array([0.83, 0.71, 0.12])  # in the frame of the box, in vacuum before the edge [m]


def turned():
    return mi.ScalarTransform4f().rotate([-0.879, -0.121, 0.461], 59.11)


# through two faces, and along one of them
ACROSS, SKIMMING = (0.694, -0.712, 0.107), (0.99894, -0.0127, 0.0443)


def clipped_edge(along=ACROSS, fov=0.012):
    """A camera that looks over the edge of a box of fog, 0.66 m away: its pixels
    are some micrometres apart.
    """
    world, along = turned(), np.array(along) / np.linalg.norm(along)
    edge = HALF * (1, 1, 0)
    eye = [*(world @ mi.ScalarPoint3f(edge - 0.66 * along))]
    # The box is half the image.
    target = [*(world @ mi.ScalarPoint3f(edge - 1e-9 * along))]
    cube = {"type": "cube", "to_world": world.scale([float(half) for half in HALF])}
    return mi.load_dict(
        {
            "type": "scene",
            "box": bounded_medium(cube, SIGMA_T, (ALBEDO,) * 3),
            "light": point_light([*(world @ mi.ScalarPoint3f(LAMP))], (INTENSITY,) * 3),
            "camera": camera(eye, target, fov=fov, size=(16, 12), in_fog=False),
        }
    )


def chords(scene):
    """Return what of each ray lies in the box, by crossings with the
    triangles of it, in float64 [m].
    """
    reference = read_reference(scene)
    parameters = mi.traverse(scene.shapes()[0])
    vertices = np.array(parameters["vertex_positions"], dtype=np.float64).reshape(-1, 3)
    a, b, c = np.moveaxis(vertices[np.array(parameters["faces"]).reshape(-1, 3)], 1, 0)
    ends = []
    for direction in reference.direction:
        # Moeller and Trumbore 1997.
        p, q = np.cross(direction, c - a), np.cross(reference.origin - a, b - a)
        scale = 1 / np.sum((b - a) * p, axis=1)
        u, v = np.sum((reference.origin - a) * p, axis=1) * scale, (q @ direction) * scale
        t = np.sum((c - a) * q, axis=1) * scale
        hit = t[(u >= 0) & (v >= 0) & (u + v <= 1)]
        ends.append(np.ptp(hit) if len(hit) else 0.0)
    return np.array(ends)


def errors(scene, method, **parameters):
    """Return reference and the error of an image, (pixels, 3) each [W/(m^2 sr)]."""
    frame = np.asarray(render(scene, method, **parameters).airlight, dtype=np.float64).reshape(
        -1, 3
    )
    reference = reference_image(scene).airlight.reshape(-1, 3)
    return reference, np.abs(frame - reference)


@pytest.mark.claim(
    "sweep-bounds", tolerance="8 units of float32 of each end; a quarter of the bends of a table"
)
def test_a_chord_of_micrometres_errs_by_what_the_rounding_of_its_ends_is_worth():
    # random:3 has such pixels: a ray clips the edge of a medium, or a surface
    # stands just behind its bound.
    scene = clipped_edge()
    reference, error = errors(scene, "shadow-planes")
    lit = np.flatnonzero(reference[:, 0] > 0)
    assert len(lit) > 50
    # A third route says that the reference is right: over so short a chord all is constant.
    distance = np.linalg.norm(LAMP - HALF * (1, 1, 0))
    scattered = ALBEDO * SIGMA_T * INTENSITY / (4 * np.pi * distance**2)
    assert reference[lit, 0] == pytest.approx(chords(scene)[lit] * scattered, rel=2e-3)
    worth = bounds.worth_of_ends(scene, lit)
    # so what is promised of the pixel is no bound
    assert (error[lit] > bounds.EXACT * reference[lit]).any()
    assert (error[lit] <= worth).all()
    assert error[lit].max() > 0.05 * worth.max()
    # The most where rays leave, by the face that they meet at the smaller
    # angle, behind the whole chord.
    kept = np.exp(-SIGMA_T * chords(scene)[lit])
    assert worth[:, 0] == pytest.approx(
        1.1 * bounds.END * 0.66 / ACROSS[0] * scattered * kept, rel=2e-3
    )


def test_a_sweep_counts_no_pixel_whose_ends_are_rounded(monkeypatch):
    scene = clipped_edge()
    reference, read = of_image(reference_image(scene)), read_scene(scene)
    cell = Cell("edge", (16, 12), (), configuration("shadow-planes"), Measure("none"))
    assert run(cell, read, reference, whole=scene)[0].stated.outside == 0
    monkeypatch.setattr(bounds, "END", 0.1 * bounds.END)
    assert run(cell, read, reference, whole=scene)[0].stated.outside > 0


@pytest.mark.parametrize("name", ["street", "meadow", "smoke"])
def test_ends_have_their_worth_in_media_that_vary(name):
    """A pixel beyond the bound had its method refused there, with words on extinction."""
    scene = load_scene(name, (8, 6)).scene
    reference = read_reference(scene)
    distance = np.full(48, 5.0)
    places = bounds._equal_steps(reference, distance)
    assert ((places >= 0) & (places <= distance)).all()
    assert (np.diff(places, axis=0) >= 0).all()
    worth = bounds.worth_of_ends(scene, np.arange(48))
    assert worth.shape == (48, 3)
    assert np.isfinite(worth).all()
    # Little beside the light of a picture, but not nothing.
    assert 0 < worth.max() < 1e-2 * reference_image(scene).airlight.max()


@pytest.mark.claim(
    "sweep-bounds", tolerance="8 units of float32 of each end; a quarter of the bends of a table"
)
@pytest.mark.parametrize(
    ("words", "values"), [("murky", 129), ("murky", 513), ("hazy", 513), ("isotropic", 65)]
)
def test_the_kinks_of_a_table_are_worth_a_quarter_of_its_bends(words, values):
    scene = mi.load_dict(
        {
            "type": "scene",
            "fog": fog(0.0031, (0.9, 0.9, 0.9), tabulated_phase(words, values)),
            "light": point_light((0.7, 3.1, 0.4), (5.0, 4.0, 3.0)),
            "camera": camera((0.1, -2.3, 0.2), (0.6, 1.9, 0.3), fov=77.0, size=(24, 18)),
        }
    )
    reference, error = errors(scene, "unshadowed")
    stated = bounds.stated_bound(configuration("unshadowed"), read_scene(scene))
    assert stated is not None
    kinks = stated - bounds.EXACT
    relative = (error / reference).max()
    assert relative < 3e-6 + kinks
    if words == "murky":
        assert relative > 0.03 * kinks > 1e-5


def test_places_where_rounding_is_worst_are_at_equal_angles_about_a_light():
    """A lamp 3 m ahead and 4 m aside of the first ray, and behind the second, which never ends."""
    lamp = SimpleNamespace(position=np.array([4.0, 0.0, 3.0]))
    reference = SimpleNamespace(
        origin=np.zeros(3), direction=np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]])
    )
    places = bounds._angles_about(reference, lamp, np.array([6.0, np.inf]))
    angles = np.arctan2(places - [3.0, -3.0], 4.0)
    np.testing.assert_allclose(places[[0, -1], 0], [0.0, 6.0], atol=1e-12)
    np.testing.assert_allclose(
        np.diff(angles, axis=0)[:, 0], np.ptp(angles[:, 0]) / (len(places) - 1)
    )
    assert places[0, 1] == pytest.approx(0, abs=1e-12)
    assert np.isinf(places[-1, 1])  # no place is there
    assert np.isfinite(places[:-1]).all()
    assert (np.diff(places[:-1], axis=0) > 0).all()
