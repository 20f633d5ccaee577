# SPDX-License-Identifier: BSD-3-Clause
r"""Camera rays as a light sees them, from their pixels.

In the frame of `realtime.methods.shadow_planes.plane_table`, the light S at the origin and the camera at the distance
D on the z axis, the aim of a ray (`realtime.scene.camera`) is affine in its column c and row r,

    w(c, r) = w0 + (c - c0) w_c + (r - r0) w_r,

and (c0, r0) may be any pixel. It is the one next to the image of the light, where w_x and w_y vanish: then all terms
are as small as their sum there, and float32 keeps the digits that a difference of large numbers loses, in a dozen
operations. The three vectors come from the host, in float64. With the unit direction d = w/|w| and p^2 = d_x^2 + d_y^2
the foot of the perpendicular from the light is at -D d_z, and the height of the ray is D p.

**The cone of a spot** (`realtime.rays.spot_cone`), with the axis a, its part across the z axis m = (a_x, a_y), and the
sine s of the half angle:

    axial = a . d,     across = D (a_x d_y - a_y d_x),     offset = D (a_z p^2 - d_z (m . d)),

the last from the vector D (-d_z d_x, -d_z d_y, p^2) that leads from the light to the foot. The discriminant
h^2 s^2 - across^2 is D^2 times a quadratic form in (d_x, d_y). If |m| > s, the camera is outside the cone, the form has
two lines of zeros, where rays touch the cone, and is the product of

    (k m + q n) . d   and   (k m - q n) . d,     n = (-a_y, a_x),     k = s/|m|,     q = sqrt(1 - k^2),

for k^2 (m . d)^2 - q^2 (n . d)^2 = s^2 p^2 - (n . d)^2, since (m . d)^2 + (n . d)^2 = |m|^2 p^2. Otherwise it is

    (m . d)^2 + (s^2 - |m|^2) p^2,

a sum of positive terms. The linear forms are affine in the pixel like w. Where a ray touches the cone one is zero, and
the chord is the root of it: it is wanted to twice the digits. Columns and rows are whole numbers of some 12 bits, so
with coefficients of 11 bits, in units of one power of two, products and sums are exact; what the coefficients leave is
added.

**The normal of a light point** is like the axis of a spot: axial and offset, of `realtime.rays.ray_light`, follow from
it by the same formulas.
"""

from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import numpy as np
from numpy.typing import NDArray

from realtime.numerics.array_types import ArrayTypes, is_single
from realtime.numerics.host_numbers import host_numbers
from realtime.rays.ray_light import RayGeometry, before_plane
from realtime.rays.spot_cone import AxisGeometry, axis_distance, cone_roots
from realtime.scene.camera import Camera, HostCamera, row_and_column
from realtime.scene.lights import Light

Array = NDArray[np.float64]

_FAR = 4  # images beside the image that the light's may be away before it is as good as at infinity
_BITS = 11


@dataclass(frozen=True)
class Affine:
    """An affine function of the pixel, as numbers or vectors."""

    base: Any  #: at the reference pixel
    column: Any  #: growth by a column
    row: Any  #: growth by a row


@dataclass(frozen=True)
class Tangents:
    """The discriminant of a cone over D^2: the product of two linear forms, plus a share of p^2."""

    high: tuple[Affine, Affine]  #: of few bits
    low: tuple[Affine, Affine]
    share: Any


@dataclass(frozen=True)
class Aim:
    """Where pixels aim in the frame of a light; scalars and vectors of one entry."""

    column: Any  #: c0
    row: Any  #: r0
    way: Affine  #: w
    axis: Any = None  #: of a spot, or the normal of a light point
    cutoff: Tangents | None = None
    beam: Tangents | None = None  #: of a soft spot


@dataclass(frozen=True)
class SeenRay:
    """Rays as a light sees them."""

    x: Any  #: unit direction
    y: Any
    z: Any
    geometry: RayGeometry


@dataclass(frozen=True)
class HostSpot:
    """The axis of a spot and the sines of its half angles, or a normal alone, on the host, in float64."""

    axis: Array
    cutoff: float | None = None
    beam: float | None = None


def read_spot(light: Light) -> HostSpot | None:
    """Read the fields of a spot or a light point to the host; None for other lights."""
    if light.facing is not None:
        normal, low = host_numbers(light.facing.normal, light.facing.normal_low)
        return HostSpot(normal + low)
    if light.cone is None:
        return None
    cones = [cone for cone in (light.cone, light.beam) if cone]
    squares = [part for cone in cones for part in (cone.square_sin, cone.square_sin_low)]
    high, low, *parts = host_numbers(light.axis, light.axis_low, *squares)
    sines = [float(np.sqrt(parts[i][0] + parts[i + 1][0])) for i in range(0, len(parts), 2)]
    return HostSpot(high + low, *sines)


def aim_at(camera: HostCamera, axes: Array, spot: HostSpot | None, types: ArrayTypes) -> Aim:
    """Return where the pixels of a camera aim in the frame of a light.

    Parameters
    ----------
    camera, spot
        From `realtime.scene.camera.read_camera` and `read_spot`.
    axes
        Of the frame, rows; the last leads from the light to the camera.
    types
        Of the arrays.
    """
    column, row = _image_of(camera, -axes[2])
    middle = np.array([(camera.width - 1) / 2 - column, (camera.height - 1) / 2 - row])
    base = axes @ (camera.forward + middle[0] * camera.left + middle[1] * camera.up)
    across, down = -(axes @ camera.left), -(axes @ camera.up)
    way = Affine(*(types.vector(*(float(component) for component in vector)) for vector in (base, across, down)))
    place = types.scalar(column), types.scalar(row)
    if spot is None:
        return Aim(*place, way)
    axis = axes @ spot.axis
    in_frame = types.vector(*(float(component) for component in axis))
    if spot.cutoff is None:
        return Aim(*place, way, in_frame)
    vectors = [base, across, down]
    cutoff = _tangents(axis, spot.cutoff, vectors, types)
    beam = None if spot.beam is None else _tangents(axis, spot.beam, vectors, types)
    return Aim(*place, way, in_frame, cutoff, beam)


def seen_rays(aim: Aim, camera: Camera, pixel, distance, light: Light) -> SeenRay:
    """Return the rays through the centres of pixels, as a light sees them from a distance D.

    Parameters
    ----------
    aim
        From `aim_at`.
    camera, pixel
        The camera, and pixel numbers, row times width plus column.
    distance
        D [m].
    light
        A light; the `Aim` of a spot has its cones, that of a light point its normal.
    """
    c, r, w = _aimed(aim, camera, pixel)
    across_square = dr.fma(w.x, w.x, dr.square(w.y))
    scale = dr.rsqrt(dr.fma(w.z, w.z, across_square))
    x, y, z = w.x * scale, w.y * scale, w.z * scale
    foot, height = -distance * z, distance * scale * dr.sqrt(across_square)
    geometry = RayGeometry(foot, height)
    if light.facing is not None:
        geometry = before_plane(geometry, *_along_axis(aim, (x, y, z), distance))
    elif light.cone is not None:
        geometry = _in_cone(aim, (c, r), (x, y, z, scale), geometry, light=light, distance=distance)
    return SeenRay(x, y, z, geometry)


def _aimed(aim: Aim, camera: Camera, pixel):
    """Return column and row from the reference pixel on, and w."""
    Float = type(aim.column)
    row, column = row_and_column(camera, pixel)
    c, r = Float(column) - aim.column, Float(row) - aim.row
    return c, r, _at(aim.way, c, r)


def _along_axis(aim: Aim, way, distance):
    """Return `axial` and `offset` [m]."""
    x, y, z = way
    a = aim.axis
    square = dr.fma(x, x, dr.square(y))
    along = dr.fma(a.x, x, a.y * y)
    return dr.fma(a.z, z, along), distance * dr.fma(a.z, square, -z * along)


def _in_cone(aim: Aim, place, way, geometry: RayGeometry, *, light: Light, distance) -> RayGeometry:
    """Return a geometry with the fields that only a spot has."""
    x, y, z, scale = way
    a = aim.axis
    square = dr.fma(x, x, dr.square(y))
    axial, offset = _along_axis(aim, (x, y, z), distance)
    ray = AxisGeometry(
        axial=axial,
        offset=offset,
        height=geometry.height,
        square=dr.square(geometry.height),
        square_low=None,
        across=distance * dr.fma(a.x, y, -a.y * x),
        shift=None,
    )

    def interval(tangents: Tangents | None, cone):
        assert tangents is not None
        first_form, second_form = (
            _at(high, *place) + _at(low, *place) for high, low in zip(tangents.high, tangents.low)
        )
        form = dr.fma(first_form * scale, second_form * scale, tangents.share * square)
        enter, leave = cone_roots(ray, form * dr.square(distance), cone)
        return geometry.foot + enter, geometry.foot + leave

    enter, leave = interval(aim.cutoff, light.cone)
    seen = replace(geometry, axial=ray.axial, offset=ray.offset, enter=enter, leave=leave)
    if light.beam is None:
        return seen
    begin, end = interval(aim.beam, light.beam)
    return replace(seen, beam_enter=begin, beam_leave=end, **axis_distance(ray))


def _at(affine: Affine, column, row):
    return dr.fma(affine.column, column, dr.fma(affine.row, row, affine.base))


def _image_of(camera: HostCamera, direction: Array) -> tuple[float, float]:
    """Return the pixel next to the image of a direction and its opposite, which may be far beside the image."""
    sizes = np.array([camera.width, camera.height], dtype=float)
    ahead = direction @ camera.forward
    sides = np.array([direction @ axis / (axis @ axis) for axis in (camera.left, camera.up)])
    with np.errstate(divide="ignore", invalid="ignore"):
        place = np.nan_to_num((sizes - 1) / 2 - sides / ahead, nan=0.0, posinf=np.inf, neginf=-np.inf)
    column, row = np.round(np.clip(place, -_FAR * sizes, (_FAR + 1) * sizes))
    return float(column), float(row)


def _tangents(axis: Array, sine: float, vectors: list[Array], types: ArrayTypes) -> Tangents:
    m, n = axis[:2], np.array([-axis[1], axis[0]])
    size = float(np.linalg.norm(m))
    share = 0.0
    if size > sine:
        k = sine / size
        q = np.sqrt((1 - k) * (1 + k))
        forms = [k * m + q * n, k * m - q * n]
    else:
        forms, share = [m, m], (sine - size) * (sine + size)
    pairs = [_split(np.array([form @ vector[:2] for vector in vectors]), types) for form in forms]
    (high, low), (other_high, other_low) = pairs
    return Tangents((high, other_high), (low, other_low), types.scalar(share))


def _split(values: Array, types: ArrayTypes) -> tuple[Affine, Affine]:
    """Return an affine function of the pixel in two parts, the first of few bits."""
    largest = float(np.max(np.abs(values[1:])))
    unit = 2.0 ** (np.ceil(np.log2(largest)) - _BITS) if largest > 0 and is_single(types.scalar) else 1.0
    high = np.round(values / unit) * unit
    few, rest = (Affine(*(types.scalar(float(component)) for component in part)) for part in (high, values - high))
    return few, rest
