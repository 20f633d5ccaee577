# SPDX-License-Identifier: BSD-3-Clause
"""The extent of a directional light: the smallest rectangle across it through which all
light of the media comes.

Light enters through this rectangle before all shapes, and leaves through the same rectangle behind
the media. Heights above the rear rectangle are small numbers where depths from the front may be
large ones, so the middle of the rear one stands for the place of the light.

The media lie in the hull of some spheres: the corners of the hull of meshes, which are spheres of
radius 0, and media that are spheres. Without media that end somewhere the spheres are those about
the shapes. Seen along the light the rectangle about them is turned by the angle at which it has the
least area.
"""

from collections.abc import Sequence
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from airlight.realtime.numerics.array_types import ArrayTypes, aligned_array
from airlight.realtime.scene.lights import DirectionalExtent
from airlight.realtime.scene.mesh_adjacency import mesh_triangles

Array = NDArray[np.float64]

_MARGIN = 1.001  # so that rounding leaves nothing outside
#: How far behind the rectangle a medium without sides is followed, in depths of the map: only rays
#: within a thousandth of a radian of the light's direction are still over the map there.
_BEHIND = 1024.0


def media_spheres(boundaries: Sequence[Any]) -> Array:
    """Return spheres whose hull holds media: middles and radii, (spheres, 4) [m].

    Numbers are rounded, and the spheres grown by as much: the precision of the media changes last
    digits, which must not move the rays of a map.

    Parameters
    ----------
    boundaries
        Mitsuba's shapes around the media, spheres or closed meshes, one or more.
    """
    from scipy.spatial import ConvexHull

    spheres = [_sphere_about(shape, touching=True) for shape in boundaries if not shape.is_mesh()]
    meshes = [mesh_triangles(shape)[0] for shape in boundaries if shape.is_mesh()]
    if meshes:
        # Corners of the hull suffice: the hull of the spheres is the same with all vertices.
        vertices = np.concatenate(meshes)
        corners = vertices[ConvexHull(vertices).vertices]
        spheres.append(np.column_stack([corners, np.zeros(len(corners))]))
    return _rounded(np.vstack(spheres))


def shape_spheres(shapes) -> Array:
    """Return spheres about shapes, (spheres, 4) [m], for a medium without sides.

    They are larger than the shapes by a twentieth of them all: at the border of a map nothing
    stands, so that what lies beyond it is lit.

    Parameters
    ----------
    shapes
        Mitsuba's opaque shapes; without any the rectangle fits a sphere of 1 m about the origin.
    """
    spheres = np.array(
        [_sphere_about(shape) for shape in shapes] or [np.array([0.0, 0.0, 0.0, 1.0])]
    )
    size = np.ptp(spheres[:, :3], axis=0).max() + spheres[:, 3].max()
    return _rounded(spheres + np.array([0, 0, 0, 0.05 * size]))


def _sphere_about(shape: Any, *, touching: bool = False) -> Array:
    """Return the sphere about the box of a shape, (4,) [m]; `touching`: the one inside,
    which is a sphere itself.
    """
    low, high = (
        np.array(corner, dtype=np.float64).ravel()
        for corner in (shape.bbox().min, shape.bbox().max)
    )
    width = (high - low).max() if touching else np.linalg.norm(high - low)
    return np.append(0.5 * (low + high), 0.5 * width)


def _rounded(spheres: Array) -> Array:
    # Numbers of 14 bits, in steps of a power of two. Rounding moves a middle by sqrt(3)/2 steps and
    # a radius by half a step at most: radii grow by two steps to hold what they held.
    bits = 14
    grain = 2.0 ** np.ceil(
        np.log2(np.ptp(spheres[:, :3], axis=0).max() + spheres[:, 3].max()) - bits
    )
    return grain * (np.round(spheres / grain) + np.array([0, 0, 0, 2]))


def distance_before(spheres: Array, shapes) -> float:
    """Return the distance from the middle of the media beyond which nothing lies [m].

    An object that turns about the middle of its box stays within the sphere about the box.

    Parameters
    ----------
    spheres
        About the media, from `media_spheres` or `shape_spheres` [m].
    shapes
        Mitsuba's opaque shapes.
    """
    middle = _middle(spheres)
    everything = np.vstack([spheres, *(_sphere_about(shape) for shape in shapes)])
    # In any direction: a light that turns keeps the distance.
    reach = np.linalg.norm(everything[:, :3] - middle, axis=1) + everything[:, 3]
    return float(np.float32(_MARGIN * reach.max()))


def directional_fields(
    axis: Array, spheres: Array, back: float, types: ArrayTypes, *, without_sides: bool = False
) -> dict[str, Any]:
    """Return the fields of a directional `Light` that follow from its direction and the media.

    Valid for any axis. All but the axis is rounded to float32 in any precision, so that
    its map is the same in all.

    Parameters
    ----------
    axis
        Unit vector in which the light travels.
    spheres
        About the media, from `media_spheres` or `shape_spheres` [m].
    back
        From `distance_before` [m].
    types
        Array types of the fields.
    without_sides
        Whether the medium goes on beside and behind the rectangle.
    """
    middle = _middle(spheres)
    across, up, corner = _least_rectangle(axis, spheres[:, :3] - middle, spheres[:, 3])
    # How far behind their middle the media end, along the light; the rectangle lies there.
    behind = _MARGIN * float(((spheres[:, :3] - middle) @ axis + spheres[:, 3]).max())
    vectors = {"position": middle + corner + behind * axis, "across": across, "up": up}
    # Rounded to float32 in any precision, and then of its type: the map is the same in all.
    arrays = {name: _vector(vector.astype(np.float32), types) for name, vector in vectors.items()}
    position = arrays.pop("position")
    media = types.vector(*(aligned_array(types.scalar, column) for column in spheres[:, :3].T))
    depth = float(np.float32(back + behind))
    numbers = {"depth": types.scalar(depth), "back": types.scalar(back)}
    numbers["lowest"] = types.scalar(-_BEHIND * depth if without_sides else 0.0)
    extent = DirectionalExtent(
        **arrays, **numbers, media=media, radii=aligned_array(types.scalar, spheres[:, 3])
    )
    fields = {
        "position": position,
        "exact_axis": mi.Vector3d(*(float(c) for c in axis)),
        "extent": extent,
    }
    dr.make_opaque(*fields.values())
    return fields


def extent_spheres(extent: DirectionalExtent) -> Array:
    """Return the spheres about the media that an extent was made for."""
    return np.column_stack(
        [np.array(extent.media, dtype=np.float64).T, np.array(extent.radii, dtype=np.float64)]
    )


def _middle(spheres: Array) -> Array:
    centres, radii = spheres[:, :3], spheres[:, 3:]
    return 0.5 * ((centres - radii).min(axis=0) + (centres + radii).max(axis=0))


def _least_rectangle(axis: Array, points: Array, radii: Array) -> tuple[Array, Array, Array]:
    """Return half the sides of the rectangle of least area across an axis, and
    its middle; all (3,) [m].
    """
    # Two unit vectors across the axis, the first from the axis of coordinates that is farthest from
    # it: no cross product near 0.
    helper = np.eye(3)[np.argmin(np.abs(axis))]
    first = np.cross(helper, axis)
    first /= np.linalg.norm(first)
    second = np.cross(axis, first)

    # By angle the directions of one side, and behind them those of the other, a
    # quarter of a turn ahead. A rectangle is the same after a quarter of a turn: 90 angles there.
    count = 90
    angle = np.linspace(0, 0.5 * np.pi, count, endpoint=False)[:, None]
    cosine, sine = np.cos(angle), np.sin(angle)
    sides = np.concatenate([cosine * first + sine * second, cosine * second - sine * first])
    # The width of the spheres along each side.
    along = points @ sides.T
    low, high = (along - radii[:, None]).min(axis=0), (along + radii[:, None]).max(axis=0)
    width = high - low
    area = width[:count] * width[count:]
    # The first of equal areas: what rounds must not choose between them.
    least = int(np.argmax(area <= area.min() * (1 + 1e-9)))

    chosen = [least, least + count]
    across, up = sides[chosen] * (0.5 * _MARGIN * width[chosen])[:, None]
    return across, up, 0.5 * (low + high)[chosen] @ sides[chosen]


def _vector(values, types: ArrayTypes):
    return types.vector(*(float(value) for value in values))
