# SPDX-License-Identifier: BSD-3-Clause
"""What shading needs of every triangle of a scene, in two tables.

Mitsuba computes a surface interaction by calls over all kinds and instances of shapes and materials; where all of them
are meshes with flat, uniformly diffuse triangles, the number of the triangle says all, and reading it from a table
costs a quarter of that. A scene with anything else is shaded by Mitsuba's interaction.
"""

from dataclasses import dataclass
from typing import Any

from realtime.arrays import ArrayTypes, four_numbers

_FLAT = 1e-5  # length of the difference between the normals of a corner and of the triangle: float32, with room


@dataclass(frozen=True)
class Facets:
    """The triangles of all shapes, shape after shape."""

    first: Any  #: by number of the shape in Mitsuba's registry, its first triangle
    normals: Any  #: four numbers each: the unit normal, and 1 if it is lit from both sides
    albedos: Any  #: four numbers each: the diffuse reflectance, and 0


def read_facets(scene, types: ArrayTypes) -> Facets | None:
    """Return the triangles of a Mitsuba scene; None where a shape is more than flat triangles of one diffuse colour."""
    import drjit as dr
    import mitsuba as mi

    shapes = scene.shapes()
    if not shapes or not all(_is_plain(shape) for shape in shapes):
        return None
    numbers = [int(dr.reinterpret_array(mi.UInt32, mi.ShapePtr(shape))[0]) for shape in shapes]
    counts = [shape.face_count() for shape in shapes]
    first = [0] * (max(numbers) + 1)
    for place, number in enumerate(numbers):
        first[number] = sum(counts[:place])
    rows = [_of_shape(shape, types) for shape in shapes]
    if not all(flat for _, _, flat in rows):
        return None
    table = Facets(mi.UInt32(first), *(_joined(types, [row[k] for row in rows], counts) for k in range(2)))
    dr.make_opaque(table)
    return table


def facet_at(facets: Facets, hit, active):
    """Return the unit normal, whether it is lit from both sides, and the albedo, at a preliminary intersection."""
    import drjit as dr
    import mitsuba as mi

    shape = dr.reinterpret_array(mi.UInt32, hit.shape)
    number = dr.gather(mi.UInt32, facets.first, shape, active) + hit.prim_index
    Four = four_numbers(type(facets.normals))
    x, y, z, two_sided = dr.gather(Four, facets.normals, number, active)
    red, green, blue, _ = dr.gather(Four, facets.albedos, number, active)
    return (x, y, z), two_sided > 0, (red, green, blue)


def _is_plain(shape) -> bool:
    import mitsuba as mi

    if not shape.is_mesh() or shape.face_count() == 0:
        return False
    # A texture, a normal map or another kind of surface has parameters of other names.
    names = [name.rsplit(".", 2)[-2:] for name in mi.traverse(shape.bsdf()).keys()]  # noqa: SIM118 (no mapping)
    return names == [["reflectance", "value"]]


def _of_shape(shape, types: ArrayTypes):
    """Return normals and albedos of the triangles of a shape, as Mitsuba has them, and whether all are shaded flat."""
    import drjit as dr
    import mitsuba as mi

    middle = _interaction(shape, 1 / 3, 1 / 3)
    two_sided = float(mi.has_flag(shape.bsdf().flags(), mi.BSDFFlags.BackSide))
    middle.wi = mi.Vector3f(0, 0, 1)
    normal, albedo = middle.sh_frame.n, shape.bsdf().eval_diffuse_reflectance(middle)
    # One that is a line has no normal, and no ray meets it.
    proper = dr.all(dr.isfinite(normal))
    flat = mi.Bool(True)
    if shape.has_vertex_normals():
        for u, v in ((0, 0), (1, 0), (0, 1)):
            flat &= ~proper | (dr.norm(_interaction(shape, u, v).sh_frame.n - middle.n) < _FLAT)
    Four = four_numbers(types.scalar)
    albedo = Four(*(types.scalar(channel) for channel in albedo), 0)
    return Four(*(types.scalar(part) for part in normal), two_sided), albedo, bool(dr.all(flat)[0])


def _interaction(shape, u: float, v: float):
    """Return Mitsuba's interactions with all triangles of a shape, at their barycentric coordinates u, v."""
    import drjit as dr
    import mitsuba as mi

    count = shape.face_count()
    hit = dr.zeros(mi.PreliminaryIntersection3f, count)
    hit.t = dr.full(mi.Float, 1, count)
    hit.prim_uv = mi.Point2f(u, v)
    hit.prim_index = dr.arange(mi.UInt32, count)
    return shape.compute_surface_interaction(mi.Ray3f(mi.Point3f(0), mi.Vector3f(0, 0, 1)), hit, mi.RayFlags.All)


def _joined(types: ArrayTypes, parts, counts):
    """Return rows of shapes one after the other; a row that all triangles of a shape share counts for each."""
    import drjit as dr
    import mitsuba as mi

    table = dr.empty(types.scalar, 4 * sum(counts))
    place = 0
    for part, count in zip(parts, counts):
        dr.scatter(table, part, dr.arange(mi.UInt32, count) + place)
        place += count
    return table
