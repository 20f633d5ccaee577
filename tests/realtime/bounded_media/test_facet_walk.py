# SPDX-License-Identifier: BSD-3-Clause
"""Walks over the facets of a medium: against the least over all planes, which asks for no neighbours."""

import numpy as np
import pytest

from realtime.numerics.aligned import aligned_array
from realtime.scene.convex_bounds import mesh_bounds
from tests.helpers.kernel_values import opaque, vectors
from validation.scenes.parts import placed, rotation, scaled
from validation.scenes.solids import box, gem, icosphere, prism

TURN = rotation((0.3, 1.0, 0.2), 27.3)
CENTRE = np.array([0.1, 0.2, 0.3])
#: Triangles, triangles with many at two corners, quads, and two faces of twelve edges.
SOLIDS = {
    "icosphere": scaled(icosphere(2), (0.9, 0.7, 1.1)),
    "gem": gem(13, 5),
    "box": box((1.3, 1.1, 1.7)),
    "column": prism(np.array([[np.cos(a), np.sin(a)] for a in np.arange(12) * np.pi / 6]), 1.9),
}


def bounds_of(name):
    vertices, faces = placed(SOLIDS[name], CENTRE, TURN)
    return mesh_bounds(name, vertices.astype(np.float32).astype(np.float64), faces)


def seen_medium(name, light, precision="double"):
    from realtime.bounded_media.convex_clip import seen_from
    from realtime.numerics.array_types import array_types
    from realtime.scene.medium import Medium
    from realtime.scene.phase import named_phase
    from realtime.scene.read_media import make_bounded_medium

    types = array_types(precision)
    medium = Medium((types.scalar(1.0),), types.color(1.0), named_phase("isotropic"))
    bounded_medium = make_bounded_medium(medium, bounds_of(name), types)
    return seen_from(bounded_medium, opaque(types.vector(*(float(c) for c in light)))), types


def lines_in(name, light, *, count=400, seed=5):
    """Return lines from random places through the medium: v_0 and d, and where they are in it, by its planes."""
    rng = np.random.default_rng(seed)
    bounds = bounds_of(name)
    origin = CENTRE + rng.normal(size=(count, 3)) * 3
    target = CENTRE + rng.uniform(-0.4, 0.4, (count, 3))
    direction = (target - origin) / np.linalg.norm(target - origin, axis=1)[:, None]
    along, room = direction @ bounds.normals.T, bounds.offsets - origin @ bounds.normals.T
    low = np.where(along < 0, room / along, 0).max(axis=1)
    high = np.where(along > 0, room / along, np.inf).min(axis=1)
    kept = high > low + 1e-3
    return origin[kept] - light, direction[kept], low[kept], high[kept]


def least_of_all(name, light, v):
    """Return 1/f of the way in, over all planes that the light is outside of, and of the way out, over the others."""
    bounds = bounds_of(name)
    room = bounds.offsets - bounds.normals @ light
    u = v @ (bounds.normals / room[:, None]).T
    return u[..., room < 0].min(axis=-1, initial=np.inf), u[..., room > 0].max(axis=-1)


@pytest.mark.claim("bounded-media-of-methods", tolerance="1e-9 relative, in float32 2e-4")
@pytest.mark.parametrize(
    ("name", "light", "precision"),
    [
        *((name, (2.4, 1.9, 2.1), "double") for name in SOLIDS),
        ("box", (-1.9, 1.5, 0.9), "double"),
        ("gem", (2.4, 1.9, 2.1), "single"),
    ],
)
def test_a_walk_meets_the_least_of_all_planes_everywhere(variant, name, light, precision):
    import drjit as dr

    from realtime.bounded_media.facet_walk import entry_planes, first_entry, next_facet_change

    light = np.array(light)
    seen, types = seen_medium(name, light, precision)
    start, direction, low, high = lines_in(name, light)
    planes = entry_planes(seen)
    v0, d = (types.vector(*(aligned_array(types.scalar, c) for c in v.T)) for v in (start, direction))
    entry = first_entry(planes, v0, d, aligned_array(types.scalar, low))
    x, bends = low, 0
    for _ in range(60):
        if np.all(x == high):
            break
        until, beyond = next_facet_change(planes, v0, d, entry)
        dr.eval(until, entry, beyond)
        end = np.minimum(np.array(until, dtype=np.float64), high)
        for share in (0.01, 0.5, 0.99):
            at = x + share * (end - x)
            walked = np.array(entry.constant, dtype=np.float64) + np.array(entry.slope, dtype=np.float64) * at
            expected, _ = least_of_all(name, light, start + at[:, None] * direction)
            # Rounding of v, a few units in the last place of some metres, times g: large where the light is nearly in
            # the plane.
            assert walked == pytest.approx(expected, rel=2e-4 if precision == "single" else 1e-9)
        bends += np.sum(end < high)
        x, entry = end, dr.select(aligned_array(types.scalar, end) < aligned_array(types.scalar, high), beyond, entry)
    assert np.all(x == high)
    assert bends > 10


@pytest.mark.parametrize("name", SOLIDS)
def test_no_leg_to_a_segment_that_is_called_clear_meets_the_medium(variant, name):
    from realtime.bounded_media.facet_walk import clear_of, entry_planes, exit_planes

    light = np.array([1.7, 0.4, 2.9])
    seen, types = seen_medium(name, light)
    rng = np.random.default_rng(9)
    start = CENTRE + rng.normal(size=(900, 3)) * 1.7 - light
    direction = rng.normal(size=(900, 3))
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    length = rng.uniform(0.1, 1.5, 900)
    ends = aligned_array(types.scalar, np.zeros(900)), aligned_array(types.scalar, length)
    planes = entry_planes(seen), exit_planes(seen)
    clear = clear_of(planes, vectors(types, start), vectors(types, direction), *ends)
    clear = np.array(clear)
    x = np.linspace(0, 1, 51) * length[:, None]
    enter, leave = least_of_all(name, light, start[:, None] + x[..., None] * direction[:, None])
    meets = np.any(enter > np.maximum(leave, 1), axis=1)
    assert not np.any(clear & meets)
    # Most that pass are found to.
    assert np.mean(clear[~meets]) > 0.9
