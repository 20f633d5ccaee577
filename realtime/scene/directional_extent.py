# SPDX-License-Identifier: BSD-3-Clause
"""The extent of a directional light: the smallest rectangle across it through which all light of the media comes.

Light enters there before all shapes, and leaves through the same rectangle behind the media. Heights above that end are
small numbers where depths may be large ones, so its middle stands for the place of the light.

The media lie in the hull of some spheres: the corners of media of few planes and of meshes that are not convex, which
are spheres of radius 0, and the spheres about the others. Seen along the light their rectangle is wanted at the angle
at which it has the least area.
"""

from collections.abc import Sequence
from itertools import combinations
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from airlight.realtime.numerics.array_types import ArrayTypes, aligned_array
from airlight.realtime.scene.closed_mesh import ClosedMesh
from airlight.realtime.scene.lights import DirectionalExtent
from airlight.realtime.scene.media.light_paths import BoundedMedium

Array = NDArray[np.float64]

_FEW_PLANES = 12  # of which every three are met
_ANGLES = 90  # that are tried, in a quarter of a turn
_BITS = 14  # of the numbers of a sphere
_BORDER = 0.05  # of the size of all shapes
_MARGIN = 1.001  # so that rounding leaves nothing outside


def media_spheres(bounded_media: tuple[BoundedMedium, ...]) -> Array:
    """Return spheres whose hull holds bounded media: middles and radii [m], (spheres, 4).

    Numbers are rounded, and the spheres grown by as much: what the precision of the media puts in their last digits
    must not move the rays of a map.
    """
    return _rounded(np.concatenate([_spheres(bounded_medium) for bounded_medium in bounded_media]))


def mesh_spheres(meshes: Sequence[ClosedMesh]) -> Array:
    """Return spheres whose hull holds meshes, as `media_spheres` does: the corners of their convex hull."""
    from scipy.spatial import ConvexHull

    vertices = np.concatenate([mesh.vertices for mesh in meshes])
    corners = vertices[ConvexHull(vertices).vertices]
    return _rounded(np.column_stack([corners, np.zeros(len(corners))]))


def shape_spheres(shapes) -> Array:
    """Return spheres about Mitsuba's shapes, as `media_spheres` does, for a medium without sides.

    They are larger than the shapes by a twentieth of them all: at the border of a map nothing stands, so that what lies
    beyond it is lit.
    """
    spheres = []
    for shape in shapes:
        low, high = (np.array(corner, dtype=np.float64).ravel() for corner in (shape.bbox().min, shape.bbox().max))
        spheres.append([*(0.5 * (low + high)), 0.5 * float(np.linalg.norm(high - low))])
    found = np.array(spheres or [[0.0, 0.0, 0.0, 1.0]])
    size = np.ptp(found[:, :3], axis=0).max() + found[:, 3].max()
    return _rounded(found + np.array([0, 0, 0, _BORDER * size]))


def _rounded(spheres: Array) -> Array:
    grain = 2.0 ** np.ceil(np.log2(np.ptp(spheres[:, :3], axis=0).max() + spheres[:, 3].max()) - _BITS)
    return grain * (np.round(spheres / grain) + np.array([0, 0, 0, 2]))


def distance_before(spheres: Array, shapes) -> float:
    """Return the distance from the middle of the media beyond which nothing lies [m].

    `spheres` are those of `media_spheres`, `shapes` Mitsuba's. An object that turns about the middle of its box stays
    within the sphere about the box.
    """
    middle = _middle(spheres)
    reach = np.linalg.norm(spheres[:, :3] - middle, axis=1) + spheres[:, 3]
    for shape in shapes:
        low, high = (np.array(corner, dtype=np.float64).ravel() for corner in (shape.bbox().min, shape.bbox().max))
        sphere = np.linalg.norm(0.5 * (low + high) - middle) + 0.5 * np.linalg.norm(high - low)
        reach = np.append(reach, sphere)
    return float(np.float32(_MARGIN * reach.max()))


def directional_fields(axis: Array, spheres: Array, back: float, types: ArrayTypes) -> dict[str, Any]:
    """Return the fields of a directional `Light` that follow from where it comes from and what it lights.

    `axis`: unit vector in which the light travels; `spheres`, `back`: from `media_spheres` and `distance_before` [m];
    `types`: of the arrays.

    Valid for any axis. All but the axis is rounded to float32 in any precision, so that its map is the same in all.
    """
    middle = _middle(spheres)
    across, up, corner = _least_rectangle(axis, spheres[:, :3] - middle, spheres[:, 3])
    behind = _MARGIN * float(((spheres[:, :3] - middle) @ axis + spheres[:, 3]).max())
    vectors = {"position": middle + corner + behind * axis, "across": across, "up": up}
    made = {name: _vector(vector.astype(np.float32), types) for name, vector in vectors.items()}
    position = made.pop("position")
    media = types.vector(*(aligned_array(types.scalar, column) for column in spheres[:, :3].T))
    numbers = {"depth": types.scalar(float(np.float32(back + behind))), "back": types.scalar(back)}
    extent = DirectionalExtent(**made, **numbers, media=media, radii=aligned_array(types.scalar, spheres[:, 3]))
    fields = {"position": position, "exact_axis": mi.Vector3d(*(float(c) for c in axis)), "extent": extent}
    dr.make_opaque(*fields.values())
    return fields


def extent_spheres(extent: DirectionalExtent) -> Array:
    """Return the spheres about the media that an extent was made for."""
    return np.column_stack([np.array(extent.media, dtype=np.float64).T, np.array(extent.radii, dtype=np.float64)])


def _middle(spheres: Array) -> Array:
    centres, radii = spheres[:, :3], spheres[:, 3:]
    return 0.5 * ((centres - radii).min(axis=0) + (centres + radii).max(axis=0))


def _least_rectangle(axis: Array, points: Array, radii: Array):
    """Return half the sides of the rectangle of least area, two vectors, and its middle."""
    helper = np.eye(3)[np.argmin(np.abs(axis))]
    first = np.cross(helper, axis)
    first /= np.linalg.norm(first)
    second = np.cross(axis, first)
    best: Any = None
    for angle in np.linspace(0, 0.5 * np.pi, _ANGLES, endpoint=False):
        sides = np.cos(angle) * first + np.sin(angle) * second, np.cos(angle) * second - np.sin(angle) * first
        ends = [((points @ side - radii).min(), (points @ side + radii).max()) for side in sides]
        area = (ends[0][1] - ends[0][0]) * (ends[1][1] - ends[1][0])
        if best is None or area < best[0] * (1 - 1e-9):
            best = area, sides, ends
    _, sides, ends = best
    across, up = (side * (0.5 * _MARGIN * (high - low)) for side, (low, high) in zip(sides, ends))
    return across, up, sum(side * (0.5 * (low + high)) for side, (low, high) in zip(sides, ends))


def _spheres(bounded_medium: BoundedMedium) -> Array:
    """Return the corners of a bounded medium of few planes, or its sphere."""
    centre, radius = np.array(bounded_medium.centre, dtype=np.float64).ravel(), float(bounded_medium.radius[0])
    whole = np.array([[*centre, radius]])
    if bounded_medium.planes is None or bounded_medium.count > _FEW_PLANES:
        return whole
    planes = np.array(bounded_medium.planes, dtype=np.float64).reshape(-1, 4)
    normals, offsets = planes[:, :3], planes[:, 3] + planes[:, :3] @ centre
    corners = []
    for three in combinations(range(bounded_medium.count), 3):
        matrix = normals[list(three)]
        # Planes that are nearly parallel meet far away, if anywhere.
        if abs(np.linalg.det(matrix)) > 1e-6:
            point = np.linalg.solve(matrix, offsets[list(three)])
            if np.all(normals @ point < offsets + 1e-4 * radius):
                corners.append([*point, 0.0])
    return np.array(corners) if len(corners) >= 4 else whole


def _vector(values, types: ArrayTypes):
    return types.vector(*(float(value) for value in values))
