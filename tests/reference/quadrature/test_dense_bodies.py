# SPDX-License-Identifier: BSD-3-Clause
"""Light in the skin of a dense body, beside a plain sum that resolves it."""

import mitsuba as mi
import numpy as np
import pytest

from airlight.reference.quadrature.reference import reference_image
from airlight.reference.scene.read import read_reference
from tests.helpers.scenes import dense_box


def crossings(bounds, place, way):
    """Return where lines enter and leave a convex body, (n,) each."""
    slope = way @ bounds.normal.T
    at = (bounds.offset - place @ bounds.normal.T) / slope
    enter = np.where(slope < 0, at, -np.inf).max(axis=1)
    return enter, np.where(slope > 0, at, np.inf).min(axis=1)


def plain_sum(read, ray, edges):
    """Return the airlight of a ray by midpoints between edges, from the airlight equation."""
    fog, body, lamp = read.medium, read.media[0], read.lights[0]
    thin, dense = float(fog.sigma_t[0]), float(body.sigma_t[0])
    way = read.direction[ray]
    enter, leave = (each[0] for each in crossings(body.bounds, read.origin[None], way[None]))
    x, dx = 0.5 * (edges[1:] + edges[:-1]), np.diff(edges)
    place = read.origin + x[:, None] * way
    towards = lamp.position - place
    r = np.linalg.norm(towards, axis=1)
    begin, end = crossings(body.bounds, place, towards / r[:, None])
    in_body = np.maximum(np.minimum(end, r) - np.maximum(begin, 0), 0)
    to_camera = np.clip(x - enter, 0, max(leave - enter, 0))
    tau = thin * (r - in_body + x - to_camera) + dense * (in_body + to_camera)
    inside = ((x > enter) & (x < leave))[:, None]
    scattered = np.where(inside, dense * body.albedo, thin * fog.albedo)
    light = (np.exp(-tau) / r**2 * dx)[:, None] * scattered
    return light.sum(axis=0) * lamp.intensity / (4 * np.pi), enter


@pytest.mark.claim("dense-bodies", tolerance="1e-5, midpoints of a 500th of a mean free path")
@pytest.mark.parametrize("sigma_t", [400.0, 1e4, 1e6])
def test_light_in_the_skin_of_a_dense_body_is_not_missed(variant, sigma_t):
    """With 1e4 a third of the light of this ray was missed, with a stated error of 1e-14."""
    # The ray of row 1, column 1 meets the lit side of the box.
    loaded, ray = mi.load_dict(dense_box(sigma_t, (8, 6))), 9
    read = read_reference(loaded)
    _, enter = plain_sum(read, ray, np.array([0.0, 1.0]))
    # Before the body, and 40 mean free paths into it; nothing comes back from behind that.
    edges = np.r_[np.linspace(0, enter, 20_000)[:-1], enter + np.linspace(0, 40, 20_000) / sigma_t]
    expected, _ = plain_sum(read, ray, edges)
    image = reference_image(loaded)
    found = image.airlight.reshape(-1, 3)[ray]
    np.testing.assert_allclose(found, expected, rtol=1e-5)
    assert np.all(image.airlight_error.reshape(-1, 3)[ray] < 1e-9 * found)
