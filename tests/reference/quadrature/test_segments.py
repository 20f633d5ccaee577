# SPDX-License-Identifier: BSD-3-Clause
import mitsuba as mi
import numpy as np
import pytest

from reference.quadrature.fields import optical_depth
from reference.quadrature.segments import AMBIENT, camera_segments, scattering_range
from reference.scene.read import read_truth
from tests.helpers.scenes import bounded_medium, clear_scene, tiny_scene

FOG = {"type": "homogeneous", "id": "fog", "sigma_t": 0.11, "albedo": 0.6, "has_spectral_extinction": False}


def shapes(**extra):
    turn = mi.ScalarTransform4f().translate([-0.5, 0.1, 0.5]).rotate([0, 0, 1], 27.0).scale([0.31, 0.43, 0.37])
    return {
        "brick": bounded_medium({"type": "cube", "to_world": turn} | extra, (0.9, 0.5, 0.2), (0.9, 0.4, 0.3)),
        "pearl": bounded_medium(
            {"type": "sphere", "center": [0.6, 0.2, 0.6], "radius": 0.43} | extra, 1.3, (0.2, 0.5, 0.8)
        ),
    }


def truth_of(*, ambient=False, **changes):
    if not ambient:
        return read_truth(mi.load_dict(clear_scene(size=(9, 7), **shapes(), **changes)))
    scene = tiny_scene(size=(9, 7), fog=FOG, ball=None, floor=None)
    return read_truth(mi.load_dict(scene | shapes(exterior={"type": "ref", "id": "fog"}) | changes))


def inside(name, points):
    """Membership written once more, from the numbers in `shapes`."""
    if name == "pearl":
        return np.linalg.norm(points - [0.6, 0.2, 0.6], axis=-1) < 0.43
    angle = np.deg2rad(27.0)
    x, y, z = np.moveaxis(points - [-0.5, 0.1, 0.5], -1, 0)
    u, v = np.cos(angle) * x + np.sin(angle) * y, -np.sin(angle) * x + np.cos(angle) * y
    return (np.abs(u) < 0.31) & (np.abs(v) < 0.43) & (np.abs(z) < 0.37)


def midpoints(low, high, steps):
    return low + (high - low) * (np.arange(steps) + 0.5) / steps


@pytest.mark.parametrize("ambient", [False, True])
def test_optical_depth_is_the_sum_over_small_steps(variant, ambient):
    truth = truth_of(ambient=ambient)
    rng = np.random.default_rng(2)
    # Between points all around, and between points inside of the two bodies.
    start, end = rng.uniform(-1.2, 1.2, (40, 3)), rng.uniform(-1.2, 1.2, (40, 3))
    start[20:], end[20:] = start[20:] * 0.2 + [-0.5, 0.1, 0.5], end[20:] * 0.2 + [0.6, 0.2, 0.6]
    length = np.linalg.norm(end - start, axis=1)
    depth = optical_depth(truth, start, (end - start) / length[:, None], np.zeros(40), length)
    share = midpoints(0, 1, 20_000)[None, :, None]
    points = start[:, None] + share * (end - start)[:, None]
    where = {medium.name: inside(medium.name, points).mean(axis=1) * length for medium in truth.media}
    expected = (length - sum(where.values()))[:, None] * truth.medium.sigma_t
    expected += sum(where[medium.name][:, None] * medium.sigma_t for medium in truth.media)
    assert depth == pytest.approx(expected, abs=4 * 1.3 * 4 / 20_000)  # a step at each of up to four boundaries
    assert np.ptp(depth) > 0.3


@pytest.mark.parametrize("ambient", [False, True])
def test_segments_cover_what_scatters(variant, ambient):
    truth = truth_of(ambient=ambient)
    distance = np.full(63, 4.7)  # through the middle of the scene, in places inside of a body
    segments = camera_segments(truth, distance)
    x = midpoints(0, 4.7, 4000)
    points = truth.origin + x[None, :, None] * truth.direction[:, None]
    number = np.full(points.shape[:2], AMBIENT)
    for index, medium in enumerate(truth.media):
        number[inside(medium.name, points)] = index
    media = np.full_like(number, AMBIENT if ambient else -2)
    covered = np.zeros(number.shape, int)
    for start, end, medium in zip(segments.start, segments.end, segments.medium, strict=True):
        part = (x >= start[:, None]) & (x < end[:, None])
        covered += part
        media = np.where(part, medium[:, None], media)
    expected = number if ambient else np.where(number == AMBIENT, -2, number)
    assert np.mean(media != expected) < 1e-3  # a step at a boundary
    assert covered.max() == 1
    assert np.all(covered == 1) if ambient else np.mean(covered) < 0.5
    assert len(np.unique(media)) == 3
    low, high = scattering_range(segments)
    assert np.all(low[high > low] >= 0)
    assert np.array_equal(high > low, np.any(covered > 0, axis=1))
