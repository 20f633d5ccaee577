# SPDX-License-Identifier: BSD-3-Clause
"""The airlight in bounded media by the plainest of sums, in NumPy: what all sides of a
comparison are held against.

It shares nothing with the package: chords by slabs and by the quadratic formula, the midpoint rule
in each medium, no kinks looked for. Its error is of the order of 1/steps^2 at a kink and of 1/steps
where a shadow begins or ends.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
#: places and unit directions -> where lines enter and leave [m]
Chord = Callable[[Array, Array], tuple[Array, Array]]


def box(centre: Any, half: Any, turn: Any = None) -> Chord:
    """Return the chords of a box with these half edges, whose axes are the columns
    of `turn`; 0, 0 beside it.
    """
    frame = np.eye(3) if turn is None else np.asarray(turn)

    def chord(origin: Array, direction: Array) -> tuple[Array, Array]:
        p, d = (origin - np.asarray(centre)) @ frame, direction @ frame
        with np.errstate(divide="ignore", invalid="ignore"):
            planes = (-np.asarray(half) - p) / d, (np.asarray(half) - p) / d
        low, high = np.fmin(*planes).max(axis=-1), np.fmax(*planes).min(axis=-1)
        return np.where(high > low, low, 0), np.where(high > low, high, 0)

    return chord


def ball(centre: Any, radius: float) -> Chord:
    """Return the chords of a sphere; 0, 0 beside it."""

    def chord(origin: Array, direction: Array) -> tuple[Array, Array]:
        w = origin - np.asarray(centre)
        b, c = np.sum(w * direction, axis=-1), np.sum(w * w, axis=-1) - radius**2
        root = np.sqrt(np.maximum(b * b - c, 0))
        return np.where(b * b > c, -b - root, 0), np.where(b * b > c, -b + root, 0)

    return chord


def henyey_greenstein(g: float) -> Callable[[Array], Array]:
    """Return the phase function of mean 1 over the sphere."""
    return lambda cosine: (1 - g * g) / (1 + g * g - 2 * g * cosine) ** 1.5


@dataclass(frozen=True)
class Body:
    """A medium in its bounds."""

    chord: Chord
    sigma_t: Any  #: [1/m]
    albedo: Any
    phase: Callable[[Array], Array]  #: of the cosine of the scattering angle, +1 forward; mean 1


@dataclass(frozen=True)
class Light:
    """A point light (w = 1: a place) or a directional one (w = 0: the
    unit direction towards it).
    """

    position: Any
    w: float
    strength: Any  #: intensity [W/sr] or irradiance [W/m^2]


def airlight_sum(
    origin: Array,
    direction: Array,
    light: Light,
    bodies: Sequence[Body],
    *,
    around: Body | None = None,
    steps: int = 200_000,
    end: float = np.inf,
    shadow_scale: float = 1.0,
    lit: Callable[[Array], NDArray[np.bool_]] | None = None,
) -> Array:
    """Return the airlight of one ray, (3,) [W/(m^2 sr)]; `around` is the medium outside of the
    bodies, if there is one.

    `lit` tells of points whether the light reaches them; the segment from a point light is
    attenuated over `shadow_scale` of its length, as seen from the point. Bodies must not overlap.
    """
    outside = np.zeros(3) if around is None else np.broadcast_to(around.sigma_t, 3)
    chords = [tuple(np.maximum(x, 0.0) for x in body.chord(origin, direction)) for body in bodies]
    parts = [
        (float(low), min(float(high), end), body)
        for (low, high), body in zip(chords, bodies, strict=True)
    ]
    if around is not None:
        cuts = sorted(
            [0.0, min(end, 60.0), *(x for low, high, _ in parts if high > low for x in (low, high))]
        )
        parts += [(low, high, around) for low, high in zip(cuts[::2], cuts[1::2], strict=True)]
    total = np.zeros(3)
    for low, high, body in parts:
        if high <= low:
            continue
        # Steps that grow away from the camera, x = e^t - 1: the part in the
        # surroundings may be long.
        span = np.log1p(high) - np.log1p(low)
        t = np.log1p(low) + span * (np.arange(steps) + 0.5) / steps
        x, dx = np.expm1(t), np.exp(t) * span / steps
        point = origin + x[:, None] * direction
        way = np.asarray(light.position) - light.w * point
        r = np.linalg.norm(way, axis=-1) if light.w else np.full(steps, np.inf)
        towards = way / r[:, None] if light.w else np.broadcast_to(way, point.shape)
        tau = np.outer(x, outside) + (np.outer(shadow_scale * r, outside) if light.w else 0)
        for (near, far), other in zip(chords, bodies, strict=True):
            begin, leave = other.chord(point, towards)
            length = np.clip(x - near, 0, far - near)
            length += np.maximum(np.minimum(leave, shadow_scale * r) - np.maximum(begin, 0), 0)
            tau += length[:, None] * (np.asarray(other.sigma_t) - outside)
        value = body.phase(towards @ direction) * dx / (r**2 if light.w else 1)
        value = value if lit is None else value * lit(point)
        total += np.sum(np.exp(-tau) * value[:, None], axis=0) * body.sigma_t * body.albedo
    return total * light.strength / (4 * np.pi)


def bodies_of(reference: Any, chords: dict[str, Chord]) -> tuple[list[Body], Body | None]:
    """Return the media of a scene of the reference, whose bounds have these chords by name,
    and what is around them.
    """
    bodies = [
        Body(chords[each.name], each.sigma_t, each.albedo, each.phase) for each in reference.media
    ]
    outside = reference.medium
    everywhere = Body(ball((0, 0, 0), np.inf), outside.sigma_t, outside.albedo, outside.phase)
    return bodies, everywhere if outside.sigma_t.any() else None
