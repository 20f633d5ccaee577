# SPDX-License-Identifier: BSD-3-Clause
r"""Which shadow planes a camera ray crosses, found by its azimuth about the axis from
the light to the camera.

Put the light S at the origin and the camera O on the z axis, at the distance D. A camera ray lies
in a half plane that the z axis bounds, at the azimuth phi; there it has the direction (sin g, cos
g) of (radius, height), g being its angle with the axis. A shadow plane contains S, so in that half
plane it is a half line from S; the angle between it and the axis is psi, the same angle by whose
cosine Biri orders the planes (section 5.1.4). Along the ray psi grows from 0.

A silhouette edge, a straight line, meets the half plane phi at radius c and height z with

    1/c = P cos(phi) + Q sin(phi),        z/c = cot(psi) = A cos(phi) + B sin(phi),

because its projection along z is the line P x + Q y = 1, and the plane through S and the edge z = A
x + B y. The ray point O + x w lies on the half line (c, z) where (x sin g, D + x cos g) is parallel
to it:

    x = D / (sin g cot(psi) - cos g),     and it is beyond the edge, so in its shadow plane, if x sin g / c > 1.

**A light at infinity.** With the light in the direction -a the axis through the camera along a
takes the place of the line from the light to the camera: put the camera O at the origin and a on
the z axis. A shadow plane contains the direction a, so in the half plane phi it is a half line
parallel to the axis, at the radius c of its edge, from the edge's height z on. With P, Q, A and B
of the edge as above, but heights from the camera on, the ray point x w lies on it where x sin g =
c,

    1/x = P w_x + Q w_y,     and it is beyond the edge if x cos g > z, thus w_z > A w_x + B w_y.

It is the limit of the above as D goes to infinity, where z is D more and both sides of 1/x are
divided by D. Along the ray the radius c grows from 0 as psi does, and c takes the place of psi: in
the order within an azimuth, in the layers gained, and in the order of the paper, which is by the
middles of edges (cos psi = 1 - c^2/(2 D^2) + ...). An edge along the light is a point there,
without azimuths to span, and no plane; a ray along the light crosses none.

In both cases a plane has four numbers. Two of them give the quotient q, D/x or 1/x, which is
positive ahead of the camera and falls along the ray. `plane_crossing` is the one place where they
differ on the device.

Four numbers an edge, no division but one, and no test of depth against a triangle.

**Wedges.** Only edges whose azimuths hold phi count. A *wedge* is a range of azimuths about the
axis, narrower than most planes: its list holds the planes at its azimuths and few others, and
serves every ray there, so that nothing is sorted for a frame.

**Order.** In a half plane of one azimuth phi all rays cross planes in one order: by psi, hence
by c = A cos(phi) + B sin(phi), from large to small (w = 0: P and Q). A wedge is in the order of its
middle; where that is wrong for a ray the walk notices (`realtime.methods.shadow_planes.sweep`).

**End.** With (w_x, w_y) = sin g (cos phi, sin phi) a plane is crossed at D/x = c sin g - cos g, so
before the ray ends at x_end only if

    c > (D/x_end + cos g)/sin g          (w = 0: c > 1/(x_end sin g)).

Over a wedge of the angle d, c = R cos(phi - phi_0) is at most the larger of its values at both
ends, over cos(d) where that is positive: phi_0 may lie between them. The largest such bound of an
entry and all behind it falls along the list. A search by halves finds where it falls below the
least c that a ray asks for, and there the list ends for the ray.

Azimuths are diamond angles (`realtime.numerics.functions`), 0 to 4 for a full turn. Two edges that
share a vertex share its azimuth bit by bit, and an edge holds phi if first <= phi < last: no ray
slips between two edges of a loop, and none is counted twice.
"""

from dataclasses import dataclass, fields, replace
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from airlight.errors import InputError
from airlight.realtime.methods.shadow_planes.silhouettes import Silhouette, silhouette
from airlight.realtime.numerics.array_types import ArrayTypes, four_numbers, is_single
from airlight.realtime.numerics.functions import TURN, host_diamond_angle, host_direction
from airlight.realtime.scene.lights import place_and_weight
from airlight.realtime.scene.mesh_adjacency import Occluders

Array = NDArray[np.float64]

# An entry of a list: the number of a plane, the layers gained beyond it, and a mark.
NUMBER = (1 << 24) - 1
GAIN_SHIFT, GAIN_ZERO = 24, 32  #: gains from -31 to 31
FULL = 1 << 30  #: the plane is at all azimuths of the wedge

_SLACK = 1e-5  # of the terms of a sum: float32 rounding, with room to spare


@dataclass(frozen=True)
class PlaneIndex:
    """The shadow planes of one light as a frame needs them; Dr.Jit arrays, padded so that
    their sizes seldom change.
    """

    axes: tuple[Any, Any, Any]  #: of the frame of `LightBasis`, in float64
    distance: Any  #: D, from the light to the camera [m]; w = 0: 1
    start: Any  #: first place in `entries` of every wedge, and the end of the last
    entries: Any  #: the planes of wedge after wedge
    bounds: Any  #: the largest c of an entry and of those behind it in its wedge
    scale: Any  #: wedges in a unit of azimuth
    lines: Any  #: A, B, P [1/m], Q [1/m] of every plane, flat; w = 0: P, Q, A, B
    spans: Any  #: first and last azimuth of every plane, flat
    layers: Any  #: layers between the light and the camera
    w: int = 1  #: last coordinate of the light's homogeneous position


@dataclass(frozen=True)
class Planes:
    """Shadow planes in NumPy, before they are put in order."""

    lines: Array  #: (planes, 4)
    first: NDArray[np.float32]
    last: NDArray[np.float32]
    gain: NDArray[np.int32]  #: layers gained when psi grows past it
    edge: NDArray[np.int64]  #: number of the edge that it is made of


@dataclass(frozen=True)
class LightBasis:
    """The frame of a light and a camera: the z axis leads from the light to the
    camera, or along the light.
    """

    axes: Array  #: x, y and z as rows, (3, 3)
    distance: float  #: D, between light and camera [m]; w = 0: 1
    origin: Array  #: of the frame: the light, or the camera where the light is at infinity [m]
    w: int  #: last coordinate of the light's homogeneous position

    def coordinates(self, points: Array) -> Array:
        """Return points (..., 3) in the frame [m]."""
        return (points - self.origin) @ self.axes.T


def light_basis(light: Array, camera: Array) -> LightBasis:
    """Return the frame of a light, a homogeneous position (4,) or a
    place (3,), and a camera [m].
    """
    l, w = place_and_weight(light)  # noqa: E741
    axis = w * camera - l
    distance = float(np.linalg.norm(axis))
    z = axis / distance if distance > 0 else np.array([0.0, 0.0, 1.0])
    # The axis to which z is least parallel gives an x across it without cancelling.
    helper = np.eye(3)[np.argmin(np.abs(z))]
    x = np.cross(helper, z)
    x /= np.linalg.norm(x)
    return LightBasis(
        np.stack([x, np.cross(z, x), z]), distance if w else 1.0, l if w else camera, w
    )


def shadow_planes(occluders: Occluders, edges: Silhouette, basis: LightBasis) -> Planes:
    """Return the shadow planes of silhouette edges in the frame of a light and a camera."""
    return edge_planes(
        basis.coordinates(occluders.vertices[edges.edges]), edges.coefficient, w=basis.w
    )


def edge_planes(vertices: Array, coefficient: NDArray[np.int32], *, w: int = 1) -> Planes:
    """Return the shadow planes of edges in the frame, ends (edges, 2, 3), with their coefficients.

    Edges that are a point as the light sees them have none.
    """
    a, b = vertices[:, 0], vertices[:, 1]
    azimuth = host_diamond_angle(
        vertices[..., 0].astype(np.float32), vertices[..., 1].astype(np.float32)
    )
    turn = azimuth[:, 1] - azimuth[:, 0]
    # The short way about the axis; `ahead` if azimuth grows from a to b along it.
    ahead = np.where(np.abs(turn) <= TURN / 2, turn > 0, turn < 0)
    first = np.where(ahead, azimuth[:, 0], azimuth[:, 1])
    last = np.where(ahead, azimuth[:, 1], azimuth[:, 0])
    # As the light sees it, with the camera's end of the axis up, azimuth grows to the left and psi
    # downwards: the layers left of an edge that leads to the left lie below it, at larger psi.
    gain = np.where(ahead, coefficient, -coefficient)
    cross = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    # The edge meets the axis itself: any tiny number keeps the loop closed.
    cross = np.where(
        cross == 0, 1e-12 * np.linalg.norm(a, axis=1) * np.linalg.norm(b, axis=1), cross
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        lines = np.stack(
            [
                (a[:, 2] * b[:, 1] - a[:, 1] * b[:, 2]) / cross,
                (a[:, 0] * b[:, 2] - a[:, 2] * b[:, 0]) / cross,
                (b[:, 1] - a[:, 1]) / cross,
                (a[:, 0] - b[:, 0]) / cross,
            ],
            axis=1,
        )
    # At infinity P and Q give the quotient 1/x and stand first: both cases read the same four
    # numbers.
    if not w:
        lines = lines[:, [2, 3, 0, 1]]
    spans_azimuths = (first != last) & np.all(np.isfinite(lines), axis=1)
    return _chosen(Planes(lines, first, last, gain, np.arange(len(a))), spans_azimuths)


def wedge_lists(
    planes: Planes, *, rank: Array | None = None
) -> tuple[NDArray[np.uint32], NDArray[np.uint32], Array, np.float32]:
    """Return first places, entries, bounds and scale of the wedges of planes, as
    of `PlaneIndex`, in NumPy.

    Parameters
    ----------
    planes
        The planes, none across azimuth 0.
    rank
        By plane: a list begins with the least; None: as rays in the middle of the wedge cross them.

    Raises
    ------
    InputError
        For more planes, or larger gains, than an entry has room for.
    """
    gain = np.abs(planes.gain.astype(np.int64)).max(initial=0)
    if len(planes.gain) > NUMBER + 1 or gain >= GAIN_ZERO:
        raise InputError(
            f"a light has {len(planes.gain)} shadow planes of up to {gain} layers; expected up to "
            f"{NUMBER + 1} of {GAIN_ZERO - 1}: use simpler occluders, or light-volumes"
        )

    # A wedge lists every plane that it meets. There are so many wedges that a plane spans at least
    # four on average: then lists are up to a quarter longer than the planes at one azimuth.
    fine, least, most = 4, 1 << 6, 1 << 16
    span = np.minimum(planes.last, TURN) - np.maximum(planes.first, 0)
    count = (
        int(np.clip(2 ** np.ceil(np.log2(fine * TURN / np.mean(span))), least, most))
        if len(span)
        else least
    )
    scale = np.float32(count / TURN)
    plane, wedge = _in_wedges(planes, scale, count)

    # c = A cos(phi) + B sin(phi): in the middle of a wedge for the order, and at both of
    # its borders for the end.
    borders, middles = (
        host_direction((np.arange(count + 1) + step) / float(scale)).T for step in (0.0, 0.5)
    )
    a, b = planes.lines[:, :2].T
    at_middle = [form[plane] * way[wedge] for form, way in zip((a, b), middles)]
    at_low, at_high = (
        a[plane] * borders[0][end] + b[plane] * borders[1][end] for end in (wedge, wedge + 1)
    )
    place = np.lexsort((-(at_middle[0] + at_middle[1]) if rank is None else rank[plane], wedge))

    # The largest c in a wedge, divided by the cosine of its width where it may lie between the
    # borders; and of an entry and all behind it the largest.
    bound = np.maximum(at_low, at_high)
    cos_width = np.sum(borders[:, 1:] * borders[:, :-1], axis=0)
    bound = np.where(bound > 0, bound / cos_width[wedge], bound)
    bound += _SLACK * (np.abs(at_middle[0]) + np.abs(at_middle[1]))
    start = np.concatenate([[0], np.cumsum(np.bincount(wedge, minlength=count))])
    bound = _largest_behind(bound[place], start)

    # An entry packs the number of a plane, its gain, and whether it is at
    # all azimuths of the wedge.
    holds = (planes.first[plane] * scale <= wedge) & (planes.last[plane] * scale >= wedge + 1)
    gained = (planes.gain.astype(np.int64) + GAIN_ZERO) << GAIN_SHIFT
    entries = (plane + gained[plane] + FULL * holds).astype(np.uint32)
    return start.astype(np.uint32), entries[place], bound, scale


def _in_wedges(
    planes: Planes, scale: np.float32, count: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return every pair of a plane and a wedge that it meets.

    `count` of the wedges is a power of two: then a ray and a plane round alike.
    """
    low = np.maximum((planes.first * scale).astype(np.int64), 0)
    high = np.minimum((planes.last * scale).astype(np.int64), count - 1)
    # Plane n is repeated once for each of its wedges, which are counted on from its first one.
    width = high - low + 1
    plane = np.repeat(np.arange(len(width)), width)
    return plane, np.arange(len(plane)) - np.repeat(np.cumsum(width) - width, width) + low[plane]


def _largest_behind(values: Array, start: NDArray[np.int64]) -> Array:
    """Return for each value of a run the largest of the values from it to the end of the run;
    `start` is where runs begin.
    """
    # Runs one after another, from the last: a number that grows by more than the values
    # from run to run parts them.
    run = np.repeat(np.arange(len(start) - 1), np.diff(start))
    order = np.argsort(values)
    rank = np.empty(len(values), dtype=np.int64)
    rank[order] = np.arange(len(values))
    largest = np.maximum.accumulate((rank - run * len(values))[::-1])[::-1] + run * len(values)
    return values[order[largest]]


def parted(planes: Planes) -> Planes:
    """Part the planes that hold azimuth 0 in two, one that ends beyond 4 and
    one that begins below 0.
    """
    # A plane that holds azimuth 0 begins beyond where it ends.
    around = planes.first > planes.last
    if not around.any():
        return planes
    above = _chosen(planes, around)
    return _joined(
        replace(planes, first=np.where(around, np.float32(-1), planes.first)),
        replace(above, last=np.full_like(above.last, 5)),
    )


def _chosen(planes: Planes, which: NDArray[np.bool_]) -> Planes:
    return Planes(*(getattr(planes, field.name)[which] for field in fields(Planes)))


def _joined(first: Planes, second: Planes) -> Planes:
    return Planes(
        *(
            np.concatenate([getattr(part, field.name) for part in (first, second)])
            for field in fields(Planes)
        )
    )


def layers_between(
    occluders: Occluders, light: Array, basis: LightBasis, *, used: NDArray[np.bool_]
) -> int:
    """Return how many layers lie between a light and the camera of their basis.

    A closed component counts the larger number of its triangles that face the light and that are
    averted: the two differ where the light or the camera is inside, and then all beyond is dark.
    `used` says which components count.
    """
    l, w = place_and_weight(light)  # noqa: E741
    axes = basis.axes
    if w:
        # From the light at u = 0 to the camera at u = 1.
        start, camera = l, l + basis.distance * axes[2]
        direction, reach, far = camera - start, (0.0, 1.0), l
    else:
        # From the light at u = -infinity to the camera at u = 0.
        start = camera = basis.origin
        direction, reach = axes[2], (-np.inf, 0.0)
        far = np.where(direction == 0, camera, -np.copysign(np.inf, direction))

    # The line meets the boxes of few components, and of those few triangles lie about it.
    low, high = occluders.boxes[:, 0], occluders.boxes[:, 1]
    near = used & np.all(
        (low <= np.maximum(far, camera)) & (high >= np.minimum(far, camera)), axis=1
    )
    if not near.any():
        return 0
    number = np.flatnonzero(near[occluders.component])
    number = number[_beside_axis(occluders, number, start, axes)]
    if not len(number):
        return 0

    # Triangles that the line crosses, by component: how many face the light and how many are
    # averted.
    crossed = number[_crosses(occluders, number, (start, direction), reach)]
    sign = np.sign(occluders.normals[crossed] @ l - w * occluders.offsets[crossed])
    component = occluders.component[crossed]
    components = len(occluders.closed)
    front, back = (
        np.bincount(component[sign > 0], minlength=components),
        np.bincount(component[sign < 0], minlength=components),
    )
    return int(np.where(occluders.closed, np.maximum(front, back), front + back).sum())


def _beside_axis(occluders: Occluders, number, start: Array, axes: Array) -> NDArray[np.bool_]:
    """Return whether triangles may meet the axis through `start`.

    The axis is x = y = 0. Most triangles lie beside it: all three corners are on one of four sides.
    """
    x, y = axes[:2] @ occluders.vertices.T - (axes[:2] @ start)[:, None]
    sides = (
        (x > 0)
        | (x < 0).view(np.uint8) << 1
        | (y > 0).view(np.uint8) << 2
        | (y < 0).view(np.uint8) << 3
    )
    first, second, third = occluders.triangles[number].T
    return np.asarray(sides[first] & sides[second] & sides[third] == 0)


def _crosses(
    occluders: Occluders, number, line: tuple[Array, Array], reach: tuple[float, float]
) -> NDArray[np.bool_]:
    """Return whether triangles are crossed by start + u direction with u
    between two bounds, watertight.

    The line crosses a triangle if it passes all three edges on the same side. d . (a x b) of an
    edge is computed from its lower vertex number to its higher one, so that both triangles at an
    edge see the same rounding.
    """
    start, direction = line
    triangle = occluders.triangles[number]
    sides = []
    for k in range(3):
        tail, head = triangle[:, k], triangle[:, (k + 1) % 3]
        low, high = (
            occluders.vertices[end(tail, head)] - start for end in (np.minimum, np.maximum)
        )
        # The side of an edge turns round with the direction in which the triangle runs along it.
        left = np.cross(low, high) @ direction >= 0
        sides.append(np.where(tail < head, left, ~left))
    inside = (sides[0] == sides[1]) & (sides[1] == sides[2])
    # The plane normal . p = offset is met at start + u direction.
    normal, offset = occluders.normals[number], occluders.offsets[number]
    with np.errstate(divide="ignore", invalid="ignore"):
        u = (offset - normal @ start) / (normal @ direction)
    return inside & (u > reach[0]) & (u < reach[1])


def index_planes(
    occluders: Occluders, light: Array, camera: Array, *, used: NDArray[np.bool_], types: ArrayTypes
) -> PlaneIndex:
    """Find the shadow planes of a light and put them into wedges for a camera.

    Parameters
    ----------
    occluders
        Triangles with their adjacency.
    light
        Homogeneous position of the light, (4,), or its place, (3,) [m].
    camera
        Position of the camera [m].
    used
        By component, whether its shadow can be seen.
    types
        The array types to use, see `realtime.numerics.array_types`.
    """
    basis = light_basis(light, camera)
    layers = layers_between(occluders, light, basis, used=used)
    planes = shadow_planes(occluders, silhouette(occluders, light, used=used), basis)
    return plane_index(parted(planes), basis, layers=layers, types=types)


def plane_index(
    planes: Planes, basis: LightBasis, *, layers: int, types: ArrayTypes, rank: Array | None = None
) -> PlaneIndex:
    """Return planes in wedges on the device.

    Parameters
    ----------
    planes, rank
        See `wedge_lists`.
    basis
        The frame of the planes.
    layers
        Between the light and the camera.
    types
        The array types to use.
    """
    start, entries, bounds, scale = wedge_lists(planes, rank=rank)
    Float = types.scalar
    index = PlaneIndex(
        tuple(mi.Vector3d(*(float(c) for c in axis)) for axis in basis.axes),
        Float(basis.distance),
        mi.UInt32(padded(start)),
        mi.UInt32(padded(entries, 3)),
        table_of(Float, bounds, 3),
        Float(float(scale)),
        table_of(Float, planes.lines, 5),
        table_of(Float, np.stack([planes.first, planes.last], axis=1), 7),
        Float(layers),
        basis.w,
    )
    dr.make_opaque(index)
    return index


def table_of(Float: type, values: Array, multiple: int) -> Any:
    """Return numbers on the device, flat, padded as by `padded`."""
    return Float(
        padded(values.astype(np.float32 if is_single(Float) else np.float64).ravel(), multiple)
    )


def planes_of_rays(index: PlaneIndex, azimuth, way, ray_end):
    """Return the place of the first plane of the wedges of rays, and how
    many of them they may cross.

    `index`: the planes; `azimuth`, `way`: of the rays: diamond angle, and unit direction in the
    frame, three arrays; `ray_end`: d/x at the end of each; w = 0: 1/x.
    """
    x, y, z = way
    # About a light at the camera an azimuth is no number: whole numbers have the upper bound. It
    # comes from an array, as the size of one would be a constant of the recording, whose next light
    # may have more wedges.
    wedge = dr.minimum(mi.UInt32(azimuth * index.scale), mi.UInt32(TURN * index.scale) - 1)
    first, last = (dr.gather(mi.UInt32, index.start, wedge + step) for step in (0, 1))
    # Crossed before the end: c > (D/x_end + cos g)/sin g, with some room for rounding, or at
    # infinity c > 1/(x_end sin g). An entry whose bound is less is not crossed, nor is any behind
    # it.
    least_c = dr.fma(-_SLACK, ray_end + 1, ray_end + z) if index.w else ray_end
    least_c *= dr.rsqrt(dr.fma(x, x, y * y))

    def halve(low, high):
        middle = (low + high) >> 1
        more = dr.gather(type(x), index.bounds, middle) > least_c
        return dr.select(more, middle + 1, low), dr.select(more, high, middle)

    low, _ = dr.while_loop(
        state=(first, +last), cond=lambda low, high: low < high, body=halve, labels=("low", "high")
    )
    return first, low - first


def plane_crossing(index: PlaneIndex, number, way, active):
    """Return where rays cross planes, as D/x (w = 0: 1/x), and whether that is beyond the edge.

    `index`: the planes; `number`: which of them; `way`: unit directions of rays in the frame, three
    arrays; `active`: lanes to read for.
    """
    x, y, z = way
    a, b, p, q = dr.gather(four_numbers(type(x)), index.lines, number, active)
    if not index.w:
        return dr.fma(a, x, b * y), dr.fma(p, x, q * y) < z
    # Beyond the edge, x sin g / c > 1: the quotient D/x is below D (P w_x + Q w_y).
    quotient = dr.fma(a, x, dr.fma(b, y, -z))
    return quotient, quotient < index.distance * dr.fma(p, x, q * y)


def padded(values, multiple: int = 1):
    """Return an array with zeros up to a power of two times `multiple`, aligned to 64 bytes.

    A frozen function is recorded again where arrays that had one size have two or the other way
    round, and where the alignment of an array is another; so each kind of array has its own
    multiple.
    """
    size = multiple << max(6, int(-(-len(values) // multiple) - 1).bit_length())
    room = np.zeros(size * values.itemsize + 64, dtype=np.uint8)
    begin = -room.ctypes.data % 64
    padded = room[begin : begin + size * values.itemsize].view(values.dtype)
    padded[: len(values)] = values
    return padded
