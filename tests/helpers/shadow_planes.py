# SPDX-License-Identifier: BSD-3-Clause
"""Shadow planes of meshes for tests, and what rays meet of them by linear algebra in NumPy."""

import mitsuba as mi
import numpy as np

from airlight.realtime.methods.published.biri2006.planes import paper_planes
from airlight.realtime.methods.shadow_planes.plane_table import (
    GAIN_SHIFT,
    GAIN_ZERO,
    NUMBER,
    light_basis,
)
from airlight.realtime.methods.shadow_planes.sweep import ray_planes
from airlight.realtime.numerics.array_types import array_types
from airlight.realtime.numerics.functions import host_diamond_angle
from airlight.realtime.scene.mesh_adjacency import make_occluders
from tests.helpers.occluders import ALL

LIGHT = np.array([1.23, -0.87, 1.61])
CAMERA = np.array([-1.57, -1.93, 0.71])


def occluders_of(*names):
    """Return the occluders of meshes for tests."""
    return make_occluders([(name, *ALL[name]()) for name in names])


def planes_of(occluders, light=LIGHT, camera=CAMERA, precision="single", *, order="exact"):
    """Return the shadow planes of all components, with the ends of their edges."""
    used = np.ones(len(occluders.closed), dtype=bool)
    light, camera = np.asarray(light, dtype=float), np.asarray(camera, dtype=float)
    types, towards_camera = array_types(precision), order == "paper"
    return paper_planes(
        occluders, light, camera, used=used, types=types, towards_camera=towards_camera
    )


def bundles(count, *, spread, light=LIGHT, camera=CAMERA, seed=1):
    """Return unit directions in the frame of the light, (count, 3): in bundles
    of sixteen, `spread` wide.

    Three quarters lead to points in and behind the occluders, an eighth close by the light and an
    eighth away from it, where all azimuths meet.
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


def plane_table(planes):
    """Return ends (planes, 2, 3), first and last azimuth and gain of all planes,
    float64, without the padding.
    """
    index = planes.index
    ends = np.array(planes.ends, dtype=np.float64).reshape(-1, 2, 3)
    spans = np.array(index.spans, dtype=np.float64).reshape(-1, 2)
    count = int(np.max(np.flatnonzero(np.any(ends != 0, axis=(1, 2))), initial=-1)) + 1
    # The gain of a plane is in each entry of a list that holds it.
    entries, gain = np.array(index.entries)[: np.array(index.start).max()], np.zeros(count)
    gain[entries & NUMBER] = ((entries >> GAIN_SHIFT) & 63).astype(int) - GAIN_ZERO
    return ends[:count], spans[:count, 0], spans[:count, 1], gain


def crossings(planes, ways):
    """Return where rays from the camera cross planes, (rays, planes), infinite where they do
    not, and the layers gained.

    The point of the ray is p a + q b, with a and b the ends of the edge and p, q >= 0, p + q >= 1
    beyond the edge: three linear equations. A plane that is in the table twice, parted at azimuth
    0, counts where its azimuths hold the ray's.
    """
    ends, first, last, gain = plane_table(planes)
    a, b = ends[:, 0], ends[:, 1]
    camera = np.array([0.0, 0.0, np.array(planes.index.distance).item()])
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


def lit_lengths(planes, ways, end, *, weight=lambda x: x):
    """Return the sum of weight(x1) - weight(x0) over the lit segments up to `end`, and
    whether the light reaches it.
    """
    x, gain = crossings(planes, ways)
    total, lit = np.zeros(len(ways)), np.zeros(len(ways), dtype=bool)
    for ray in range(len(ways)):
        order = np.argsort(x[ray])
        order = order[x[ray][order] < end[ray]]
        layers = np.array(planes.index.layers).item() + np.concatenate(
            [[0], np.cumsum(gain[order])]
        )
        edges = np.concatenate([[0.0], x[ray][order], [end[ray]]])
        total[ray] = np.sum((weight(edges[1:]) - weight(edges[:-1]))[layers <= 0])
        lit[ray] = layers[-1] <= 0
    return total, lit


def rays_of(index, ways, end=None):
    """Return the rays of a walk up to a distance `end`, without an end by default."""
    end = np.full(len(ways), np.inf) if end is None else np.asarray(end, dtype=np.float64)
    aim = mi.Vector3d(np.ascontiguousarray(ways @ host_axes(index)).T)
    return ray_planes(index, aim, type(index.distance)(end))


def host_axes(index):
    """Return the axes of the frame of a light, (3, 3)."""
    return np.array([[float(component[0]) for component in axis] for axis in index.axes])
