# SPDX-License-Identifier: BSD-3-Clause
r"""Where rays cross the boundaries of clouds of any shape, their steps in
between, and depths along them.

**The boundaries of all clouds of a scene:** a Mitsuba scene to cast rays
at, and a table of normals.

**Crossings of rays with the boundaries of clouds, one after the other, and
what follows from them.**

A stretch of a ray between two crossings lies in a cloud if and only if the ray leaves one at its
end. Nobody needs to know whether the ray starts in a cloud. Where rounding hides a crossing, or
shows one twice, a stretch as short as the rounding is lost or added: the sum over the stretches is
right to the rounding of a distance.

Rays are cast in float32, from the last crossing on. A stretch that is shorter than the step beyond
it, 4e-6 of the distance and of the coordinates, is not seen.

The ends of a stretch lie on a boundary, and rounding decides on which side of it. A light that
shines along a boundary reaches either side by another depth. Depths at an end are therefore looked
up inside the stretch, as far from the boundary as that step: there the point lies in the cloud of
the stretch for certain.

**Steps of rays through clouds, and optical depths.**

A step of the length dx has the density in its middle, rho, and the depth kappa rho dx: the midpoint
rule, whose error falls with dx^2. In a grid steps start as long as a voxel, and grow with the depth
tau to the eye like exp(tau/s), s = `SPREAD`: light from behind tau is attenuated by exp(-tau), so
that all steps add about the same error. A homogeneous cloud has the density 1 and no voxels: its
stretches are the steps.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import reduce
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from airlight.realtime.numerics.array_types import Metres, PerRay, aligned_array, four_numbers
from airlight.realtime.scene.closed_mesh import shape_number
from airlight.realtime.scene.lights import Light
from airlight.realtime.scene.media.bounded import Clouds
from airlight.realtime.scene.mesh_adjacency import mesh_triangles, scene_of
from airlight.realtime.scene.read_scene import Scene


@dataclass(frozen=True)
class CloudSurfaces:
    """The boundaries of clouds; part of the state of a method, so that recorded
    functions take it as it is.
    """

    geometry: Any  #: an `mi.Scene` of the boundaries alone
    first: Any  #: by number of the shape in Mitsuba's registry, its first row of `facets`
    cloud: Any  #: by that number, the number of the cloud in `Medium.clouds`
    #: four numbers each: the outward unit normal of a triangle and 0, or the
    #: centre of a sphere [m] and 1
    facets: Any
    spheres: bool  #: whether there are any
    several: bool  #: whether there is more than one cloud


def cloud_surfaces(scene: Scene) -> CloudSurfaces:
    """Return the boundaries of the clouds of a scene; it must have `Medium.clouds`."""
    shapes = scene.boundaries
    rows = [_rows(shape) for shape in shapes]
    numbers = [shape_number(shape) for shape in shapes]
    # Hits carry the number of a shape in Mitsuba's registry: two tables lead from it to the rows of
    # the shape's normals and to the number of the cloud.
    first, cloud = (
        np.zeros(max(numbers) + 1, dtype=np.uint32),
        np.zeros(max(numbers) + 1, dtype=np.uint32),
    )
    first[numbers] = np.cumsum([0] + [len(shape_rows) for shape_rows in rows[:-1]])
    cloud[numbers] = np.arange(len(shapes))
    facets = aligned_array(mi.Float, np.concatenate(rows).ravel())
    spheres = not all(shape.is_mesh() for shape in shapes)
    firsts, clouds = (aligned_array(mi.UInt32, values) for values in (first, cloud))
    surfaces = CloudSurfaces(scene_of(shapes), firsts, clouds, facets, spheres, len(shapes) > 1)
    # Recorded functions take the tables as inputs, and not as constants of their kernels.
    dr.make_opaque(surfaces.first, surfaces.cloud, surfaces.facets)
    return surfaces


def outward_normal(surfaces: CloudSurfaces, hit, point, active):
    """Return the outward unit normals where `hit`, a preliminary intersection, meets a
    boundary at a `point` [m].
    """
    row = mi.UInt32(0)
    if surfaces.several:
        row = dr.gather(
            mi.UInt32, surfaces.first, dr.reinterpret_array(mi.UInt32, hit.shape), active
        )
    # Without spheres each triangle has its row, and no fourth number is asked for.
    if not surfaces.spheres:
        x, y, z, _ = dr.gather(
            four_numbers(mi.Float), surfaces.facets, row + hit.prim_index, active
        )
        return mi.Vector3f(x, y, z)
    # The first row of a shape says whether it is a sphere; the normal of one points from its
    # centre.
    ball = dr.gather(four_numbers(mi.Float), surfaces.facets, row, active).w > 0
    x, y, z, _ = dr.gather(
        four_numbers(mi.Float), surfaces.facets, row + dr.select(ball, 0, hit.prim_index), active
    )
    normal = mi.Vector3f(x, y, z)
    return dr.select(ball, dr.normalize(point - normal), normal)


def _rows(shape):
    """Return the rows of a shape, (rows, 4)."""
    if not shape.is_mesh():  # a sphere
        # The centre of a sphere is the centre of its box; the 1 marks it.
        box = shape.bbox()
        centre = 0.5 * (
            np.array(box.min, dtype=np.float64).ravel()
            + np.array(box.max, dtype=np.float64).ravel()
        )
        return np.array([[*centre, 1.0]])
    vertices, faces = mesh_triangles(shape)
    corners = vertices[faces]
    area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    # The flag reverses the normals that the order of the corners gives.
    area *= -1.0 if shape.has_flipped_normals() else 1.0
    length = np.linalg.norm(area, axis=1, keepdims=True)
    # A triangle without area has no normal.
    normals = np.divide(area, length, out=np.zeros_like(area), where=length > 0)
    return np.column_stack([normals, np.zeros(len(normals))])


@dataclass(frozen=True)
class Crossing:
    """Where rays next meet a boundary."""

    distance: Metres  #: from the origin, infinite where there is no boundary any more [m]
    leaves: PerRay  #: whether the stretch before it lies in a cloud
    cloud: PerRay  #: the number of the cloud that the boundary encloses; 0 where there is none
    normal: PerRay  #: outward unit normal of the boundary


def next_crossing(surfaces: CloudSurfaces, origin, direction, x, active=True) -> Crossing:
    """Return the first crossing beyond a distance.

    `surfaces`: the boundaries of clouds; `origin`, `direction`: rays in any precision [m] and their
    unit directions; `x`: distance of the last crossing, or 0 [m]; `active`: lanes to compute.
    Returns `crossing`: its distance is larger than `x`.
    """
    Float = type(x)
    # The ray starts beyond the crossing at x, so that it does not meet the same boundary again.
    begin = dr.select(x > 0, x + _clearance(origin, x), 0)
    start = mi.Point3f(origin + direction * begin)
    # Camera rays and segments side by side start close together and go alike: with that hint
    # Embree takes a third of the time.
    ray = mi.Ray3f(start, mi.Vector3f(direction))
    hit = surfaces.geometry.ray_intersect_preliminary(ray, coherent=True, active=active)
    valid = hit.is_valid() & active
    t = dr.select(valid, hit.t, 0)
    normal = outward_normal(surfaces, hit, start + mi.Vector3f(direction) * t, valid)
    cloud = mi.UInt32(0)
    if surfaces.several:
        cloud = dr.gather(
            mi.UInt32, surfaces.cloud, dr.reinterpret_array(mi.UInt32, hit.shape), valid
        )
    # The ray leaves a cloud where it goes the way of the outward normal.
    return Crossing(
        dr.select(valid, begin + Float(t), dr.inf),
        valid & (dr.dot(normal, mi.Vector3f(direction)) > 0),
        cloud,
        normal,
    )


def _clearance(origin, x) -> Metres:
    """Return how far from a boundary at a distance a point is on one side of it for certain [m]."""
    size = dr.maximum(dr.maximum(dr.abs(origin.x), dr.abs(origin.y)), dr.abs(origin.z))
    # Float32 rounds distances and coordinates to 6e-8 of their size.
    return 4e-6 * (x + size)


SPREAD = 2.0  #: s
#: A depth behind which nothing shows: exp(-20) = 2e-9.
OPAQUE = 20.0


def march(
    surfaces: CloudSurfaces,
    origin,
    direction,
    end,
    total,
    *,
    step: Callable,
    add: Callable,
    active: Any = True,
    first: Crossing | None = None,
) -> Any:
    """Add up what steps of rays within clouds have, from the nearest to the farthest.

    `surfaces`: the boundaries of clouds; `origin`, `direction`, `end`: rays [m], their unit
    directions, and where they end, may be infinite [m]; `total`: the sum of no step, a tuple of
    arrays of the rays' width; `step`: (total, distance [m], cloud) -> how long a step may be [m];
    `add`: (total, begin, end, inside, cloud) -> total, and whether to go on, for steps [m] in the
    cloud of a number: the first in a stretch has no length, and says where it begins; `inside` is
    `end`, moved off a boundary into the stretch; `active`: lanes to compute; `first`: the first
    crossing, if it is known. The loop changes lanes only while they go on.
    """
    Float, lanes = type(direction.x), max(dr.width(direction), dr.width(origin))
    # The shortest step, as a fraction of the distance: rounding does not take it away.
    shortest = 1e-6

    def stretch(x, crossing=None):
        """Return where the next stretch in a cloud begins and ends; both are one place
        where rounding hides it.
        """
        # The next boundary. If the ray leaves a cloud there, the stretch began at x; otherwise it
        # begins there, and ends where the ray leaves. A second entry in its place shows that
        # rounding hid an exit: the stretch then has no length, and the march goes on behind it.
        near = next_crossing(surfaces, origin, direction, x) if crossing is None else crossing
        far = next_crossing(
            surfaces, origin, direction, near.distance, ~near.leaves & (near.distance < end)
        )
        begin = dr.select(near.leaves, x, dr.select(far.leaves, near.distance, far.distance))
        edge = dr.select(near.leaves, near.distance, far.distance)
        return begin, dr.minimum(edge, end), dr.select(near.leaves, near.cloud, far.cloud)

    def body(x, edge, cloud, opens, total, going):
        longest = dr.maximum(step(total, x, cloud), shortest * x)
        # The first step of a stretch has no length: it says where the stretch begins.
        target = dr.select(opens, x, dr.minimum(x + longest, edge))
        # Depths are looked up inside the stretch, off the boundary at either end, but never beyond
        # the middle of the stretch or of the step.
        clear = _clearance(origin, target)
        entered = dr.minimum(target + clear, 0.5 * (target + edge))
        leaving = dr.select(target < edge, target, dr.maximum(target - clear, 0.5 * (x + target)))
        total, goes_on = add(total, x, target, dr.select(opens, entered, leaving), cloud)
        # At the end of a stretch the next one is looked for, in the lanes that have reached it.
        opens = goes_on & ~opens & (target >= edge) & (edge < end)
        x, edge, cloud = dr.if_stmt(
            args=(target, edge, cloud),
            cond=opens,
            true_fn=lambda x, *_: stretch(x),
            false_fn=lambda *same: same,
        )
        return x, edge, cloud, opens, total, going & goes_on & (x < end)

    begin, edge, cloud = stretch(dr.zeros(Float, lanes), first)
    going = dr.full(mi.Bool, True, lanes) & active & (begin < end)
    state = (begin, edge, cloud, dr.full(mi.Bool, True, lanes), total, going)
    *_, total, _ = dr.while_loop(state=state, cond=lambda *state: state[-1], body=body)
    return total


def middle_density(clouds: Clouds, origin, direction, begin, end, cloud) -> Any:
    """Return rho in the middle of steps [1]."""
    if clouds.density is None:
        return 1
    return clouds.density.at(origin + direction * (0.5 * (begin + end)), cloud)


def voxel(clouds: Clouds, cloud) -> Metres:
    """Return the width of a voxel of the clouds of some numbers, infinite
    where they have none [m].
    """
    if clouds.density is None:
        return type(clouds.sigma_t[0])(dr.inf)
    return dr.gather(type(clouds.density.voxel), clouds.density.voxel, cloud)


def depths_along(
    surfaces: CloudSurfaces,
    clouds: Clouds,
    origin,
    direction,
    end,
    *,
    stride: Any,
    seen: bool,
    active: Any = True,
    first: Crossing | None = None,
) -> tuple[Any, ...]:
    """Return the optical depth of rays up to a distance in all clouds, by channel [1].

    `surfaces`, `clouds`: the boundaries, and what fills them; `origin`, `direction`, `end`,
    `active`, `first`: as of `march`; lanes that are not active have a depth of 0; `stride`: how
    long the first steps are in grids [voxels]; `seen`: whether the rays are rays of the eye, on
    which steps grow, and end behind `OPAQUE`.
    """
    Float, lanes = type(direction.x), max(dr.width(direction), dr.width(origin))
    # Homogeneous clouds have no voxels: one step takes the whole stretch.
    seen &= clouds.density is not None

    def step(depths, x, cloud):
        # Steps of the eye grow with the depth, by exp(tau/s), up to the depth behind which nothing
        # shows.
        length = stride * voxel(clouds, cloud) if clouds.density is not None else dr.inf
        return length * dr.exp(dr.minimum(least(depths), OPAQUE) / SPREAD) if seen else length

    def add(depths, begin, finish, inside, cloud):
        length = (finish - begin) * middle_density(clouds, origin, direction, begin, finish, cloud)
        depths = tuple(
            dr.fma(dr.gather(Float, sigma_t, cloud), length, depth)
            for sigma_t, depth in zip(clouds.sigma_t, depths)
        )
        # Rays of the eye end where the least dense channel is opaque.
        return depths, least(depths) < OPAQUE if seen else mi.Bool(True)

    nothing = tuple(dr.zeros(Float, lanes) for _ in clouds.sigma_t)
    return march(
        surfaces, origin, direction, end, nothing, step=step, add=add, active=active, first=first
    )


def segment_through(
    surfaces: CloudSurfaces, clouds: Clouds, light: Light, *, stride: Any
) -> Callable[[Any, Any], tuple[Any, ...]]:
    """Return the function from points [m] and active lanes to the depths of
    the segments from a light.
    """

    def segment(point, active):
        end = type(point.x)(dr.inf)
        return depths_along(
            surfaces, clouds, point, -light.axis, end, stride=stride, seen=False, active=active
        )

    return segment


def segment_by_lengths(clouds: Clouds, lengths: Any) -> Callable[[Any, Any], tuple[Any, ...]]:
    """Return the function from points [m] and active lanes to the depths of segments by channel.

    `lengths`: by cloud a function (point, active) -> how much of it lies on the segment,
    at its full density [m].
    """

    def segment(point, active):
        Float = type(point.x)
        depths = [Float(0) for _ in clouds.sigma_t]
        for cloud, length_to in enumerate(lengths):
            length = length_to(point, active)
            kappas = (dr.gather(Float, sigma_t, mi.UInt32(cloud)) for sigma_t in clouds.sigma_t)
            depths = [dr.fma(kappa, length, depth) for kappa, depth in zip(kappas, depths)]
        return tuple(depths)

    return segment


def least(depths: tuple[Any, ...]) -> Any:
    """Return the smallest of depths by channel [1]."""
    return reduce(dr.minimum, depths)
