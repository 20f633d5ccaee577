# SPDX-License-Identifier: BSD-3-Clause
"""The planes of a ray are found, sorted and added up in whatever order they come, and as the paper says."""

import itertools
from dataclasses import replace
from types import SimpleNamespace

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

import airlight.realtime.methods.shadow_planes.plane_table as module
from airlight.realtime.errors import InputError
from airlight.realtime.methods.shadow_planes.plane_table import NUMBER, index_planes, light_basis, planes_of_rays
from airlight.realtime.methods.shadow_planes.published_crossings import Buffer, _entry_key, sum_crossings
from airlight.realtime.methods.shadow_planes.sweep import ray_planes, sum_lit_intervals
from airlight.realtime.numerics.array_types import array_types
from airlight.realtime.numerics.functions import host_diamond_angle
from airlight.realtime.scene.mesh_adjacency import make_occluders
from tests.helpers.occluders import ALL

LIGHT = np.array([1.23, -0.87, 1.61])
CAMERA = np.array([-1.57, -1.93, 0.71])


def occluders_of(*names):
    """Return the occluders of meshes for tests."""
    return make_occluders([(name, *ALL[name]()) for name in names])


def index_of(occluders, light=LIGHT, camera=CAMERA, precision="single", *, order="exact"):
    """Return the index of the shadow planes of all components."""
    used = np.ones(len(occluders.closed), dtype=bool)
    light, camera = np.asarray(light, dtype=float), np.asarray(camera, dtype=float)
    return index_planes(occluders, light, camera, used=used, types=array_types(precision), order=order)


def bundles(count, *, spread, light=LIGHT, camera=CAMERA, seed=1):
    """Return unit directions in the frame of the light, (count, 3): in bundles of sixteen, `spread` wide.

    Three quarters lead to points in and behind the occluders, an eighth close by the light and an eighth away from it,
    where all azimuths meet.
    """
    rng = np.random.default_rng(seed)
    tiles = count // 16
    place = 0.4 * rng.normal(size=(tiles, 3))
    aim = light + rng.uniform(1, 3, (tiles, 1)) * (place - light) - camera
    axis = light - camera
    aim[::8] = axis + 0.01 * np.linalg.norm(axis) * rng.normal(size=aim[::8].shape)
    aim[1::8] = -axis + 0.01 * np.linalg.norm(axis) * rng.normal(size=aim[1::8].shape)
    ways = aim[:, None] / np.linalg.norm(aim, axis=1)[:, None, None]
    ways = (ways + spread * rng.uniform(-1, 1, (tiles, 16, 3))).reshape(-1, 3)
    axes = light_basis(np.asarray(light, dtype=float), np.asarray(camera, dtype=float)).axes
    return ways / np.linalg.norm(ways, axis=1)[:, None] @ axes.T


def plane_table(index):
    """Return ends (planes, 2, 3), first and last azimuth and gain of all planes, float64, without the padding."""
    ends = np.array(index.ends, dtype=np.float64).reshape(-1, 2, 3)
    spans = np.array(index.spans, dtype=np.float64).reshape(-1, 4)[: len(ends)]
    count = int(np.max(np.flatnonzero(np.any(ends != 0, axis=(1, 2))), initial=-1)) + 1
    return ends[:count], spans[:count, 0], spans[:count, 1], spans[:count, 2]


def crossings(index, ways):
    """Return where rays from the camera cross planes, (rays, planes), infinite where they do not, and the layers
    gained.

    The point of the ray is p a + q b, with a and b the ends of the edge and p, q >= 0, p + q >= 1 beyond the edge:
    three linear equations. A plane that is in the table twice, parted at azimuth 0, counts where its azimuths hold the
    ray's.
    """
    ends, first, last, gain = plane_table(index)
    a, b = ends[:, 0], ends[:, 1]
    camera = np.array([0.0, 0.0, np.array(index.distance).item()])
    normal = np.cross(a, b)
    with np.errstate(divide="ignore", invalid="ignore"):
        x = -(normal @ camera) / (ways @ normal.T)
        point = camera + x[..., None] * ways[:, None]
        scale = np.sum(normal * normal, axis=1)
        p = np.einsum("rpk,pk->rp", np.cross(point, b), normal) / scale
        q = np.einsum("rpk,pk->rp", np.cross(a, point), normal) / scale
        crossed = (x > 0) & (p >= 0) & (q >= 0) & (p + q > 1)
    azimuth = host_diamond_angle(*ways[:, :2].astype(np.float32).T)[:, None]
    twice = (first < 0) | (last > 4)
    again = np.isin(np.arange(len(ends)), np.flatnonzero(twice)) | np.array(
        [np.any(twice & np.all(ends == end, axis=(1, 2))) for end in ends], dtype=bool
    )
    crossed &= ~again | ((azimuth >= first) & (azimuth < last))
    return np.where(crossed, x, np.inf), gain


def lit_lengths(index, ways, end, *, weight=lambda x: x):
    """Return the sum of weight(x1) - weight(x0) over the lit segments up to `end`, and whether the light reaches it."""
    x, gain = crossings(index, ways)
    total, lit = np.zeros(len(ways)), np.zeros(len(ways), dtype=bool)
    for ray in range(len(ways)):
        order = np.argsort(x[ray])
        order = order[x[ray][order] < end[ray]]
        layers = np.array(index.layers).item() + np.concatenate([[0], np.cumsum(gain[order])])
        edges = np.concatenate([[0.0], x[ray][order], [end[ray]]])
        total[ray] = np.sum((weight(edges[1:]) - weight(edges[:-1]))[layers <= 0])
        lit[ray] = layers[-1] <= 0
    return total, lit


def listed_planes(index, rays):
    """Return by ray the numbers of the planes of its wedge that it may cross, in order."""
    entries = np.array(index.entries)
    places = zip(np.array(rays.first), np.array(rays.count))
    return [entries[first : first + count] & NUMBER for first, count in places]


def rays_of(index, ways, end=None):
    """Return the rays of a walk up to a distance `end`, without an end by default."""
    Float = type(index.distance)
    ray_end = Float(0) if end is None else index.distance / Float(np.asarray(end, dtype=np.float64))
    return ray_planes(index, *(Float(np.ascontiguousarray(part)) for part in ways.T), ray_end=ray_end)


# Wedges --------------------------------------------------------------------------------------------------------------


MESHES = ["torus", "crossing spheres", "open cylinder", "Moebius strip", "mixed winding", "boxes sharing an edge"]
ASIDE = {
    "aside": CAMERA,
    "behind the occluders": 1.3 * CAMERA - 0.9 * LIGHT,
    "near the light": LIGHT - (0.02, 0.01, 0.03),
}


@pytest.mark.claim("lists-hold-every-plane")
@pytest.mark.parametrize("camera", ASIDE)
@pytest.mark.parametrize("name", MESHES)
def test_wedges_hold_every_plane_that_a_ray_crosses(variant, name, camera):
    for spread, end in ((0.004, np.inf), (0.1, 3.1)):
        index = index_of(occluders_of(name), camera=ASIDE[camera])
        ways = bundles(960, spread=spread, camera=ASIDE[camera])
        crossed = crossings(index, ways)[0] < end
        listed = listed_planes(index, rays_of(index, ways, np.full(960, end)))
        # One ray in a thousand passes the end of an edge within rounding.
        missed = [set(np.flatnonzero(own).tolist()) - set(numbers.tolist()) for own, numbers in zip(crossed, listed)]
        assert sum(map(bool, missed)) <= 1
        assert all(len(set(numbers.tolist())) == len(numbers) for numbers in listed)
    assert crossed.any()


@pytest.mark.parametrize(
    ("name", "value", "words"), [("NUMBER", 2, "expected up to 3 of 31"), ("GAIN_ZERO", 1, "of up to 1 layers")]
)
def test_more_planes_or_layers_than_an_entry_holds_are_refused(variant, monkeypatch, name, value, words):
    """They would spill into the bits of their neighbours: shadows that nobody cast."""
    monkeypatch.setattr(module, name, value)
    with pytest.raises(InputError, match=words):
        index_of(occluders_of("box"))


def test_wedges_stay_in_the_index_whatever_the_azimuth(variant):
    """The azimuth about a light that is at the camera is no number: a load from wedge 2^32 - 1 ended the process."""
    index = index_of(occluders_of("torus"))
    azimuths = mi.Float([np.nan, np.inf, -np.inf, 1e30, -1e30, 0.5])
    way = (mi.Float([0.6] * 6), mi.Float([0.0] * 6), mi.Float([0.8] * 6))
    first, count = planes_of_rays(index, azimuths, way, mi.Float([0.0] * 6))
    assert np.all(np.array(first) + np.array(count) <= len(index.entries))


# Sums over lit segments ----------------------------------------------------------------------------------------------


@pytest.mark.claim("rays-notice-a-wrong-order", tolerance="1e-4: float32 at grazing angles")
@pytest.mark.parametrize("order", ["shuffled", "backwards", "two changed", "five at a time backwards"])
def test_rays_notice_an_order_that_is_wrong(variant, order):
    """And find their segments with a longer queue, or by selection."""
    index = index_of(occluders_of("torus", "open cylinder", "crossing spheres"))
    ways = bundles(960, spread=0.01)
    entries, start = np.array(index.entries), np.array(index.start).astype(int)
    rng = np.random.default_rng(9)
    changed = 0
    for first, behind in itertools.pairwise(start):
        places, count = np.arange(first, behind), behind - first
        if order == "shuffled":
            entries[places] = entries[rng.permutation(places)]
        elif order == "backwards":
            entries[places] = entries[places[::-1]]
        elif order == "two changed":
            if count > 3:
                entries[places[[0, -1]]] = entries[places[[-1, 0]]]
        elif count > 0:  # five at a time backwards: too much for a queue of two, nothing for one of eight
            entries[places] = entries[np.concatenate([places[k : k + 5][::-1] for k in range(0, count, 5)])]
        changed += count > 3
    bounds = dr.full(type(index.bounds), np.inf, dr.width(index.bounds))  # rays read all of their wedge
    expected, expected_lit = lit_lengths(index, ways, np.full(len(ways), np.inf), weight=lambda x: -np.exp(-x))
    changed_index = replace(index, entries=mi.UInt32(entries), bounds=bounds)
    assert changed > 20
    Float = type(index.distance)
    zero, end = dr.zeros(Float, len(ways)), dr.full(Float, np.inf, len(ways))
    rays = rays_of(changed_index, ways, np.full(len(ways), np.inf))
    total, lit = sum_lit_intervals(changed_index, rays, (zero, end), lambda a, b: dr.exp(-a) - dr.exp(-b), zero)
    # All but one ray in a thousand: one that passes a vertex or an edge within rounding may miss it or not.
    assert np.mean((np.abs(np.array(total) - expected) > 1e-4) | (np.array(lit) != expected_lit)) <= 1e-3


# The published orders, and the buffer of 8 bits ----------------------------------------------------------------------


def added_up(index, ways, end, *, order, buffer=None):
    """The sum of 1 - exp(-x) over the crossings."""
    Float = type(index.distance)
    gammas = (lambda plane, ray, x: 1 - dr.exp(-x)), (lambda x: 1 - dr.exp(-x))
    distance = Float(np.asarray(end, dtype=np.float64))
    total, lit = sum_crossings(index, rays_of(index, ways), distance, gammas, order=order, buffer=buffer)
    return np.array(total, dtype=np.float64), np.array(lit)


def most(wrong):
    """All but one ray in a hundred, which rounding takes past an edge, or to a plane before another."""
    return wrong.mean() < 0.01


def weight(x):
    return 1 - np.exp(-x)


@pytest.mark.claim("orders-of-the-planes")
def test_exact_order_is_right_where_shadows_overlap(variant):
    index = index_of(occluders_of("torus", "open cylinder", "crossing spheres"))
    ways = bundles(1920, spread=0.003)
    end = np.full(len(ways), 4.7)
    expected, lit = lit_lengths(index, ways, end, weight=weight)
    total, total_lit = added_up(index, ways, end, order="exact")
    # Two crossings can come in the wrong order within a wedge: that is counted, not repaired.
    wrong = (np.abs(total - expected) > 1e-4) | (total_lit != lit)
    assert wrong.mean() < 0.03


@pytest.mark.claim("orders-of-the-planes")
def test_without_an_order_every_plane_counts(variant):
    """The artefact of Fig. 4, by formula: Gamma at the surface if it is lit, and all planes with their signs."""
    index = index_of(occluders_of("torus", "crossing spheres"))
    ways = bundles(1920, spread=0.003)
    end = np.full(len(ways), 4.7)
    x, gain = crossings(index, ways)
    _, lit = lit_lengths(index, ways, end, weight=weight)
    crossed = x < end[:, None]
    of_planes = np.sum(np.where(crossed, gain * weight(np.where(crossed, x, 0)), 0), axis=1)
    expected = np.where(lit, weight(end), 0) + of_planes
    total, _ = added_up(index, ways, end, order="none")
    assert most(np.abs(total - expected) > 1e-4)
    assert np.max(np.abs(expected - lit_lengths(index, ways, end, weight=weight)[0])) > 0.1


@pytest.mark.claim("orders-of-the-planes")
def test_order_of_the_paper_is_by_the_stencil_rule(variant):
    """Plane by plane in NumPy, towards the camera by the cosine of the edge's middle."""
    index = index_of(occluders_of("torus", "crossing spheres"), precision="double", order="paper")
    ways = bundles(960, spread=0.003)
    end = np.full(len(ways), 4.7)
    x, gain = crossings(index, ways)
    cosine = np.array(index.spans).reshape(-1, 4)[: len(gain), 3]
    total, lit = added_up(index, ways, end, order="paper")
    expected = np.zeros(len(ways))
    for ray in range(len(ways)):
        order = np.argsort(cosine, kind="stable")
        order = order[x[ray][order] < end[ray]]
        stencil = np.array(index.layers).item() + gain[order].sum()
        expected[ray] = weight(end[ray]) if stencil <= 0 else 0
        for plane in order:
            if gain[plane] > 0:
                expected[ray] += weight(x[ray][plane]) if stencil == 1 else 0
            else:
                expected[ray] -= weight(x[ray][plane]) if stencil == 0 else 0
            stencil -= gain[plane]
    # Planes of one cosine come in either order.
    assert most(np.abs(total - expected) > 1e-9)
    assert np.any(lit)


@pytest.mark.claim("buffer-of-eight-bits")
def test_buffer_clamps_after_every_plane(variant):
    """Full at the surface, it forgets what is above, and the planes then take away too much."""
    index = index_of(occluders_of("sphere"))
    ways = bundles(960, spread=0.003)
    end = np.full(len(ways), 4.7)
    free, lit = added_up(index, ways, end, order="exact")
    clamped, _ = added_up(index, ways, end, order="exact", buffer=Buffer(0.5))
    rounded, _ = added_up(index, ways, end, order="exact", buffer=Buffer(3.0))
    shadowed = lit & (free < weight(4.7) - 1e-3)
    assert shadowed.any()
    # The sum never exceeds two: no clamping, three roundings by half a step.
    assert np.max(np.abs(rounded - free)) < 1.5 * 3 / 255 + 1e-5
    assert np.all(clamped[lit & ~shadowed] == pytest.approx(0.5))
    assert np.mean(free[shadowed] - clamped[shadowed]) > 0.05


def test_the_key_of_an_entry_is_the_angle_at_the_light_and_a_number_along_its_axis_too(variant):
    """The light is at 0, the camera at D on the z axis; the cosine of a ray along it may exceed 1 by rounding."""
    x, z, distance = np.array([2.0, 3.0, 1.5, 1.5]), np.array([-0.6, 0.3, 1.0, np.nextafter(np.float32(1), 2)]), 4.0
    index, ray = SimpleNamespace(distance=mi.Float(distance)), SimpleNamespace(z=mi.Float(z))
    entry = SimpleNamespace(distance=mi.Float(x))
    point = np.stack([x * np.sqrt(np.maximum(1 - z**2, 0)), distance + x * z])
    key = np.array(_entry_key(index, ray, entry, "paper"))
    np.testing.assert_allclose(key, -point[1] / np.linalg.norm(point, axis=0), rtol=2e-6)  # float32
    np.testing.assert_allclose(np.array(_entry_key(index, ray, entry, "exact")), distance / x, rtol=1e-6)
