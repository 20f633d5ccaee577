# SPDX-License-Identifier: BSD-3-Clause
"""The surfaces that a light sees in epipolar slices: one-dimensional height maps, and
binary trees of their bounds.

In the plane of a slice (`realtime.methods.epipolar.slices`) the light is at the origin, the camera
at (D, 0). The directions from the light are taken along a polygonal line k(q): for a point light
the one with the corners (1, 0), (0, 1), (-1, 0), which goes all round; for a spot the chord between
the two ends of its cone in the slice. A point is P = k / s; with k linear along an edge of the
line, (q, s) are projective coordinates and a camera ray is straight in them
(`realtime.shadow_maps.projection` has the same with one dimension more).

For a light at infinity a slice holds parallel rays at distances Y from the axis e1 through the
camera, between Y0 and Y1, where the slice enters and leaves the rectangle of the shadow map. With
s_O the height of the camera in the map, the point (X, Y) has s = s_O - X. Here k(q) = (s_O, Y) with
Y linear in q, and everything below is the same.

The map of a slice holds S = D s of the surfaces at equal steps in q, read from the height field of
the shadow map. A leaf lies between two samples, and a node of 2^l leaves holds the least and the
greatest S over it. The publications have one depth for a leaf (Chen et al. 2011, Yusov 2013); here
S is linear between the ends of a leaf, like the height field of the light volume, and a shadow ends
where the linear S says, not at the end of a texel.
"""

from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import mitsuba as mi

from airlight.realtime.methods.epipolar.slices import Slices
from airlight.realtime.numerics.array_types import two_numbers
from airlight.realtime.scene.lights import Light
from airlight.realtime.shadow_maps.projection import cube_coordinates, light_faces
from airlight.realtime.shadow_maps.shadow_map import ShadowMap


@dataclass(frozen=True)
class SliceHeights:
    """The height maps of slices with their trees."""

    size: int  #: leaves of an edge of k(q), a power of two
    edges: int  #: 2 of a point light, 1 of others
    slices: Slices
    #: of a spot or directional light: k at both ends, by slice
    chord: tuple[Any, Any, Any, Any] | None
    tree: (
        #: by slice a heap of pairs: 2 nodes of 2^(m-1) leaves from the second place on,
        #: ..., the leaves at the end
        Any
    )

    @property
    def leaves(self) -> int:
        """Leaves of a slice."""
        return self.size * self.edges

    @property
    def top(self) -> int:
        """The level of the nodes of a whole edge; a node over two edges would have a kink."""
        return self.size.bit_length() - 1


def slice_heights(shadow_map: ShadowMap, heights, slices: Slices, light: Light) -> SliceHeights:
    """Return the height maps of slices.

    `shadow_map`: of the light; `heights`: its inverse planar depths at the corners of the texels
    (`realtime.shadow_maps.shadow_map.inverse_depth`) [1/m]; `slices`: the slices of the image;
    `light`: the light.

    Chen, Baran, Durand, Jarosz 2011, *Real-time volumetric shadows using 1D min-max mipmaps*.
    """
    # A spot or a directional light sees all within one edge of k(q); around a point light two edges
    # lead through half a turn, and the slices are half planes.
    edges = 1 if light_faces(light) == 1 else 2
    chord = None
    if edges == 1:
        chord = _chord(slices, light, shadow_map.size) if light.w else _band(slices, shadow_map)
    Float = type(heights)
    empty = SliceHeights(shadow_map.size, edges, slices, chord, None)
    samples = empty.leaves + 1
    # One lane for each sample of each slice: leaves + 1 samples at equal steps in q, the ends of
    # the leaves.
    index = dr.arange(mi.UInt32, slices.count * samples)
    number = index // samples
    kx, ky = line_point(empty, number, Float(index - number * samples))
    across = dr.gather(type(slices.across), slices.across, number)
    # The direction k(q) in space. At infinity k(q) = (s_O, Y): the point Y e2 beside the camera, as
    # `_height` reads it along parallel rays.
    vector = slices.towards * kx + across * ky if slices.w else slices.away + across * ky
    # Evaluated, since the trees gather from it.
    value = slices.distance * _height(shadow_map, heights, vector)
    dr.eval(value, chord)
    index = dr.arange(mi.UInt32, slices.count * empty.leaves)
    # The sample where each leaf begins: a slice has one sample more than leaves, which puts the
    # leaves of slice n off by n.
    at = index + index // empty.leaves
    ends = dr.gather(Float, value, at), dr.gather(Float, value, at + 1)
    return replace(empty, tree=_tree(empty, *ends))


def line_point(heights: SliceHeights, number, q):
    """Return (k_x, k_y) at `q`, counted in leaves, of the slices of a `number`."""
    q = q * (1.0 / heights.size)
    # The polygonal line (1, 0), (0, 1), (-1, 0) of a point light: k_x falls from 1 to -1 over two
    # edges, and |k_x| + k_y = 1.
    if heights.chord is None:
        kx = 1 - q
        return kx, 1 - dr.abs(kx)
    x0, y0, x1, y1 = (dr.gather(type(q), coordinate, number) for coordinate in heights.chord)
    return dr.fma(q, x1 - x0, x0), dr.fma(q, y1 - y0, y0)


def _tree(heights: SliceHeights, at_begin, at_end):
    """Return the trees over leaves with the heights `at_begin` and `at_end` at their ends."""
    count, leaves = heights.slices.count, heights.leaves
    Pair = two_numbers(type(at_begin))
    # The tree is only written here: if a kernel read it too, Dr.Jit would copy it at every level.
    tree = dr.empty(type(at_begin), 2 * count * 2 * leaves)
    index = dr.arange(mi.UInt32, count * leaves)
    # The leaves are the last half of each slice's heap of 2 `leaves` places, and keep the order of
    # their ends: S is linear between them.
    dr.scatter(tree, Pair(at_begin, at_end), index + (index // leaves + 1) * leaves)
    low, high = dr.minimum(at_begin, at_end), dr.maximum(at_begin, at_end)
    dr.eval(low, high, tree)
    for level in range(1, heights.top + 1):
        # A node holds the least and the greatest S of its two children. The loop ends at nodes of a
        # whole edge, so a slice with two edges has two roots.
        nodes = leaves >> level
        index = dr.arange(mi.UInt32, count * nodes)
        low = dr.minimum(*(dr.gather(type(at_begin), low, 2 * index + k) for k in (0, 1)))
        high = dr.maximum(*(dr.gather(type(at_begin), high, 2 * index + k) for k in (0, 1)))
        # Level `level` begins at place `nodes` in the heap of a slice.
        number = index // nodes
        dr.scatter(tree, Pair(low, high), number * (2 * leaves) + (index - number * nodes + nodes))
        dr.eval(low, high, tree)
    return tree


def _height(shadow_map: ShadowMap, heights, direction):
    """Return s of the surface in a direction k: it is hit at k / s [1/m times |k|].

    For a light at infinity k is a point less the light's position [m], and s the height of
    the surface on its ray [m].
    """
    size, projection = shadow_map.size, shadow_map.projection
    # The place (u, v) in the face that the direction points into, and the depth of k along the axis
    # of that face: heights are inverse planar depths, so s for k is the height times that depth.
    if projection.basis:
        a, b, _, depth = projection.homogeneous(mi.UInt32(0), direction, 1 - projection.w)
        face, u, v = mi.UInt32(0), a / depth, b / depth
    else:
        face, u, v = cube_coordinates(direction)
        depth = dr.maximum(
            dr.maximum(dr.abs(direction.x), dr.abs(direction.y)), dr.abs(direction.z)
        )
    u, v = (dr.clip(dr.fma(0.5 * size, coordinate, 0.5 * size), 0, size) for coordinate in (u, v))
    column, row = (dr.minimum(mi.UInt32(coordinate), size - 1) for coordinate in (u, v))
    x, y = u - type(u)(column), v - type(v)(row)
    # The two triangles of a texel share its diagonal and differ in the third corner.
    corner = (face * (size + 1) + row) * (size + 1) + column
    third = corner + dr.select(x >= y, mi.UInt32(1), mi.UInt32(size + 1))
    h0, h1, h2 = (dr.gather(type(u), heights, at) for at in (corner, third, corner + (size + 2)))
    # Linear over a triangle: from the first corner along the longer step and on along the shorter
    # one.
    return depth * (h0 + dr.maximum(x, y) * (h1 - h0) + dr.minimum(x, y) * (h2 - h1))


def _chord(slices: Slices, light: Light, size: int):
    """Return k at the ends of the cone of a spot in the slices.

    A direction at the angle phi has the cosine p cos phi + q sin phi = R cos(phi - middle) with the
    axis, (p, q) the axis in the slice. The chord is a texel wider on both sides, for the rays of
    pixels beside the slice.
    """
    # The angle of the axis in the slice, from -pi/2 to 3/2 pi: the slice holds angles from 0 to pi,
    # and an axis behind it is nearest to one of their ends.
    p, q = dr.dot(light.axis, slices.towards), dr.dot(light.axis, slices.across)
    middle = dr.atan2(q, p)
    middle += dr.select(middle < -0.5 * dr.pi, 2 * dr.pi, 0)
    reach = dr.sqrt(p * p + q * q)
    # R cos(phi - middle) >= cos(cutoff) gives half the angle of the cone in the slice; where R is
    # less than that, the slice misses the cone and gets the margin alone. Up to 1.56, under pi/2: a
    # chord must not go through the light.
    margin = 2 * light.cutoff / size
    half = dr.minimum(dr.safe_acos(dr.minimum(light.cos_cutoff / reach, 1)) + margin, 1.56)
    begin = dr.clip(middle - half, 0, dr.pi - margin)
    end = dr.clip(middle + half, begin + margin, dr.pi)
    return dr.cos(begin), dr.sin(begin), dr.cos(end), dr.sin(end)


def _band(slices: Slices, shadow_map: ShadowMap):
    """Return k at both ends of where slices lie in the map of a directional light, a
    texel wider on both sides.

    In a slice u and v are linear in Y, and the map holds -1 to 1 of both.
    """
    projection, Float = shadow_map.projection, type(slices.distance)
    # (u, v) = (a0, b0) + Y (a, b): the camera in the map, and e2 in it.
    a0, b0, height, _ = projection.homogeneous(mi.UInt32(0), slices.away, 1)
    a, b, _, _ = projection.homogeneous(mi.UInt32(0), slices.across, 0)
    begin, end = Float(0), Float(dr.inf)
    for start, slope in ((a0, a), (b0, b)):
        # Clip the half line Y >= 0 to -1 <= u <= 1 and the same for v; a slice along a side has
        # slope 0 and stays as it is.
        side = dr.mulsign(Float(1), slope)
        begin = dr.select(slope == 0, begin, dr.maximum(begin, (-side - start) / slope))
        end = dr.select(slope == 0, end, dr.minimum(end, (side - start) / slope))
    margin = (2 / shadow_map.size) * dr.rcp(dr.maximum(dr.abs(a), dr.abs(b)))
    # A slice that misses the map gets a band beside it, which no ray uses.
    begin = dr.maximum(begin - margin, 0)
    end = dr.maximum(end + margin, begin + margin)
    height = height + dr.zeros(Float, slices.count)
    return height, begin, height, end


def node_pair(heights: SliceHeights, number, place, level):
    """Return the pair [1/m] of the node of a level that begins at the leaf `place`, of
    the slices of a `number`.
    """
    # In a heap the parent of place p is p/2: `level` halvings lead from the leaf to its node.
    heap = (mi.UInt32(heights.leaves) + place) >> level
    pair = dr.gather(
        two_numbers(type(heights.tree)), heights.tree, number * (2 * heights.leaves) + heap
    )
    return pair.x, pair.y
