# SPDX-License-Identifier: BSD-3-Clause
"""The shading data of every triangle of a scene, in two tables.

Mitsuba computes a surface interaction by calls over all kinds and instances of shapes and
materials. Where all of them are uniformly diffuse meshes, the number of the triangle is enough, and
reading a table costs a quarter of the calls. A scene with anything else is shaded by Mitsuba's
interaction.
"""

from collections.abc import Collection
from dataclasses import dataclass, replace
from itertools import accumulate
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from airlight.realtime.numerics.array_types import ArrayTypes, aligned_array, four_numbers, types_of

_CORNERS = (0, 0), (1, 0), (0, 1)  # barycentric coordinates u, v


@dataclass(frozen=True)
class Facets:
    """The triangles of all shapes, shape after shape."""

    first: Any  #: by number of the shape in Mitsuba's registry, its first triangle
    #: four numbers each, or each of its corners: the unit normal, and 1 if
    #: it is lit from both sides
    normals: Any
    #: four numbers each: the diffuse reflectance, and the number of its shape in the scene
    albedos: Any
    smooth: bool  #: whether normals are those of corners, to be interpolated


def read_facets(scene, types: ArrayTypes) -> Facets | None:
    """Return the triangles of a Mitsuba scene; None where a shape is no
    mesh of one diffuse colour.
    """
    shapes = scene.shapes()
    if not shapes or not all(_is_plain(shape) for shape in shapes):
        return None
    # By number in Mitsuba's registry, which rays that hit a shape tell, the first triangle of each.
    numbers = [int(dr.reinterpret_array(mi.UInt32, mi.ShapePtr(shape))[0]) for shape in shapes]
    counts = [shape.face_count() for shape in shapes]
    first = [0] * (max(numbers) + 1)
    for number, before in zip(numbers, accumulate(counts, initial=0)):
        first[number] = before
    # One smooth shape makes all have a normal for each corner: the table has one form.
    smooth = any(_is_smooth(shape) for shape in shapes)
    rows = [_of_shape(shape, smooth, number) for number, shape in enumerate(shapes)]
    normals, albedos = (np.concatenate([row[k] for row in rows]) for k in range(2))
    table = Facets(
        mi.UInt32(first),
        aligned_array(types.scalar, normals.ravel()),
        aligned_array(types.scalar, albedos.ravel()),
        smooth,
    )
    dr.make_opaque(table)
    return table


def turned_facets(facets: Facets, numbers: Collection[int], turn: NDArray[np.float64]) -> Facets:
    """Return the triangles with the normals of the shapes of some numbers
    turned by a matrix (3, 3).
    """
    Float = type(facets.normals)
    Four = four_numbers(Float)
    rotation, moved = aligned_array(Float, turn.ravel()), np.zeros(max(numbers, default=0) + 1)
    moved[list(numbers)] = 1
    # A lane for each normal. Its shape, from the row of its triangle, says whether it turns.
    lane = dr.arange(mi.UInt32, dr.width(facets.normals) // 4)
    normal = dr.gather(Four, facets.normals, lane)
    shape = mi.UInt32(dr.gather(Four, facets.albedos, lane // 3 if facets.smooth else lane).w)
    turns = dr.gather(Float, aligned_array(Float, moved), shape, shape < len(moved)) > 0
    rows = [dr.gather(types_of(Float).vector, rotation, k) for k in range(3)]
    turned = Four(*(dr.dot(row, normal.xyz) for row in rows), normal.w)
    return replace(facets, normals=dr.ravel(dr.select(turns, turned, normal)))


def facet_number(facets: Facets, hit, active):
    """Return the number of the triangle of `hit`, a preliminary intersection."""
    shape = dr.reinterpret_array(mi.UInt32, hit.shape)
    return dr.gather(mi.UInt32, facets.first, shape, active) + hit.prim_index


def facet_at(facets: Facets, number, uv, active):
    """Return the unit normal, whether it is lit from both sides, and the albedo of
    triangles by their numbers.

    `uv`, barycentric coordinates, is only read where normals are interpolated.
    """
    Four = four_numbers(type(facets.normals))
    red, green, blue, _ = dr.gather(Four, facets.albedos, number, active)
    if not facets.smooth:
        x, y, z, two_sided = dr.gather(Four, facets.normals, number, active)
        return (x, y, z), two_sided > 0, (red, green, blue)
    # Corners are weighted by 1 - u - v, u and v; the sum of unit normals is shorter than 1.
    Float = type(red)
    u, v = Float(uv.x), Float(uv.y)
    corners = [dr.gather(Four, facets.normals, 3 * number + k, active) for k in range(3)]
    x, y, z = (dr.fma(u, b, dr.fma(v, c, (1 - u - v) * a)) for a, b, c in list(zip(*corners))[:3])
    scale = dr.rsqrt(x * x + y * y + z * z)
    return (x * scale, y * scale, z * scale), corners[0].w > 0, (red, green, blue)


def _is_plain(shape) -> bool:
    if not shape.is_mesh() or shape.face_count() == 0:
        return False
    # A texture, a normal map or another kind of surface has parameters of other names.
    names = [name.rsplit(".", 2)[-2:] for name in mi.traverse(shape.bsdf()).keys()]  # noqa: SIM118 (no mapping)
    return names == [["reflectance", "value"]]


def _is_smooth(shape) -> bool:
    """Return whether normals differ over a triangle of a shape."""
    if not shape.has_vertex_normals():
        return False
    flat = mi.Bool(True)
    for u, v in _CORNERS:
        corner = _interaction(shape, u, v)
        # A triangle that is a line has no normal, and no ray meets it. Others are flat if the
        # normals of corner and triangle differ by float32's rounding, with room.
        flat &= ~dr.all(dr.isfinite(corner.n)) | (dr.norm(corner.sh_frame.n - corner.n) < 1e-5)
    return not dr.all(flat)


def _of_shape(shape, smooth: bool, number: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return normals and albedos of the triangles of a shape, as Mitsuba has them,
    in rows of four numbers.

    Rows are put together in NumPy: a kernel would hold the place of its shape in the table,
    and each shape its kernel.
    """
    two_sided = float(mi.has_flag(shape.bsdf().flags(), mi.BSDFFlags.BackSide))
    middle = _interaction(shape, 1 / 3, 1 / 3)
    # Seen along the normal, from the front.
    middle.wi = mi.Vector3f(0, 0, 1)
    albedo = shape.bsdf().eval_diffuse_reflectance(middle)
    normals = (
        [_interaction(shape, u, v).sh_frame.n for u, v in _CORNERS]
        if smooth
        else [middle.sh_frame.n]
    )
    dr.eval(albedo, normals)
    of_corners = np.stack(
        [_rows(normal, two_sided, shape.face_count()) for normal in normals], axis=1
    )
    return of_corners.reshape(-1, 4), _rows(albedo, number, shape.face_count())


def _rows(three, fourth: float, count: int) -> NDArray[np.float64]:
    """Return three numbers of each triangle, or three that all triangles share, and a fourth,
    (triangles, 4).
    """
    rows = np.empty((count, 4))
    for column, part in zip(rows.T, (*three, fourth)):
        column[:] = part
    return rows


def _interaction(shape, u: float, v: float):
    """Return Mitsuba's interactions with all triangles of a shape, at their
    barycentric coordinates u, v.
    """
    count = shape.face_count()
    # A made-up hit of each triangle: Mitsuba fills in what it knows of the place.
    hit = dr.zeros(mi.PreliminaryIntersection3f, count)
    hit.t = dr.full(mi.Float, 1, count)
    hit.prim_uv = mi.Point2f(u, v)
    hit.prim_index = dr.arange(mi.UInt32, count)
    return shape.compute_surface_interaction(
        mi.Ray3f(mi.Point3f(0), mi.Vector3f(0, 0, 1)), hit, mi.RayFlags.All
    )
