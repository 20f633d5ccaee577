# SPDX-License-Identifier: BSD-3-Clause
r"""The shapes that can stand in the light of rays: one search for all lights.

Shadow segments lead from a ball about the light, or from far away in its direction, to points of
the rays, all of which begin at the camera: they lie in the convex hull of both. A shape beyond a
plane that has the hull on one side is left out. For a unit vector m the hull reaches up to

    h(m) = max(0, m . (C - o) + R, max_i l_i m . d_i),

o the camera, C and R the ball (a direction C towards the light: unbounded if m . C > 0), d_i and
l_i the rays and their lengths; a shape is out if the ball around it is above h(m) along m. That
holds whatever m is, so no case needs care.

Rays are taken in tiles: sorted by their azimuth about the axis from the camera to the light, cut in
strips, and these by the angle from the axis. All planes of rays and a point light hold this axis,
so the planes on both sides of a strip leave out all but the shapes that the planes of its rays
meet. Other m lie in the plane of the tile's mean ray and the axis, and touch the ball beside it.
Where rays are unbounded, m is leaned back until none of them rises along it. A group of rays whose
list of shapes is long is divided, and each part searches the list of its group, again and again
until the lists are short. For an area light, whose samples are many, groups are divided down to
single rays.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from airlight.reference.scene.shapes import Shapes

Array = NDArray[np.float64]
Index = NDArray[np.int64]


@dataclass(frozen=True)
class Ball:
    """The bounds of a light: a ball about a place, or the direction towards
    it, with w as in `planes`.
    """

    centre: Array  #: (3,) [m], or a unit vector
    radius: float = 0.0  #: [m]
    w: int = 1


@dataclass(frozen=True)
class Near:
    """The shapes near each ray: of each kind the lists of all rays, one after the other."""

    #: where the list of each ray begins and ends, (rays,) each, and the numbers of the shapes
    triangles: tuple[Index, Index, Index]
    spheres: tuple[Index, Index, Index]
    disks: tuple[Index, Index, Index]


def near_shapes(
    light: Ball, origin: Array, direction: Array, length: Array, shapes: Shapes
) -> Near:
    """Return the shapes that can stand between a light and rays.

    `light`: its bounds; `origin`, `direction`, `length`: where all rays begin, (3,) [m], their unit
    directions, (rays, 3), and how far they go, (rays,) [m]; `shapes`: the shapes.
    """
    none = (
        np.zeros(len(direction), np.int64),
        np.zeros(len(direction), np.int64),
        np.empty(0, np.int64),
    )
    if not shapes.count or not len(direction):
        return Near(none, none, none)
    # Balls around all shapes, in the order triangles, spheres, disks, with the camera as the
    # origin.
    middle = shapes.triangles.mean(axis=1)
    around = np.linalg.norm(shapes.triangles - middle[:, None], axis=2).max(axis=1)
    centres = np.concatenate([middle, shapes.centre, shapes.disks.centre]) - origin
    solids = centres, np.concatenate([around, shapes.radius, shapes.disks.radius])
    # Numbers of rays, and of solids; all rays of a tile share its list of solids.
    lists: list[tuple[Index, Index]] = []
    for rays, numbers in _tiles(light, origin, direction, length, solids):
        lists.append((rays, numbers))
    counts = [len(shapes.triangles), len(shapes.radius), len(shapes.disks.radius)]
    ends = np.cumsum([0, *counts]).tolist()
    return Near(*(_of_kind(lists, len(direction), ends[k], ends[k + 1]) for k in range(3)))


def _of_kind(
    lists: list[tuple[Index, Index]], count: int, first: int, last: int
) -> tuple[Index, Index, Index]:
    """Return the lists of the solids from `first` up to `last`, which are ascending, by ray."""
    begin, end = np.zeros(count, np.int64), np.zeros(count, np.int64)
    parts, at = [np.empty(0, np.int64)], 0
    for rays, numbers in lists:
        # The numbers of one kind lie together in the list of a tile, and lose the offset of their
        # kind.
        low, high = np.searchsorted(numbers, (first, last))
        begin[rays], end[rays] = at, at + high - low
        parts.append(numbers[low:high] - first)
        at += high - low
    return begin, end, np.concatenate(parts)


def _tiles(
    light: Ball, origin: Array, direction: Array, length: Array, solids: tuple[Array, Array]
) -> Iterator[tuple[Index, Index]]:
    """Yield rays, and the solids near all of them."""
    to_light = light.centre - light.w * origin
    distance = np.linalg.norm(to_light)
    axis = to_light / distance if distance > 0 else np.array([0.0, 0.0, 1.0])
    across = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    across /= np.linalg.norm(across)
    turned = np.cross(axis, across)
    # Rays by their azimuth about the axis: neighbours in this order make thin strips.
    azimuth = np.argsort(np.arctan2(direction @ turned, direction @ across), kind="stable")
    leaning = direction @ axis
    is_ball = light.radius > 0 and light.w == 1
    # A tile has 32 rays. The strip of a point light has 128, thin in azimuth; about a ball, which
    # no plane through the axis holds, tiles are about as wide as long.
    tile, parts = 32, 4
    width = max(tile, int(np.sqrt(tile * len(azimuth)))) if is_ball else 128
    # 1e-9 of the size of the scene is slack for rounding.
    largest = np.abs(solids[0]).max(initial=0)
    slack = 1e-9 * (1 + (distance if light.w else 0) + light.radius + largest)
    groups = [(azimuth, np.arange(len(solids[0])))]
    while groups:
        rays, numbers = groups.pop()
        # The fan of directions in the plane of a ray and the axis [rad]; in a group wider than a
        # strip only the planes on both sides are tried.
        fan = np.arange(12 if len(rays) <= width else 0) * np.pi / 6
        hull = _Hull(light, axis, to_light, direction[rays], length[rays], fan, slack)
        numbers = hull.near(solids, numbers)
        if not len(numbers):
            continue
        # To look through 512 pairs of rays and shapes costs less than to divide the group, for 50
        # samples of a light.
        if len(rays) <= (1 if is_ball else tile) or len(rays) * len(numbers) <= 512:
            yield rays, numbers
            continue
        # A strip is divided by the angle from the axis from here on.
        if len(rays) <= width and len(rays) > width // parts:
            rays = rays[np.argsort(leaning[rays], kind="stable")]
        step = -(-len(rays) // parts)
        groups += [(rays[first : first + step], numbers) for first in range(0, len(rays), step)]


def _cross(a: Array, b: Array) -> Array:
    """Return the cross product of two vectors, in a fiftieth of the time that NumPy's takes, which
    is made for many vectors.
    """
    (ax, ay, az), (bx, by, bz) = a.tolist(), b.tolist()
    return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])


class _Hull:
    """Half spaces that hold a light and some rays."""

    def __init__(
        self,
        light: Ball,
        axis: Array,
        to_light: Array,
        direction: Array,
        length: Array,
        fan: Array,
        slack: float,
    ):
        # The frame of the group: its mean ray, across it the direction `up` in the plane of ray and
        # axis, and `side` across that plane. Where rays cancel, or the mean ray is along the axis,
        # any frame will do.
        mean = direction.mean(axis=0)
        size = np.linalg.norm(mean)
        mean = mean / size if size > 1e-6 else direction[0]
        up = axis - (axis @ mean) * mean
        helper = _cross(mean, np.eye(3)[np.argmin(np.abs(mean))])
        up = up if np.linalg.norm(up) > 1e-9 else helper
        up /= np.linalg.norm(up)
        side = _cross(mean, up)
        vectors = []
        # Two planes through the axis hold the rays between them, at the smallest and the largest
        # azimuth from `out`, the mean ray's. For a ball two more planes lean to touch it.
        out = up - (up @ axis) * axis
        if np.linalg.norm(out) < 1e-9:
            out = mean - (mean @ axis) * axis
        out = out if np.linalg.norm(out) > 1e-9 else helper - (helper @ axis) * axis
        out /= -np.linalg.norm(out) if out @ mean < 0 else np.linalg.norm(out)
        turned = _cross(axis, out)
        azimuth = np.arctan2(direction @ turned, direction @ out)
        for sign, turn in ((-1.0, azimuth.min()), (1.0, azimuth.max())):
            edge = sign * (np.cos(turn) * turned - np.sin(turn) * out)
            vectors.append(edge)
            if light.radius > 0:
                beside = abs(to_light @ up)
                lean = min(light.radius / beside, 1.0) if beside > 0 else 1.0
                vectors.append(sign * np.sqrt(1 - lean**2) * side - lean * up)
        m = np.stack([*vectors, *(np.cos(turn) * mean + np.sin(turn) * up for turn in fan)])
        # An unbounded ray that rises along m makes the support infinite: m is leaned back against
        # the mean ray by as much as the steepest ray rises, if all rays go forward.
        if np.isinf(length).any():
            forward = direction @ mean
            rise = (m @ direction.T) / np.maximum(forward, 1e-3)
            m = (
                m
                - np.where(forward.min() > 1e-3, np.maximum(rise.max(axis=1), 0.0), 0.0)[:, None]
                * mean
            )
        # h(m) of the camera, at 0, of the ends of the rays, and of the light. A rise below `level`
        # is rounding.
        level = 1e-12
        rise = m @ direction.T
        with np.errstate(invalid="ignore"):
            reach = np.where(rise > level, rise * length, 0.0).max(axis=1)
        norm = np.linalg.norm(m, axis=1)
        ball = m @ to_light
        ball = ball + light.radius * norm if light.w else np.where(ball > level, np.inf, 0.0)
        self.support = np.maximum(np.maximum(reach, ball), 0.0) + slack
        # An m of no length, or with an infinite support, leaves nothing out.
        useful = np.isfinite(self.support) & (norm > 1e-6)
        self.m, self.support, self.norm = m[useful], self.support[useful], norm[useful]

    def near(self, solids: tuple[Array, Array], numbers: Index) -> Index:
        """Return the numbers of the balls that no half space leaves out, of those given."""
        centre, radius = solids
        for first in range(len(self.m)):
            # One plane after the other while more than 300 shapes are left: the planes beside the
            # rays, which come first, leave out most. Then all other planes at once.
            m = slice(first, first + 1 if len(numbers) > 300 else None)
            beyond = (
                centre[numbers] @ self.m[m].T - radius[numbers, None] * self.norm[m]
                > self.support[m]
            )
            numbers = numbers[~(beyond[:, 0] if m.stop else beyond.any(axis=1))]
            if not m.stop:
                break
        return numbers
