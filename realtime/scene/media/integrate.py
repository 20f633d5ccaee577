# SPDX-License-Identifier: BSD-3-Clause
"""The integral of one light along rays, by panels of Gauss-Legendre nodes, in any medium.

Over a lit segment of a ray and for a light at a place, at the distance r from the point at x,

    I = int_{x0}^{x1} sigma_s p exp(-tau_camera - tau_light) f / r^2 dx,

with f the profile of a spot; for a light at infinity there is no r^2. A medium gives sigma_s, p and
both depths at a node, the places where they bend, and the length in which they change much. This
page is the rest.

**The variable.** With s = x - foot, the height h of the light and N^2 = (r + s)/2,
D^2 = (r - s)/2, 2 N D is h. At E = N/D = (r + s)/h there are s/r = (E^2 - 1)/(E^2 + 1), sin^2 and
cos^2 of half the scattering angle, E^2/(1 + E^2) and 1/(1 + E^2), and dx/r^2 = (2/h) dE/(1 + E^2).
In a panel from s0 to s1 N and D are linear in t from 0 to 1: with C = N0 N1 + D0 D1,

    s - s0 = t h (s1 - s0)/(2 C) (N N0 + D D0)/(N D),    r = h (N^2 + D^2)/(2 N D),
    s1 - s = (1 - t) h (s1 - s0)/(2 C) (N N1 + D D1)/(N D),
    dx/r^2 = (s1 - s0)/C dt/(N^2 + D^2).

All terms are of one sign, and nothing divides by h: a segment far from the light, and a ray close
to it, lose nothing. For a light at infinity x is linear in t.

**How wide a panel may be.** In the middle of a panel E is the geometric mean of its ends. With it
as the unit and u from -1 to 1 for t, N = c + u q and D = c - u q, c and q the hyperbolic cosine and
sine of W/4, where W is the width of the panel in ln E. A singularity at E = i k, as 1/(1 + E^2) and
the lobe of Henyey and Greenstein have one for some k, lies at

    u = (c/q) (i k - 1)/(i k + 1),    hence |u| = coth(W/4) for all k:

the rule of n nodes is wrong by about rho^(-2n), rho = coth(W/8) at worst, whatever the ray and
however sharp the lobe (Trefethen 2013, theorem 19.3). A panel from s0 of the width W has the length
(cosh W - 1) s0 + sinh W r0.

**How much may change.** The medium says the length in which both depths and the logarithm of the
extinction together change by no more than a number, `CHANGE`. Both limits spoil a part of the
accuracy, so the square of the reciprocal length of a panel is the sum of theirs. Each phase
function says the width at which all such panels are right to 1e-6 (`realtime.scene.rule_reach`).

A ray goes from panel to panel in s, not in x: close to the light x lacks the digits. A segment
whose panels run out is NaN, and `realtime.frame.light_on_ray` refuses its frame: the sum of some of
its panels would be a dark pixel.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

from airlight.realtime.numerics.array_types import is_single
from airlight.realtime.numerics.functions import unit_nodes
from airlight.realtime.scene.rule_reach import NODES

_NODES_DOUBLE = 16  # rho^(-32): 1e-16 where six nodes leave 1e-6


@dataclass(frozen=True)
class Start:
    """The place where panels of rays begin, and how far they may go as the light says."""

    foot: Any  #: of the light over the rays, 0 for a light at infinity [m]
    s: Any  #: x - foot [m]
    r: Any  #: distance to the light, 1 for a light at infinity [m]
    rate: Any  #: reciprocal of the longest panel that the phase function allows [1/m]
    last: Any  #: s where the segment ends, or at the next bend [m]

    @property
    def x(self) -> Any:
        """The distance from the camera [m]."""
        return self.foot + self.s

    def end(self, rate) -> Any:
        """Return s at the end of a panel [m]; `rate`: reciprocal of the
        medium's longest one [1/m].
        """
        length = 1 / dr.sqrt(dr.fma(rate, rate, dr.square(self.rate)))
        return dr.minimum(self.s + length, self.last)


@dataclass(frozen=True)
class Node:
    """A node of a panel."""

    x: Any  #: distance from the camera [m]
    far: Any  #: from the beginning of the panel [m]
    rest: Any  #: to its end [m]
    s: Any  #: x - foot [m]
    r: Any  #: distance to the light, 1 for a light at infinity [m]
    down: Any  #: sin^2 of half the scattering angle
    up: Any  #: cos^2 of it
    weight: Any  #: of the rule, with dx/r^2 [1/m]; for a light at infinity with dx [m]


def integral(lit: Any, x0, x1) -> list[Any]:
    """Return the integral over segments [x0, x1] [m] of rays with one light; `x1` may be infinite.

    `lit` is a `realtime.scene.media.medium.LitRays`; the result is one sum for each of the values
    that its `panel` gives at a node.
    """
    Float, light, geometry = type(x0), lit.light, lit.geometry
    lanes = dr.width(geometry.height, x0, x1)
    # From distances to places from the foot.
    foot = geometry.foot if light.w else Float(0)
    # A ray through the light has an infinite integral, and so nearly is its value at 1e-15 m.
    height = dr.maximum(geometry.height, 1e-15)
    s0 = x0 - foot + dr.zeros(Float, lanes)
    s1 = _finite_end(lit, s0, x1 - foot, height)
    # Where the medium bends, and where a spot begins to fall off.
    kinks = geometry.smooth_subsegments(light, x0, x1)[:-1]
    bends = [x - foot for x in (*lit.bends(), *(end for _, end in kinks))]
    width = _panel_width(lit, Float) if light.w else None
    angles = (None, None) if light.w else half_angles(-light.axis, lit.rays.direction)

    def panel(turn, s, state, totals):
        # The light's limits to a panel first, then the medium's.
        start = _start(foot, height, s, _following(bends, s, s1), width)
        end, values, state = lit.panel(start, state)
        # In the light of a place the weights hold dx/r^2, at infinity dx.
        nodes = (
            _at_place(lit, start, end, height) if light.w else _at_infinity(lit, start, end, angles)
        )
        for node in nodes:
            weight = node.weight
            if light.varies:
                weight *= geometry.falloff_beside(light, node.s)
            totals = [
                dr.fma(weight, value, total)
                for total, value in zip(totals, values(node), strict=True)
            ]
        return turn + 1, end, state, totals

    # A lane walks on until its segment ends, nothing is left of the light, or its panels run out.
    _, reached, state, totals = dr.while_loop(
        state=(
            dr.zeros(mi.UInt32, lanes),
            s0,
            lit.begin(x0 + dr.zeros(Float, lanes)),
            lit.zeros(lanes),
        ),
        cond=lambda turn, s, state, totals: (s < s1) & lit.shines(state) & (turn < lit.most_panels),
        body=panel,
        labels=("turn", "s", "state", "totals"),
    )
    # The sum of some panels would be a dark pixel: NaN makes the frame refuse itself.
    ran_out = (reached < s1) & lit.shines(state)
    return [dr.select(ran_out, dr.nan, total) for total in totals]


def panel_nodes(Float) -> int:
    """Return the number of nodes of a panel for a type of numbers."""
    return NODES if is_single(Float) else _NODES_DOUBLE


def _finite_end(lit: Any, s0, s1, height):
    """Return s1, or where 1/r^2 has left nothing of a light at a place [m]."""
    if not lit.light.w:
        return s1
    Float = type(s0)
    _, backward = lit.phase.lobe_scales(Float)
    # Where r + s is so many times its first value, 1/r^2 has left nothing. A backward lobe begins
    # at E = `backward`, and the tail of its light is longer by this factor.
    path = height + s0 + dr.sqrt(dr.fma(s0, s0, dr.square(height)))
    tail = 1e7 if is_single(Float) else 1e12
    return dr.minimum(s1, dr.maximum(s0, 0) + tail * backward * path)


def _panel_width(lit: Any, Float) -> tuple[Any, Any]:
    """Return cosh W - 1 and sinh W of the widest panels."""
    width = lit.panel_width(Float)
    if lit.light.beam is not None:
        # The widest panel where the intensity of a spot falls off, linear in an angle.
        width = dr.minimum(width, 0.85)
    grown = dr.exp(width)
    sinh = 0.5 * (grown - dr.rcp(grown))
    return grown - 1 - sinh, sinh


def _start(foot, height, s, last, width: tuple[Any, Any] | None) -> Start:
    """Return where panels begin; for a light at infinity there is no `width`."""
    if width is None:
        return Start(foot, s, type(s)(1), type(s)(0), last)
    # A panel of the width W from s has the length (cosh W - 1) s + sinh W r.
    less, sinh = width
    r = dr.sqrt(dr.fma(s, s, dr.square(height)))
    return Start(foot, s, r, dr.rcp(dr.fma(less, s, sinh * r)), last)


def _following(bends, s, last):
    """Return the next of some places beyond s, or the last place."""
    for bend in bends:
        last = dr.minimum(last, dr.select(bend > s, bend, dr.inf))
    return last


def _at_place(lit: Any, start: Start, end, height) -> Iterator[Node]:
    """Return the nodes of panels in the light of a place: N and D are linear in t."""
    length = end - start.s
    (n0, d0), (n1, d1) = _roots(start.s, height), _roots(end, height)
    fraction = length * dr.rcp(dr.fma(n0, n1, d0 * d1))  # (s1 - s0)/C
    for t, weight in unit_nodes(lit.nodes(type(length))):
        n, d = dr.fma(n1 - n0, t, n0), dr.fma(d1 - d0, t, d0)
        square_n, square_d = dr.square(n), dr.square(d)
        # h/(2 N D) brings N and D back to the length at which they are roots.
        total, scale = square_n + square_d, 0.5 * height * dr.rcp(n * d)
        inverse = dr.rcp(total)
        # s - s0, s1 - s and r of the module: sums of terms of one sign.
        far = (t * fraction) * (scale * dr.fma(n, n0, d * d0))
        rest = ((1 - t) * fraction) * (scale * dr.fma(n, n1, d * d1))
        s, r = (square_n - square_d) * scale, total * scale
        # E^2/(1 + E^2) and 1/(1 + E^2), with E = N/D.
        down, up = square_n * inverse, square_d * inverse
        yield Node(start.x + far, far, rest, s, r, down, up, weight * fraction * inverse)


def _at_infinity(lit: Any, start: Start, end, angles: tuple[Any, Any]) -> Iterator[Node]:
    """Return the nodes of panels in the light of a direction: x is linear in t."""
    length, (down, up) = end - start.s, angles
    for t, weight in unit_nodes(lit.nodes(type(length))):
        far = t * length
        yield Node(
            start.x + far, far, (1 - t) * length, start.s + far, start.r, down, up, weight * length
        )


def half_angles(toward, direction) -> tuple[Any, Any]:
    """Return sin^2 and cos^2 of half the angle by which light is scattered into rays, both with
    all digits; `toward` are unit vectors to the light.
    """
    # The cosine of the scattering angle is toward . direction.
    return 0.25 * dr.squared_norm(toward - direction), 0.25 * dr.squared_norm(toward + direction)


def _roots(s, h):
    """Return N and D, the square roots of (r + s)/2 and (r - s)/2; 2 N D = h."""
    # The larger root is a sum; the smaller one would cancel, and follows from 2 N D = h.
    larger = dr.sqrt(0.5 * (dr.abs(s) + dr.sqrt(dr.fma(s, s, h * h))))
    smaller = 0.5 * h * dr.rcp(larger)
    return dr.select(s > 0, larger, smaller), dr.select(s > 0, smaller, larger)
