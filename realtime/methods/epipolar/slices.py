# SPDX-License-Identifier: BSD-3-Clause
"""Epipolar slices: half planes bounded by the line through camera and light, which cut the
image in straight lines.

With (i, j) counted in pixels to the left and up from the centre of the image, the ray through (i,
j) has the direction forward + i left + j up. The light, at v = l - w O from the camera O
(`realtime.scene.lights`: for w = 0 the direction to a light at infinity), has the homogeneous image
point

    (a, b, c) = (v . left / |left|^2,  v . up / |up|^2,  v . forward),

and every slice goes through the epipole E = (a/c, b/c), the light's image, or for c < 0 the image
of the point opposite. From X, sign(c) (a - i c, b - j c) points to E; no quotient is needed, so
that E may lie at infinity. A side of the image "faces away" from E if E lies on the inner side of
it. The sides that do are a connected part of the border: all four where E is in the image, one to
three otherwise. Slices leave the image at equal steps of length along them (Yusov 2013), and so
each pixel lies on one half line from E, which leaves the image at a place along the border.

In a slice e1 = -v/|v| leads from the light to the camera, or along the light, and e2 is at right
angles to it, on the side of the rays. With the light at the origin the rays of a slice start at (D,
0), D = |v|, and the angle of their points about the light grows from 0 to less than pi. Where the
light is at infinity the camera is the origin, D = 1, and the distance of their points from the axis
e1 grows from 0.
"""

from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import mitsuba as mi

from airlight.realtime.numerics.array_types import four_numbers
from airlight.realtime.scene.camera import Camera
from airlight.realtime.scene.lights import Light


@dataclass(frozen=True)
class Slices:
    """The slices of an image and a light; arrays of `count` entries unless one entry is noted."""

    count: int
    width: int  #: of the image [pixels]
    height: int  #: of the image [pixels]
    epipole: tuple[Any, Any, Any]  #: a, b, c, and all times -1 where c < 0; one entry each
    #: by side of the border, where it begins along the sides that face away, and whether it does
    sides: tuple[tuple[Any, Any], ...]
    length: Any  #: of the sides that face away [pixels], one entry
    closed: Any  #: whether all four do: after the last slice comes the first; one entry
    towards: Any  #: e1, one entry
    distance: Any  #: D [m], one entry; w = 0: 1
    away: Any  #: w = 0: from the position that stands for the light's to the camera [m], one entry
    w: int  #: last coordinate of the light's homogeneous position
    across: Any  #: e2
    #: i and j where a slice enters, or of E, and where it leaves: four numbers a slice [pixels]
    ends: Any


def image_slices(camera: Camera, light: Light, count: int) -> Slices:
    """Return the slices of an image.

    `camera`: the camera. `light`: any light, anywhere. Where it is in the pinhole, all half planes
    hold it; E is then the centre of the image. `count`: how many slices.

    Engelhardt, Dachsbacher 2010, *Epipolar sampling for shadows and crepuscular rays in
    participating media with single scattering*. Yusov 2013, *Practical implementation of light
    scattering effects using epipolar sampling and 1D min/max binary trees*.
    """
    # (a, b, c) of the docstring. A light in the pinhole has no direction; the view's own then
    # serves, whose E is the centre of the image.
    Float = type(camera.origin.x)
    v = light.toward(camera.origin)
    distance = dr.norm(v) if light.w else Float(1)
    v = dr.select(distance == 0, camera.forward, v)
    towards = -dr.normalize(v)
    a = dr.dot(v, camera.left) / dr.squared_norm(camera.left)
    b = dr.dot(v, camera.up) / dr.squared_norm(camera.up)
    c = dr.dot(v, camera.forward)
    # Times sign(c): then (a - i c, b - j c) points to E from any (i, j).
    epipole = tuple(dr.select(c < 0, -component, component) for component in (a, b, c))
    # The slices leave the image in the middles of `count` equal parts of the sides that face away,
    # and enter it at E, or where the half line from E crosses the border.
    sides, length, closed = _border(camera.width, camera.height, epipole)
    slices = Slices(
        count,
        camera.width,
        camera.height,
        epipole,
        sides,
        length,
        closed,
        towards,
        distance,
        away=None if light.w else camera.origin - light.position,
        w=light.w,
        across=None,
        ends=None,
    )
    place = (Float(dr.arange(mi.UInt32, count)) + 0.5) * (length / count)
    leave = _at_border(slices, place)
    enter = _entry(slices, *leave)
    # e2 lies on the side of the ray through the place where the slice leaves.
    out = camera.forward + camera.left * leave[0] + camera.up * leave[1]
    across = _at_right_angles(out, towards, camera)
    ends = dr.empty(Float, 4 * count)
    dr.scatter(ends, four_numbers(Float)(*enter, *leave), dr.arange(mi.UInt32, count))
    slices = replace(slices, across=across, ends=ends)
    dr.eval(slices)
    return slices


def pixel_number(slices: Slices, i, j):
    """Return the number, row times width plus column, of the pixel that holds a point
    (i, j), or of the nearest.
    """
    # The upper bounds are those of whole numbers: NaN becomes the largest of them.
    column = dr.minimum(mi.UInt32(dr.maximum(0.5 * slices.width - i, 0)), slices.width - 1)
    row = dr.minimum(mi.UInt32(dr.maximum(0.5 * slices.height - j, 0)), slices.height - 1)
    return row * slices.width + column


def slice_coordinate(slices: Slices, i, j):
    """Return the place of image points (i, j) [pixels] among the slices: 0 on the first, 1
    on the second, and so on.

    Beyond the first and the last it goes on to -1/2 and count - 1/2, where all four sides
    face away round the circle.
    """
    x, y = 0.5 * slices.width, 0.5 * slices.height
    di, dj = _towards_epipole(slices.epipole, i, j)
    # The half line from E leads along (-di, -dj) and leaves the image through the side that it
    # meets first: `to_i` steps reach the left or right side, `to_j` the top or bottom.
    to_i = dr.select(di < 0, x - i, x + i) / dr.abs(di)
    to_j = dr.select(dj < 0, y - j, y + j) / dr.abs(dj)
    t = dr.minimum(to_i, to_j)
    at_i, at_j = dr.clip(dr.fma(-t, di, i), -x, x), dr.clip(dr.fma(-t, dj, j), -y, y)
    first, second, third, fourth = (begin for begin, _ in slices.sides)
    # On that side, the length from where it begins, in the direction in which the border is gone
    # round: the left side up, the top to the right, the right side down, the bottom to the left.
    along_i = dr.select(di < 0, first + (at_j + y), third + (y - at_j))
    along_j = dr.select(dj < 0, second + (x - at_i), fourth + (at_i + x))
    # A point on E itself belongs to every slice: take any.
    here = (di == 0) & (dj == 0)
    place = dr.select(here, 0, dr.select(to_i <= to_j, along_i, along_j))
    return dr.clip(place, 0, slices.length) * (slices.count / slices.length) - 0.5


def neighbour(slices: Slices, number):
    """Return the slice of a whole number that may lie beyond the first or the last."""
    last = slices.count - 1
    # Numbers go round where all four sides face away; otherwise they end at the first and the last.
    round_ = dr.select(
        number < 0, number + slices.count, dr.select(number > last, number - slices.count, number)
    )
    return dr.minimum(mi.UInt32(dr.maximum(dr.select(slices.closed, round_, number), 0)), last)


def _towards_epipole(epipole, i, j):
    a, b, c = epipole
    return a - i * c, b - j * c


def _border(width: int, height: int, epipole):
    """Return by side (left, top, right, bottom) where it begins along the sides that face away
    and whether it does; the length of the sides that do; and whether all four do.

    The border is gone round from the lower left corner, (i, j) = (W/2, -H/2).
    """
    # A side faces away if E lies on its inner side, as seen from a corner of it. The corners (x, y)
    # and (-x, -y) serve all four sides.
    x, y = 0.5 * width, 0.5 * height
    left, top = _towards_epipole(epipole, x, y)
    right, bottom = _towards_epipole(epipole, -x, -y)
    faces = (left < 0, top < 0, right > 0, bottom > 0)
    # Left and right are as long as the image is high, top and bottom as it is wide; sides that do
    # not face away have no length.
    lengths = [
        type(left)(dr.select(side, float(n), 0)) for side, n in zip(faces, 2 * (height, width))
    ]
    closed = faces[0] & faces[1] & faces[2] & faces[3]
    # The first of the connected sides, where they do not close.
    first = [faces[k] & ~faces[k - 1] for k in range(4)]
    first[0] = first[0] | closed
    # A side begins behind those between it and the first of the connected ones. Which is the first
    # is known on the device only, so all four are tried, and one of them counts.
    sides = []
    for side in range(4):
        before = type(lengths[0])(0)
        for start in range(4):
            between = sum(lengths[(start + k) % 4] for k in range((side - start) % 4))
            before += dr.select(first[start], between, 0)
        sides.append((before, faces[side]))
    return tuple(sides), sum(lengths), closed


def _at_border(slices: Slices, place):
    """Return (i, j) at a place along the sides that face away."""
    x, y = 0.5 * slices.width, 0.5 * slices.height
    # By side, the point at the length r from where it begins, the way round of `_border`.
    points = (
        lambda r: (x, r - y),
        lambda r: (x - r, y),
        lambda r: (-x, y - r),
        lambda r: (r - x, -y),
    )
    i = j = type(place)(0)
    for (begin, faces), point, length in zip(
        slices.sides, points, 2 * (slices.height, slices.width)
    ):
        # One of the sides holds the place: they do not overlap.
        inside = faces & (place >= begin) & (place < begin + length)
        at_i, at_j = point(place - begin)
        i, j = dr.select(inside, at_i, i), dr.select(inside, at_j, j)
    return i, j


def _entry(slices: Slices, i, j):
    """Return where the half line from E to a point of the border enters the image: E
    itself if that is inside.
    """
    x, y = 0.5 * slices.width, 0.5 * slices.height
    # Step t from the border towards E: up to the opposite side of the image, or to E itself, which
    # t = 1/c reaches, as (di, dj) is c (E - (i, j)).
    di, dj = _towards_epipole(slices.epipole, i, j)
    to_i = dr.select(di > 0, x - i, x + i) / dr.abs(di)
    to_j = dr.select(dj > 0, y - j, y + j) / dr.abs(dj)
    to_i, to_j = dr.select(di == 0, dr.inf, to_i), dr.select(dj == 0, dr.inf, to_j)
    t = dr.minimum(dr.minimum(to_i, to_j), dr.rcp(slices.epipole[2]))
    t = dr.select(dr.isfinite(t), t, 0)
    return dr.clip(dr.fma(t, di, i), -x, x), dr.clip(dr.fma(t, dj, j), -y, y)


def _at_right_angles(vector, axis, camera: Camera):
    """Return the unit vector across `axis` on the side of `vector`; any across it
    where the two are parallel.
    """

    def across(side):
        normal = dr.cross(axis, side)
        # (axis x side) x axis is the part of `side` at right angles to the axis, times |axis|^2.
        return dr.cross(normal, axis)

    across_vector = across(vector)
    # A vector along the axis has no side, and any unit vector across it will do: that by the
    # camera's left, or by its up where left lies along the axis as well.
    flat = dr.squared_norm(across_vector) <= 1e-12 * dr.squared_norm(vector)
    other = dr.select(
        dr.squared_norm(across(camera.left)) > 0.1 * dr.squared_norm(camera.left),
        camera.left,
        camera.up,
    )
    return dr.normalize(dr.select(flat, across(other), across_vector))
