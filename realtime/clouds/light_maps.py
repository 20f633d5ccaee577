# SPDX-License-Identifier: BSD-3-Clause
"""A cloud as its sun sees it, filtered to any width.

**The first and the last surface of a cloud along parallel light**, in plain arrays.

The rectangle of a directional light is cut into size^2 texels, and a ray goes through the middle of
each: from before the rectangle's shapes to the first surface, and from behind back to the last.
Heights are defined as in `realtime.shadow_maps.projection`: above the rectangle where the media
end, so that the lit side is the higher one and height falls along the light.

**The lit surface of a cloud, filtered to any width:** premultiplied MIP levels, read between texels
and levels.

With A = 1 where a ray of the light meets the cloud and 0 elsewhere, each level holds the means over
squares of 2^l texels of

    A,   A front,   A back,   A (u, v),   A n.

Divided by the mean of A they are means over the cloud alone, and texels outside the cloud count for
nothing (Bouthors 2008, section 7; Dachsbacher and Stamminger 2003). The mean of (u, v), which the
paper does not have, says *where* the mean of the heights is: over the middle of a cloud at the
requested place, at a silhouette on the side of the cloud. A tangent plane through the mean height
must go through it there.

*Normals*. The plane that touches a filtered surface has the mean slope of the surface. Hence n is
not of unit length: it has the component 1 along the light, (slope, 1), so that a mean of n has the
mean slope. Slopes are differences of the heights of neighbouring texels, whose sum over many texels
is the difference of the two ends: a surface that a bump hides counts as a step. The paper prints a
mean of unit normals. It has too many normals that face the light, as a map sees most surface there,
and none of hidden surfaces: on clouds with bumps it leans towards the light, and slabs across it
are too thick.

*Width*. A mean over a square of width w has the variance w^2/12 along each axis, and linear
interpolation between such means adds the w^2/6 of a tent: w^2/4 together. The level of a filter of
standard deviation sigma is therefore

    w = 2 sigma,   l = log2(2 sigma / texel),

with linear interpolation in l between two levels.

*Holes*. Where all texels that are read have A = 0 there is no mean. A texel without cloud therefore
takes the values of its parent, with the weight 1e-6: a look-up outside the cloud finds the nearest
values, from the finest level that holds any of the cloud, and a look-up in the cloud changes by a
fraction of 1e-6 at most. Holes are filled when all levels exist, from the coarsest down, so that no
mean counts them.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import mitsuba as mi

from airlight.realtime.numerics.array_types import Metres, PerRay, bytes_of, four_numbers, packed
from airlight.realtime.scene.lights import Light
from airlight.realtime.shadow_maps.projection import Projection, light_projection
from airlight.realtime.shadow_maps.shadow_map import check_size, texel_rays


@dataclass(frozen=True)
class LitSurfaces:
    """The parts of a cloud that rays along the light meet, in squares of 4 x 4 texels."""

    size: int  #: texels on a side
    place: Any  #: number of the texel of each ray, row by row
    there: Any  #: whether the ray meets the cloud
    front: Any  #: height of the first surface, 0 where there is none [m]
    back: Any  #: height of the last surface, 0 where there is none [m]


def cast_surfaces(cloud, light: Light, size: int) -> LitSurfaces:
    """Cast both rays of every texel; nothing is evaluated, so that what
    reads it is computed with it.

    `cloud`: a Mitsuba scene of the cloud's boundary alone; `light`: a directional light, with an
    extent that holds the cloud; `size`: texels on a side, a power of two. Raises InputError if
    `size` is not a power of two from 4 to 8192.
    """
    check_size(size)
    Float = type(light.position.x)
    start, axis, texel = texel_rays(light, size)
    depth = mi.Float64(light.extent.depth)
    # From before all shapes down the light, and from where the media end back up: distances of the
    # second ray are heights.
    first = mi.Ray3f(mi.Point3f(start), mi.Vector3f(axis))
    last = mi.Ray3f(mi.Point3f(start + axis * depth), mi.Vector3f(-axis))
    hit = cloud.ray_intersect_preliminary(first, coherent=True)
    behind = cloud.ray_intersect_preliminary(last, coherent=True, active=hit.is_valid())
    # At a silhouette one of both rays may slip past: there is no cloud of any thickness.
    mask = hit.is_valid() & behind.is_valid()
    front, back = (
        dr.select(mask, Float(depth) - Float(hit.t), 0),
        dr.select(mask, Float(behind.t), 0),
    )
    return LitSurfaces(size, texel, mask, front, back)


@dataclass(frozen=True)
class LightMap:
    """The levels of the maps of all clouds, cloud after cloud, the finest
    level first, row by row.
    """

    size: int  #: texels on a side of the finest level
    heights: Any  #: by texel A, A front [m], A back [m], A u
    normals: Any  #: by texel A n, A v
    texel: Any  #: width of a texel of the finest level [m]
    position: Any  #: middle of the rectangle where heights are 0 [m]
    projection: Projection
    #: texels of clouds before the one that is looked up, one number for all lanes or by lane
    before: Any = 0

    def of_cloud(self, number: PerRay) -> "LightMap":
        """Return the map in which each lane looks up the cloud of its number."""
        return replace(self, before=number * _texels_before(self.size, self.levels))

    @property
    def levels(self) -> int:
        """How many levels there are."""
        return self.size.bit_length()

    @property
    def axis(self) -> Any:
        """The direction in which the light travels."""
        return self.projection.parallel_axis


@dataclass(frozen=True)
class FilteredSurface:
    """The lit surface near some points, filtered."""

    #: fraction of the filter's width in which there is cloud; 1e-6 or less where there is none
    cover: Any
    middle: Any  #: the middle of that part of the surface [m]
    thickness: Any  #: from the first to the last surface, along the light [m]
    normal: Any  #: of unit length, towards the light


def light_map(clouds: Sequence[Any], light: Light, size: int) -> LightMap:
    """Return the map of clouds under one directional light.

    `clouds`: by cloud a Mitsuba scene of its boundary alone; `light`, `size`: as of
    `cast_surfaces`, which raises InputError for the same sizes.
    """
    return filtered_map([cast_surfaces(cloud, light, size) for cloud in clouds], light)


def filtered_map(surfaces: Sequence[LitSurfaces], light: Light) -> LightMap:
    """Return all levels of a map from the finest of each cloud."""
    Float = type(light.position.x)
    size, projection = surfaces[0].size, light_projection(light)
    texels = _texels_before(size, size.bit_length())
    heights, normals = (dr.empty(Float, 4 * texels * len(surfaces)) for _ in range(2))
    for number, cloud in enumerate(surfaces):
        _add_levels((heights, normals), cloud, projection, number * texels)
    # (u, v) goes from -1 to 1: a texel has 2/size of the half sides, in the geometric mean of both.
    assert projection.basis is not None
    across, up, _ = projection.basis
    texel = (2.0 / size) * dr.sqrt(dr.norm(across) * dr.norm(up))
    dr.eval(heights, normals, texel)
    return LightMap(size, heights, normals, texel, light.position, projection)


def slope_normals(surfaces: LitSurfaces, projection: Projection) -> Any:
    """Return normals that are 1 long along the light, from differences of heights; 0
    where there is no cloud.
    """
    assert projection.basis is not None
    size, Float = surfaces.size, type(surfaces.front)
    across, up, axis = projection.basis
    row, column = surfaces.place // size, surfaces.place % size
    # Rays come in squares of 4 x 4 texels, neighbours are found row by row: arrays in that order.
    # All that is read later is evaluated now, as rays would be cast again otherwise.
    fronts, mask = dr.empty(Float, size * size), dr.empty(type(surfaces.there), size * size)
    dr.scatter(fronts, surfaces.front, surfaces.place)
    dr.scatter(mask, surfaces.there, surfaces.place)
    dr.eval(fronts, mask, surfaces.front, surfaces.back, surfaces.there, surfaces.place)

    def slope(place, stride: int, width):
        def side(inside, neighbour):
            inside &= dr.gather(type(mask), mask, neighbour, inside)
            return inside, dr.gather(Float, fronts, neighbour, inside)

        # The difference of both neighbours over two texels. Where one has no cloud or lies beyond
        # the map, the height of the texel itself stands for it, over one texel.
        above, high = side(place + 1 < size, surfaces.place + stride)
        below, low = side(place > 0, surfaces.place - stride)
        high, low = dr.select(above, high, surfaces.front), dr.select(below, low, surfaces.front)
        count = dr.select(above, Float(1), 0) + dr.select(below, Float(1), 0)
        return dr.select(count > 0, (high - low) / dr.maximum(count * width, 1e-30), 0)

    # n = -axis + slope across the light: 1 along the light, and against the slope of the heights.
    normal = -axis
    for direction, place, stride in ((across, column, 1), (up, row, size)):
        width = dr.norm(direction)
        normal = normal - direction / width * slope(place, stride, 2 / size * width)
    return dr.select(surfaces.there, normal, 0)


def _add_levels(
    tables: tuple[Any, Any], surfaces: LitSurfaces, projection: Projection, before: int
) -> None:
    """Write the levels of one cloud, without holes, behind so many texels of others.

    The finest level is most of the memory: it goes where it belongs at once, and its holes are
    written again. Dr.Jit would copy a table that the same kernel reads and writes, so that its
    holes are known beside it.
    """
    Float, size, axis = type(tables[0]), surfaces.size, projection.parallel_axis
    Four = four_numbers(Float)
    # The finest level, with holes.
    for table, values in zip(
        tables, _finest(surfaces, slope_normals(surfaces, projection)), strict=True
    ):
        dr.scatter(table, values, surfaces.place + before)
    # Where its holes are, beside the tables.
    mask = dr.empty(type(surfaces.there), size * size)
    dr.scatter(mask, surfaces.there, surfaces.place)
    dr.eval(tables, mask)
    # Means of 2 x 2 texels up to the level of one texel, still with holes, which count as 0.
    levels = [tuple(packed(_means(table, size // 2, before)) for table in tables)]
    while len(levels) < size.bit_length() - 1:
        dr.eval(levels[-1])
        levels.append(
            tuple(packed(_means(table, size >> (len(levels) + 1))) for table in levels[-1])
        )
    # From there down, holes take the values of their parent. A cloud that no ray meets has the
    # whole map as a hole, which looks towards the light.
    coarser = packed(Four(Float(1), 0, 0, 0)), packed(Four(-axis.x, -axis.y, -axis.z, 0))
    for number in range(len(levels), 0, -1):
        dr.eval(levels[number - 1], coarser)
        side = size >> number
        texel = dr.arange(mi.UInt32, side * side)
        means = tuple(dr.gather(Four, part, texel) for part in levels[number - 1])
        hole = means[0].x == 0
        values = [
            dr.select(hole, *pair)
            for pair in zip(_nearest(coarser, side, hole), means, strict=True)
        ]
        for table, value in zip(tables, values, strict=True):
            dr.scatter(table, value, texel + (before + _texels_before(size, number)))
        coarser = tuple(packed(value) for value in values)
    # The finest level's holes are written over.
    dr.eval(coarser, tables)
    for table, value in zip(tables, _nearest(coarser, size, ~mask), strict=True):
        dr.scatter(table, value, dr.arange(mi.UInt32, size * size) + before, ~mask)
    dr.eval(tables)


def _finest(surfaces: LitSurfaces, normal: Any) -> tuple[Any, Any]:
    """Return heights and normals of the finest level, with holes."""
    Float, size = type(surfaces.front), surfaces.size
    Four = four_numbers(Float)
    row = surfaces.place // size
    # The middles of the texels, from -1 to 1.
    u, v = (
        dr.fma(Float(texel), 2.0 / size, 1.0 / size - 1)
        for texel in (surfaces.place - row * size, row)
    )
    cover = dr.select(surfaces.there, Float(1), 0)
    return (
        Four(cover, surfaces.front, surfaces.back, cover * u),
        Four(normal.x, normal.y, normal.z, cover * v),
    )


def _nearest(coarser: tuple[Any, Any], side: int, hole: Any) -> list[Any]:
    """Return the values for holes of a level: the values of their parents, with a small weight."""
    Four, texel = four_numbers(type(coarser[0])), dr.arange(mi.UInt32, side * side)
    row = texel // side
    parent = (row // 2) * (side // 2) + (texel - row * side) // 2
    values = [dr.gather(Four, part, parent, hole) for part in coarser]
    # A and all that it multiplies shrink together, so that quotients stay as in the parent.
    hole_weight = 1e-6
    weight = hole_weight / values[0].x
    return [value * weight for value in values]


def maps_memory(Float: Any, size: int) -> int:
    """Return how much the map of a cloud and a sun takes, in numbers of a type [bytes]."""
    # Two tables of four numbers a texel.
    return 8 * bytes_of(Float) * _texels_before(size, size.bit_length())


def map_place(light_map: LightMap, point) -> tuple[Any, Any]:
    """Return (u, v) of points [m] on a map; beyond -1 or 1 they lie beside it."""
    u, v, _, _ = light_map.projection.homogeneous(mi.UInt32(0), point - light_map.position, 1)
    return u, v


def filtered_surface(light_map: LightMap, point, width: Metres) -> FilteredSurface:
    """Return the lit surface that points lie under, or over, along the light.

    `light_map`: of a cloud and a light; `point`: points [m]; `width`: standard
    deviation of the filter [m].

    Valid for any point and any width of 0 or more; what lies beside the map
    has the values of its edge.
    """
    Float = type(width)
    # l = log2(2 sigma/texel), between the two levels about it.
    level = dr.clip(dr.log2(dr.maximum(2 * width / light_map.texel, 1)), 0, light_map.levels - 1)
    fine = dr.minimum(mi.UInt32(level), light_map.levels - 1)
    coarse = dr.minimum(fine + 1, light_map.levels - 1)
    fraction = level - Float(fine)
    place = map_place(light_map, point)
    sums = [_at_level(light_map, place, number) for number in (fine, coarse)]
    cover, front, back, u = dr.lerp(sums[0][0], sums[1][0], fraction)
    *normal, v = dr.lerp(sums[0][1], sums[1][1], fraction)
    # Means over the cloud alone: all is divided by A.
    inverse = dr.rcp(cover)
    assert light_map.projection.basis is not None
    across, up, axis = light_map.projection.basis
    # The place of the mean height: (u, v) there, and the height against the axis.
    middle = (
        light_map.position + across * (u * inverse) + up * (v * inverse) - axis * (front * inverse)
    )
    return FilteredSurface(
        cover, middle, (front - back) * inverse, dr.normalize(type(point)(*normal))
    )


def shade(light_map: LightMap, point, width: Metres) -> tuple[PerRay, Metres]:
    """Return the fraction of a filter's width over which a cloud lies, and how much of it
    is above the points [m].

    Parameters as of `filtered_surface`. Above a point is towards the light, and lengths are along
    the light.
    """
    level = dr.clip(dr.log2(dr.maximum(2 * width / light_map.texel, 1)), 0, light_map.levels - 1)
    fine = dr.minimum(mi.UInt32(level), light_map.levels - 1)
    coarse = dr.minimum(fine + 1, light_map.levels - 1)
    u, v, height, _ = light_map.projection.homogeneous(mi.UInt32(0), point - light_map.position, 1)
    sums = [
        _between_texels(light_map, light_map.heights, (u, v), number) for number in (fine, coarse)
    ]
    cover, front, back, _ = dr.lerp(*sums, level - type(width)(fine))
    # Premultiplied heights less A times the point's, clipped to the cloud, and then divided by A.
    length = dr.clip(front - height * cover, 0, front - back) / cover
    return cover, length


def length_along_light(light_map: LightMap, point, active: Any = True) -> Metres:
    """Return how much of the way of the light to points lies in a cloud [m].

    From its first surface to the point, or to its last: what lies between both is cloud, also
    vacuum between two lobes (Bouthors 2008, section 7). Parameters as of `filtered_surface`; the
    surface comes from the finest level.
    """
    u, v, height, _ = light_map.projection.homogeneous(mi.UInt32(0), point - light_map.position, 1)
    cover, front, back, _ = _between_texels(
        light_map, light_map.heights, (u, v), mi.UInt32(0), active
    )
    # From the first surface down to the point, at most to the last one; 0 above the first.
    length = dr.maximum(dr.minimum(front - height * cover, front - back), 0) / cover
    # Between texels more than half of the weight must have cloud.
    return dr.select(cover > 0.5, length, 0)


def _at_level(light_map: LightMap, place: tuple[PerRay, PerRay], level: PerRay) -> tuple[Any, Any]:
    """Return both quadruples between the texels of a level."""
    return tuple(
        _between_texels(light_map, table, place, level)
        for table in (light_map.heights, light_map.normals)
    )


def _between_texels(
    light_map: LightMap, table: Any, place: Any, level: PerRay, active: Any = True
) -> Any:
    """Return the four numbers of a table between the texels of a level."""
    Float = type(table)
    Four = four_numbers(Float)
    side = mi.UInt32(light_map.size) >> level
    # Levels lie one behind the other, and the maps of clouds, too.
    before = light_map.before + _texels_before(light_map.size, level)
    columns, rows = (_neighbours(w, side, Float) for w in place)
    total = Four(0)
    for row, down in rows:
        for column, along in columns:
            texel = dr.gather(Four, table, before + row * side + column, active)
            total = dr.fma(texel, down * along, total)
    return total


def _neighbours(
    place: PerRay, side: PerRay, Float: Any
) -> tuple[tuple[PerRay, PerRay], tuple[PerRay, PerRay]]:
    """Return the numbers of the texels on both sides of u or v, and their weights."""
    # Texels have their values in their middles; beyond the outermost middles values stay the same.
    position = dr.clip(dr.fma(0.5 * Float(side), place + 1, -0.5), 0, Float(side) - 1)
    lower = dr.minimum(mi.UInt32(position), side - 1)
    fraction = position - Float(lower)
    return (lower, 1 - fraction), (dr.minimum(lower + 1, side - 1), fraction)


def _texels_before(size: int, level: Any) -> Any:
    """Return how many texels the levels before one have: size^2 (1 + 1/4 + ..)."""
    if isinstance(level, int):
        return sum((size >> finer) ** 2 for finer in range(level))
    # The finest level has size^2 texels and this one side^2: 4/3 of their difference lie before it.
    side = mi.UInt32(size) >> level
    return (size * size - side * side) // 3 * 4


def _means(table: Any, side: int, before: int = 0) -> Any:
    """Return the means over squares of 2 x 2, (side, side), of a level that lies behind
    so many texels of a table.
    """
    Four, texel = four_numbers(type(table)), dr.arange(mi.UInt32, side * side)
    row = texel // side
    # The first of the four texels in the finer level, whose rows are twice as long.
    first = 4 * row * side + 2 * (texel - row * side) + before
    total = Four(0)
    for place in (first, first + 1, first + 2 * side, first + 2 * side + 1):
        total += dr.gather(Four, table, place)
    return 0.25 * total
