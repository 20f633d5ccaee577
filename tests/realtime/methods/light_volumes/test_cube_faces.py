# SPDX-License-Identifier: BSD-3-Clause
"""Which faces of a cube of shadow maps the rays of a tile pass, against points on such rays."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from realtime.methods.light_volumes.cube_faces import faces_passed

SEEDS = st.integers(0, 2**32 - 1)


def found_for(directions, end, away):
    """Return the numbers of the faces found for one tile."""
    import drjit as dr
    import mitsuba as mi

    corners = [mi.Vector3f(*(float(c) for c in corner)) for corner in directions]
    middle = dr.normalize(sum(corners[1:], corners[0]))
    bits = int(faces_passed(corners, middle, mi.Float(float(end)), mi.Vector3f(*(float(c) for c in away)))[0])
    return {face for face in range(6) if bits >> face & 1}


def faces_of(points):
    """Return the face that each point is seen through from the origin: its largest coordinate and the sign of that."""
    axis = np.argmax(np.abs(points), axis=-1)
    value = np.take_along_axis(points, axis[..., None], axis=-1)[..., 0]
    return 2 * axis + (value < 0)


def tile(random, width):
    """Return the unit directions at the corners of a tile, some along the planes between faces."""
    middle, across, up = random.normal(size=(3, 3))
    if random.random() < 0.3:
        middle = np.round(middle)
    corners = np.array([middle + width * (a * across + b * up) for a in (0, 1) for b in (0, 1)])
    return corners / np.maximum(np.linalg.norm(corners, axis=1, keepdims=True), 1e-30)


@settings(deadline=None, max_examples=300)
@given(seed=SEEDS, width=st.sampled_from([0.0, 1e-3, 0.05, 1.0]), end=st.sampled_from([0.01, 1.0, 30.0, np.inf]))
def test_no_face_with_a_point_of_a_ray_is_left_out(variant, seed, width, end):
    random = np.random.default_rng(seed)
    corners, away = tile(random, width), random.normal(size=3) * 10.0 ** random.uniform(-2, 1)
    if random.random() < 0.3:
        away = np.round(away)
    weights = random.dirichlet(np.full(4, 0.5), size=50)
    rays = weights @ corners
    length = np.linalg.norm(rays, axis=1, keepdims=True)
    rays = rays[length[:, 0] > 1e-6] / length[length[:, 0] > 1e-6]
    longest = min(end, 1e4)
    x = np.concatenate([longest * random.uniform(size=40), longest * 10.0 ** random.uniform(-6, 0, size=40), [longest]])
    points = away + rays[:, None] * x[:, None]
    # A point that rounding alone decides about may belong to either face.
    largest = np.sort(np.abs(points), axis=-1)
    clear = largest[..., 2] - largest[..., 1] > 1e-5 * (np.linalg.norm(away) + x)
    assert set(faces_of(points)[clear].tolist()) <= found_for(corners, end, away)
