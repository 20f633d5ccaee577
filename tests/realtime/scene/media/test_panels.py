# SPDX-License-Identifier: BSD-3-Clause
"""A walk from facet to facet, with few panels between: against the least over all planes, summed over small steps."""

import drjit as dr
import numpy as np
import pytest

from realtime.numerics.array_types import aligned_array, array_types
from realtime.rays import ray_geometry
from realtime.scene.convex_bounds import mesh_bounds
from realtime.scene.lights import Light
from realtime.scene.media.bounded import BoundedMedia
from realtime.scene.media.light_paths import LightPaths
from realtime.scene.media.medium import Homogeneous
from realtime.scene.phase import Isotropic
from realtime.scene.read_media import make_bounded_medium
from tests.helpers.kernel_values import opaque, phase_of
from validation.scenes.meshes import gem, icosphere, placed, prism, rotation, scaled

TURN = rotation((0.3, 1.0, 0.2), 27.3)
CENTRE = np.array([0.1, 0.2, 0.3])
#: Triangles with many at two corners; quads and two faces of twelve edges.
SOLIDS = {
    "gem": gem(13, 5),
    "ball": scaled(icosphere(2), (0.97, 0.79, 1.13)),
    "column": prism(np.array([[np.cos(a), np.sin(a)] for a in np.arange(12) * np.pi / 6]), 1.9),
}


def bounds_of(name):
    vertices, faces = placed(SOLIDS[name], CENTRE, TURN)
    return mesh_bounds(name, vertices.astype(np.float32).astype(np.float64), faces)


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


def chords(name, light, g, *, sigma_t, precision):
    """Return rays through the medium with one light, and chords of it: a part of each for every other one."""
    types = array_types(precision)
    start, direction, low, high = lines_in(name, light)
    part = np.where(np.arange(len(low)) % 2, 0.37, 1.0) * (high - low)
    inner = opaque(Homogeneous((types.scalar(sigma_t),), types.color(1.0), phase_of("hg", g, types.scalar)))
    body = make_bounded_medium(inner, bounds_of(name), types)
    medium = BoundedMedia((dr.opaque(types.scalar, 0.0),), types.color(0.0), Isotropic(), (body,), clear=True)
    lamp = opaque(Light(types.vector(*(float(c) for c in light)), types.color(1.0)))
    origin, d = (types.vector(*(aligned_array(types.scalar, c) for c in v.T)) for v in (start + light, direction))
    ray = medium.lit(medium.rays(origin, d), lamp, ray_geometry(origin, d, lamp))
    return ray, aligned_array(types.scalar, low), aligned_array(types.scalar, low + part)


@pytest.mark.parametrize("name", ["gem", "column"])
def test_panels_against_a_sum_over_small_steps(variant, name):
    """What the leg leaves before the medium by the least of all planes; midpoints of 8000 steps."""
    light, sigma_t = np.array([1.7, 0.4, 2.9]), 1.3
    for precision, close in (("double", 1e-6), ("single", 2e-5)):
        rays, x0, x1 = chords(name, light, 0.6, sigma_t=sigma_t, precision=precision)
        panels = np.array(rays.airlight(x0, x1).x, dtype=np.float64)
        start, direction, low, _ = lines_in(name, light)
        begin, end = np.array(x0, dtype=np.float64), np.array(x1, dtype=np.float64)
        for ray in range(0, len(low), 41):
            steps = begin[ray] + (np.arange(8000) + 0.5) / 8000 * (end[ray] - begin[ray])
            v = start[ray] + steps[:, None] * direction[ray]
            r = np.linalg.norm(v, axis=1)
            enter, _ = least_of_all(name, light, v)
            depth = sigma_t * (steps - low[ray] + r - r / np.maximum(enter, 1))
            cosine = -(v @ direction[ray]) / r
            phase = (1 - 0.36) / (1.36 - 1.2 * cosine) ** 1.5
            expected = sigma_t * np.mean(phase * np.exp(-depth) / r**2) * (end[ray] - begin[ray])
            assert panels[ray] == pytest.approx(expected, rel=close)


@pytest.mark.parametrize("name", ["gem", "ball"])
def test_paths_to_points_by_a_walk_over_the_facets(variant, name):
    """Points anywhere: what a walk finds from facet to facet, and what all planes say of the same paths."""
    light, types = np.array([1.7, 0.4, 2.9]), array_types("double")
    body = make_bounded_medium(
        Homogeneous((types.scalar(1.0),), types.color(1.0), Isotropic()),
        bounds_of(name),
        types,
    )
    rng = np.random.default_rng(11)
    points = CENTRE + rng.normal(size=(4000, 3)) * 1.2
    start = types.vector(*(aligned_array(types.scalar, c) for c in (points - np.array(body.centre).ravel()).T))
    for w, toward in ((1.0, light - np.array(body.centre).ravel()), (0.0, light / np.linalg.norm(light))):
        towards = types.vector(*(float(c) for c in toward))
        paths = LightPaths(body, w, towards, start, dr.zeros(types.vector))
        zero = types.scalar(0)
        r = dr.norm(towards - start) if w else types.scalar(1)
        lengths = np.array(paths.length_at(zero, r)), np.array(paths.length(paths.envelopes_at(zero), zero, r))
        assert np.count_nonzero(lengths[1]) > 400
        assert lengths[0] == pytest.approx(lengths[1], abs=1e-12)
