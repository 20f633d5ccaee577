# SPDX-License-Identifier: BSD-3-Clause
"""Every triangle of a light volume against every pixel that it covers.

A light volume is drawn (Billeter, Sintorn, Assarsson 2010, section 3) by its crossings with the ray
of every pixel, in any order: `realtime.methods.published.billeter2010.raster` adds them up.

Scan conversion in homogeneous coordinates. A vertex (P w, w) becomes (a, b, z, w): z is the depth
along the view, and the point lies in the image at column a/z, row b/z. Nothing is divided before it
must be, so a vertex at infinity (w = 0) is like any other, and no near plane cuts triangles behind
the camera (Olano, Greer 1997). The row j is a plane through the pinhole, b - j z = 0. With
f = b - j z at the ends of an edge, f <= 0 at B and f > 0 at A, the edge crosses that plane at

    C = f_A B - f_B A,       a combination with weights of 0 or more,

in the image (z_C > 0) at the column a_C/z_C, or behind the camera. The two crossed edges of a
triangle bound its pixels in that row: left <= column < right. Where one of the ends is behind the
camera, the segment leaves the image to the side on which it passes z = 0, and the
span is a half line.

Why it is watertight: fma(-j, z, b) has the sign of b - j z itself, and B and A are ordered by that
sign, not by triangle. The two triangles of an edge therefore find the same bits for its column. In
one row the segments of a closed mesh join into closed polygons, directed from the edge that goes up
the image to the one that goes down. Every pixel that such a polygon passes to the right it passes
to the left as well: the signs of the crossings before a camera outside the volume add up to exactly
0, before one inside it to exactly 1.

Over a triangle w/z, the inverse depth, is linear in the image, and so it is along a span: it is
found at the span's first and last pixel, as a combination of both ends with weights of 0 or more,
and interpolated between the two. No determinant is divided by, and slivers do no harm.

References
----------
Billeter, Sintorn, Assarsson 2010, *Real time volumetric shadows using polygonal light volumes*, HPG
2010. Olano, Greer 1997, *Triangle scan conversion using 2D homogeneous coordinates*, Graphics
Hardware.

**The airlight of a light volume:** a signed sum over the crossings of
camera rays with its boundary.

With J(x) the airlight of a lit ray up to x, a ray has the airlight sum_k s_k J(x_k), s = +1 where
it leaves the light and -1 where it enters it (Billeter, Sintorn, Assarsson 2010, eq. 3). The order
does not matter. The visible surface is at D, and crossings behind it count as crossings at D.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, fields, replace
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from airlight.realtime.methods.interface.method import View
from airlight.realtime.methods.published.billeter2010.mesh import VolumeMesh
from airlight.realtime.rays import RayGeometry
from airlight.realtime.scene.camera import Camera, ray_directions, read_camera
from airlight.realtime.scene.lights import Light
from airlight.realtime.scene.media.medium import LitRays


@dataclass(frozen=True)
class Crossings:
    """Crossings of camera rays with a mesh, one an entry."""

    pixel: Any  #: row times width plus column
    distance: Any  #: along the ray, 0 or more, may be infinite; float64 [m]
    sign: Any  #: +1 along the triangle's normal, -1 against it; float64


@dataclass(frozen=True)
class _Spans:
    """Pixels of one row that one triangle covers."""

    count: Any  #: pixels; 0 where the triangle covers none
    pixel: Any  #: the first
    sign: Any  #: as in `Crossings`
    inverse: Any  #: inverse depth at the first pixel [1/m]
    step: Any  #: change of the inverse depth from pixel to pixel [1/m]


def signed_crossings(
    mesh: VolumeMesh, camera: Camera, *, batch: int = 1 << 22
) -> Iterator[Crossings]:
    """Yield the crossings of the rays through all pixels with the triangles of a mesh.

    `mesh`: the mesh; vertices at infinity are as good as any; `camera`: the camera; pixels are
    points at the centres of squares; `batch`: triangles, rows of triangles, and crossings that are
    in memory at a time; the default takes some 0.3 GB.

    Valid for any mesh. For a closed one the signs of the crossings of each pixel add up to 0, or to
    1 where the camera is inside and normals point out. With a camera on the mesh either sum may
    come out, and nothing else goes wrong. The yielded arrays are not evaluated: what the caller
    does with them becomes one kernel with the expansion of the spans.
    """
    screen = _project(mesh.vertices, camera)
    for begin in range(0, len(mesh.triangles), batch):
        corners = mi.UInt32(
            np.ascontiguousarray(mesh.triangles[begin : begin + batch], dtype=np.uint32).ravel()
        )
        # Triangles become rows, rows become spans, spans become pixels; each step may make more
        # lanes than it got, and is cut into batches of its own.
        triangle, first, rows = _rows(screen, corners, camera)
        for owner, rank in _expand(rows, batch):
            spans = _spans(screen, corners, camera, (triangle, first), owner, rank)
            for span, column in _expand(spans.count, batch):
                yield _crossings(spans, camera, span, column)


def _opaque(values):
    """Return a vector whose value no kernel knows, so that no kernel is compiled again when
    the value changes.
    """
    return mi.Vector3d(*(dr.opaque(mi.Float64, float(component)) for component in values))


def _project(vertices, camera: Camera):
    """Return (a, b, z, w) of all vertices, one after the other, in float64."""
    # The rows of the inverse basis give a point's coordinates along the view, to the left and up.
    # Column 0 is on the left, row 0 above, and the middle of the image on the axis.
    host = read_camera(camera)
    depth, left, up = np.linalg.inv(host.basis)
    to_column, to_row = (
        0.5 * (camera.width - 1) * depth - left,
        0.5 * (camera.height - 1) * depth - up,
    )
    vertices = np.ascontiguousarray(vertices, dtype=np.float64)
    number = dr.arange(mi.UInt32, len(vertices))
    vertex = dr.gather(mi.Vector4d, mi.Float64(vertices.ravel()), number)
    # P w - origin w: the vector from the camera, in homogeneous coordinates.
    offset = dr.fma(_opaque(-host.origin), vertex.w, mi.Vector3d(vertex.x, vertex.y, vertex.z))
    projected = [dr.dot(_opaque(line), offset) for line in (to_column, to_row, depth)]
    screen = dr.empty(mi.Float64, 4 * len(vertices))
    dr.scatter(screen, mi.Vector4d(*projected, vertex.w), number)
    dr.eval(screen)
    return screen


def _corners(screen, corners, triangle):
    """Return the corners (a, b, z, w) of triangles."""
    number = [dr.gather(mi.UInt32, corners, 3 * triangle + k) for k in range(3)]
    return [dr.gather(mi.Vector4d, screen, corner) for corner in number]


def _rows(screen, corners, camera: Camera):
    """Return the triangles that may cover pixels, the first row of each, and
    how many rows it may cover.
    """
    # The bounding box of each triangle in the image; a triangle beside the image is left out here.
    vertices = _corners(screen, corners, dr.arange(mi.UInt32, dr.width(corners) // 3))
    depth = [v.z for v in vertices]
    column0, column1 = _pixel_range([v.x for v in vertices], depth, camera.width)
    row0, row1 = _pixel_range([v.y for v in vertices], depth, camera.height)
    count = dr.select(column0 < column1, row1 - row0, 0)
    dr.eval(row0, count)
    triangle = dr.compress(count > 0)
    return triangle, dr.gather(mi.UInt32, row0, triangle), dr.gather(mi.UInt32, count, triangle)


def _pixel_range(values, depth, size: int):
    """Return first and end of the whole numbers that the part of triangles before the
    camera covers, or a few more.

    `values` over `depth` are coordinates in the image. A slack of 1e-6 pixel is far above rounding:
    what is left out here covers no pixel by the exact rule either.
    """
    # The corners before the camera, then the edges that pass the plane of the camera.
    low, high = mi.Float64(dr.inf), mi.Float64(-dr.inf)
    for value, z in zip(values, depth):
        at = value / z
        low, high = (
            dr.select(z > 0, dr.minimum(low, at), low),
            dr.select(z > 0, dr.maximum(high, at), high),
        )
    for k, m in ((0, 1), (1, 2), (2, 0)):
        # Where an edge passes z = 0 it leaves the image on the side of its value there, or on
        # both if that is unclear.
        cut = (depth[k] > 0) ^ (depth[m] > 0)
        from_k, from_m = values[k] * dr.abs(depth[m]), values[m] * dr.abs(depth[k])
        doubt = 1e-12 * (dr.abs(from_k) + dr.abs(from_m))
        low = dr.select(cut & (from_k + from_m <= doubt), -dr.inf, low)
        high = dr.select(cut & (from_k + from_m >= -doubt), dr.inf, high)
    begin, end = (dr.clip(dr.ceil(edge), 0, size) for edge in (low - 1e-6, high + 1e-6))
    return mi.UInt32(begin), dr.maximum(mi.UInt32(end), mi.UInt32(begin))


def _expand(count, limit: int):
    """Yield (number, rank) for all ranks below count[number], number by number, at most
    about `limit` at a time.
    """
    if dr.width(count) == 0:
        return
    # Numbers with a count, and where their ranks end if all stand in one line.
    used = dr.compress(count > 0)
    ends = np.cumsum(np.array(dr.gather(mi.UInt32, count, used)), dtype=np.int64)
    begin = before = 0
    while begin < len(ends):
        # A count above the limit comes alone; it is the width or the height of an image at most.
        end = max(begin + 1, int(np.searchsorted(ends, before + limit, side="right")))
        starts = np.concatenate(([before], ends[begin : end - 1])) - before
        start = mi.UInt32(starts.astype(np.uint32))
        # A mark where each number begins: the marks up to a lane say which number it has.
        mark = dr.zeros(mi.UInt32, int(ends[end - 1] - before))
        dr.scatter(mark, mi.UInt32(1), start)
        here = dr.cumsum(mark) - 1
        number = dr.gather(mi.UInt32, used, here + begin)
        yield number, dr.arange(mi.UInt32, dr.width(mark)) - dr.gather(mi.UInt32, start, here)
        begin, before = end, int(ends[end - 1])


def _spans(screen, corners, camera: Camera, row_ranges, owner, rank) -> _Spans:
    """Return the pixels that triangles cover in rows, by the rule of the module."""
    # Each lane is one row of one triangle.
    triangle, first = (dr.gather(mi.UInt32, values, owner) for values in row_ranges)
    row = first + rank
    down, up = _row_segment(_corners(screen, corners, triangle), mi.Float64(row))
    # The pixels between both crossings, left <= column < right; none where both are behind the
    # camera.
    columns = [
        _first_right_of(leading, trailing, camera.width)
        for leading, trailing in ((down, up), (up, down))
    ]
    begin, end = dr.minimum(*columns), dr.maximum(*columns)
    count = dr.select((down.z > 0) | (up.z > 0), end - begin, 0)
    up_is_left = columns[1] < columns[0]
    left, right = dr.select(up_is_left, up, down), dr.select(up_is_left, down, up)
    # w/z is linear along the span: its values at the first and the last pixel.
    inverse = _inverse_depth(left, right, mi.Float64(begin))
    inverse_at_end = _inverse_depth(left, right, mi.Float64(end - 1))
    step = (inverse_at_end - inverse) / dr.maximum(mi.Float64(count) - 1, 1)
    # Seen from behind the normal, a triangle goes down on its right.
    handedness = float(np.sign(np.linalg.det(read_camera(camera).basis)))
    sign = dr.select(up_is_left, mi.Float64(handedness), -handedness)
    spans = _Spans(mi.UInt32(count), row * camera.width + mi.UInt32(begin), sign, inverse, step)
    dr.eval(spans.count, spans.pixel, spans.sign, spans.inverse, spans.step)
    return spans


def _row_segment(vertices, row):
    """Return where triangles cross the plane of a row: on the edges that go down and up the
    image; z = 0 if nowhere.
    """
    # f = b - j z of the vertices; the fused step has its sign exactly. Rows grow down the image.
    side = [dr.fma(-row, v.z, v.y) for v in vertices]
    below = [f > 0 for f in side]
    # The vertex that is alone on its side of the row is at the end of both edges.
    alone = [below[1] == below[2], below[2] == below[0]]

    def pick(values):
        return dr.select(alone[0], values[0], dr.select(alone[1], values[1], values[2]))

    # That vertex, and the other two in the order of the triangle.
    vertex, after, before = ([*vertices[k:], *vertices[:k]] for k in range(3))
    f, f_after, f_before = ([*side[k:], *side[:k]] for k in range(3))
    single = pick(vertex), pick(f)
    other = pick(after), pick(f_after)
    third = pick(before), pick(f_before)
    is_below = single[1] > 0
    crossed = (below[0] != below[1]) | (below[1] != below[2])

    # C = f_A B - f_B A, with A below the row and B above, whatever the order in the triangle: both
    # triangles of an edge find the same bits.
    def cross(end):
        above, under = (
            dr.select(is_below, x, y) for x, y in ((end[0], single[0]), (single[0], end[0]))
        )
        weight, other_weight = (
            dr.select(is_below, single[1], end[1]),
            -dr.select(is_below, end[1], single[1]),
        )
        return dr.select(crossed, dr.fma(above, weight, under * other_weight), mi.Vector4d(0))

    # The edge that leaves a vertex below the row goes up the image, the edge that arrives down.
    leaving, arriving = cross(other), cross(third)
    return dr.select(is_below, arriving, leaving), dr.select(is_below, leaving, arriving)


def _first_right_of(point, other, width: int):
    """Return the first column right of or at one end of a segment in the plane of
    a row, from 0 to `width`.
    """
    # An end behind the camera is as far to the side as the segment passes z = 0.
    edge = dr.select(other.x * -point.z + point.x * other.z >= 0, mi.Float64(dr.inf), -dr.inf)
    return mi.Int32(dr.clip(dr.ceil(dr.select(point.z > 0, point.x / point.z, edge)), 0, width))


def _inverse_depth(left, right, column):
    """Return w/z where the segment between two points of a row passes a column."""
    # Between left and right both are 0 or more; rounding must not take them below.
    of_left = dr.maximum(dr.fma(-column, right.z, right.x), 0)
    of_right = dr.maximum(dr.fma(column, left.z, -left.x), 0)
    # Both ends in one column: the mean of them.
    nowhere = (of_left + of_right) == 0
    of_left, of_right = dr.select(nowhere, 1, of_left), dr.select(nowhere, 1, of_right)
    depth = dr.fma(of_left, left.z, of_right * right.z)
    return dr.fma(of_left, left.w, of_right * right.w) / dr.maximum(depth, 1e-300)


def _crossings(spans: _Spans, camera: Camera, span, step) -> Crossings:
    """Return the crossings of pixels: the span of each, and how many
    pixels come before it there.
    """
    # Depth is along the view: the distance along the ray is longer by the norm of its direction,
    # which has depth 1. An inverse depth of 0 is a crossing at infinity.
    pixel = dr.gather(mi.UInt32, spans.pixel, span) + step
    first, change, sign = (
        dr.gather(mi.Float64, column, span) for column in (spans.inverse, spans.step, spans.sign)
    )
    inverse = dr.maximum(dr.fma(mi.Float64(step), change, first), 0)
    return Crossings(pixel, dr.norm(ray_directions(camera, pixel)[1]) / inverse, sign)


def crossing_sum(
    batches: Iterable[Crossings], airlight: LitRays, distance, *, lane: Any = None
) -> Any:
    """Return J along the lit parts of rays, the signed sum over their crossings [1/m].

    `batches`: from `realtime.methods.published.billeter2010.raster.signed_crossings`; `airlight`,
    `distance`: the rays with the light, whose cone clips every crossing, and the distances to the
    visible surface [m]; `lane`: by pixel number its entry among the rays; None where they are in
    the order of the image.

    Valid for a closed mesh. With eq. 3 as it stands, every crossing beyond the light has the large
    airlight about the light, and what rounding leaves of it where they cancel is visible. As J(0,
    x) = J(0, D) - J(x, D), the sum is also

        n J(0, D) + sum_{x_k < foot} s_k J(0, x_k) - sum_{foot <= x_k < D} s_k J(x_k, D),

    with n the sum of the signs of the crossings at or beyond the foot, or at the surface: a whole
    number, 1 where the point next to the light is lit and 0 where it is not. No other term contains
    the airlight about the light, and crossings at the surface cost nothing. Terms have the
    precision of the rays and are added up in float64.
    """
    # `total` is J by ray, `beyond` is n by ray.
    Float, geometry = type(distance), airlight.geometry
    zero = airlight.nothing(1)
    total = dr.zeros(mi.Color3d if dr.depth_v(zero) > 1 else mi.Float64, dr.width(distance))
    beyond = dr.zeros(mi.Float64, dr.width(distance))

    # Add sign J(x0, x1) to the rays of some numbers.
    def add(index, x0, x1, sign):
        # All calls then share one kernel; compiling it takes longer than running it.
        dr.eval(index, x0, x1, sign)
        columns = (getattr(geometry, field.name) for field in fields(RayGeometry))
        rays = RayGeometry(
            *(None if column is None else dr.gather(Float, column, index) for column in columns)
        )
        term = replace(airlight, geometry=rays).airlight(x0, x1)
        dr.scatter_add(total, type(total)(term) * sign, index)
        dr.eval(total)

    for crossings in batches:
        # n counts the crossings at or beyond the foot, and at the surface.
        index = crossings.pixel if lane is None else dr.gather(mi.UInt32, lane, crossings.pixel)
        x, sign = Float(crossings.distance), crossings.sign
        in_front = x < dr.gather(Float, distance, index)
        is_beyond = ~in_front | (x >= dr.gather(Float, geometry.foot, index))
        dr.scatter_add(beyond, sign, index, is_beyond)
        dr.eval(beyond, index, x, sign, in_front)
        # Crossings behind the surface add nothing else.
        some = dr.compress(in_front)
        if dr.width(some) == 0:
            continue
        index, x, sign = (dr.gather(type(values), values, some) for values in (index, x, sign))
        # Before the foot s J(0, x), from the foot on -s J(x, D).
        near = x < dr.gather(Float, geometry.foot, index)
        end = dr.select(near, x, dr.gather(Float, distance, index))
        add(index, dr.select(near, 0, x), end, dr.select(near, sign, -sign))
    # n J(0, D) for the rays whose n is not 0.
    whole = dr.compress(beyond != 0)
    if dr.width(whole):
        camera = dr.opaque(Float, 0, dr.width(whole))
        add(whole, camera, dr.gather(Float, distance, whole), dr.gather(mi.Float64, beyond, whole))
    return type(zero)(total)


def mesh_airlight(view: View, light: Light, mesh: VolumeMesh, *, kernel):
    """Return the airlight of one light by the triangles of its light volume [W/(m^2 sr)].

    `view`: the frame, with a ray for every pixel of its camera; `light`: the light; `mesh`: its
    light volume, closed; `kernel`: an airlight kernel.

    Valid for homogeneous media that fill all space. The number of crossings is counted on the way:
    not for a frozen function.

    Billeter, Sintorn, Assarsson 2010, eq. 3.
    """
    airlight = view.lit_by(light, kernel)
    # Crossings are found pixel by pixel, in the order of the image; rays may have another order.
    lane = dr.zeros(mi.UInt32, view.camera.width * view.camera.height)
    dr.scatter(lane, dr.arange(mi.UInt32, dr.width(view.pixel)), view.pixel)
    distance = view.distance
    dr.eval(airlight.geometry, lane, distance)  # every crossing reads them
    crossings = signed_crossings(mesh, view.camera)
    return airlight.radiance(crossing_sum(crossings, airlight, distance, lane=lane))
