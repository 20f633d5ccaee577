# SPDX-License-Identifier: BSD-3-Clause
"""The geometry of one ray and one light, without cancellation.

With the ray o + x w (w of unit length) and the light at l, the foot of the
perpendicular from l is at distance

    foot = (l - o) . w,        and        height = |(l - o) x w|

is the distance between the light and the ray. The textbook form sqrt(|l - o|^2 - foot^2) loses all
digits where the ray passes close to the light. The cross product does not square, but each of its
components is still a difference of two products; they are formed here with the rounding errors of
both products carried along (Dekker 1971), so that the components are right to the last digit or so,
and so is the height.

From (foot, height) follow for every x, with s = x - foot and r = sqrt(h^2 + s^2),

    theta = atan(s/h)           the angle at the light, measured from the perpendicular
    path  = q = s + r           for s >= 0,    h^2/(r - s)  for s < 0        (camera -> x -> light has length foot + q)
    w     = asinh(s/h) = log(q/h),     tan(theta/2 + pi/4) = q/h = e^w.

The last line: with theta = atan(sinh w), sin theta = tanh w and cos theta = 1/cosh w, hence
tan(theta/2 + pi/4) = (1 + sin theta)/cos theta = cosh w + sinh w = e^w; and q/h = sinh w + cosh w.
The second branch of q is (s + r)(r - s) = r^2 - s^2 = h^2.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from airlight.errors import InputError

Array = NDArray[np.float64]


def foot_and_height(
    origin: ArrayLike, direction: ArrayLike, light: ArrayLike
) -> tuple[Array, Array]:
    """Return the foot and height of rays over a light.

    `origin`, `light`: points [m], of shape (n, 3), or (3,) for one that all share. `direction`:
    directions of the rays, of shape (n, 3) or (3,), of length 1 to float32 rounding. Directions are
    divided by their length, so that distances are along the unit vector. Returns `foot`, `height`:
    signed distance of the foot point from the origin [m] and distance from the light to the ray
    [m], of shape (n,). Raises InputError for arrays of other shapes, numbers that are not finite,
    or directions that are not of length 1 (to 1e-5).
    """
    o, d, p = (
        _points(name, value)
        for name, value in (("origin", origin), ("direction", direction), ("light", light))
    )
    length = np.sqrt(np.sum(d * d, axis=-1))
    # Directions of float32 renderers are of length 1 to their rounding only. 1e-5 lets them pass,
    # and refuses vectors that nobody has divided by their length.
    if np.any(np.abs(length - 1) > 1e-5):
        worst = float(length.flat[np.argmax(np.abs(length - 1))])
        raise InputError(
            f"a direction has length {worst:.6g}; expected length 1: divide it by its length"
        )
    # v goes from the origin to the light.
    try:
        v, d, length = np.broadcast_arrays(p - o, d, length[..., None])
    except ValueError:
        raise InputError(
            f"origin, direction and light have the shapes {o.shape}, {d.shape}, {p.shape}; "
            "expected (n, 3) or (3,) each"
        ) from None
    v, d, length = np.atleast_2d(v), np.atleast_2d(d), np.atleast_2d(length)[:, 0]
    # Products are divided by the length, not the components of the direction, which would be
    # rounded once more.
    foot = np.sum(v * d, axis=1) / length
    # The components of (l - o) x w, which cancel where the ray passes close to the light.
    cross = [
        _difference_of_products(v[:, i], d[:, j], v[:, j], d[:, i])
        for i, j in ((1, 2), (2, 0), (0, 1))
    ]
    # hypot does not square: heights near the smallest and the largest numbers survive.
    height = np.hypot(np.hypot(cross[0], cross[1]), cross[2]) / length
    return foot, height


def _points(name: str, value: ArrayLike) -> Array:
    points = np.asarray(value, dtype=np.float64)
    if points.ndim not in (1, 2) or points.shape[-1] != 3:
        raise InputError(f"{name} has the shape {points.shape}; expected (n, 3) or (3,)")
    if not np.all(np.isfinite(points)):
        raise InputError(f"{name} holds a number that is not finite; expected finite coordinates")
    return points


def _difference_of_products(a: Array, b: Array, c: Array, d: Array) -> Array:
    """Return a b - c d with the rounding errors of both products added back."""
    ab, cd = a * b, c * d
    return (ab - cd) + (_product_error(a, b, ab) - _product_error(c, d, cd))


def _product_error(a: Array, b: Array, product: Array) -> Array:
    """Return a b - fl(a b) exactly (Dekker 1971, section 5): both factors split
    into two halves of 26 bits.
    """
    a_high, a_low = _split(a)
    b_high, b_low = _split(b)
    return ((a_high * b_high - product) + a_high * b_low + a_low * b_high) + a_low * b_low


def _split(a: Array) -> tuple[Array, Array]:
    # Times 2^27 + 1, and taken back: the rounding of the sum leaves the upper 26 bits of a.
    scaled = 134217729.0 * a
    high = scaled - (scaled - a)
    return high, a - high
