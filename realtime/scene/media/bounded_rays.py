# SPDX-License-Identifier: BSD-3-Clause
"""Airlight in bounded media: homogeneous, convex and disjoint, in vacuum or in another medium.

A ray runs through *pieces*, the bounded media that it meets and, unless they are in vacuum, the
gaps between them. In a piece of the medium j, over a lit segment of it,

    J = int exp(-tau_camera(x) - tau_light(x)) p / r^2 dx,

without r^2 for a light at infinity, with the true optical depths on both paths. Camera: the depth
up to the piece is one number a ray, and sigma_j (x - x_j) is added in it. Light: the path from the
light to x has the length l_k in the medium k (`realtime.scene.media.light_paths`), and

    tau_light = sigma_0 r + sum_k (sigma_k - sigma_0) l_k,        sigma_0 = 0 in vacuum.

Between two *bends*, where a path passes from facet to facet, or an edge, or grazes a sphere, all of
this is smooth. The panels of `realtime.scene.media.integrate` end at a bend, and sooner where they
would

* be optically thicker than some depth, both paths together,
* change 1 + e by more than some fraction of it: the length rises steeply where
  a path grazes its facet.
"""

from dataclasses import dataclass
from functools import reduce
from itertools import repeat
from operator import or_
from typing import Any

import drjit as dr
import mitsuba as mi

from airlight.realtime.numerics.functions import exp_bounded
from airlight.realtime.scene.media.facet_paths import Envelopes
from airlight.realtime.scene.media.integrate import Node, Start, integral
from airlight.realtime.scene.media.light_paths import LightPaths, beyond, paths_from
from airlight.realtime.scene.media.medium import Homogeneous, LitRays, Rays, optical_reach
from airlight.realtime.scene.rule_reach import CHANGE

# Panels of a segment, and more where paths pass from facet to facet: thin fog, seen over a hundred
# metres in the light that a box of 1000 mean free paths lets by, takes more than 10 000 of them.
_MOST = 100_000


@dataclass(frozen=True)
class Piece:
    """A part of every ray that lies in one medium."""

    medium: Homogeneous
    number: Any  #: of the bounded medium; None between them
    begin: Any  #: distance from the camera [m], infinite or equal to `end` where the ray misses it
    end: Any  #: [m]
    before: tuple[Any, ...]  #: optical depth from the camera to `begin`, by channel [1]


@dataclass(frozen=True)
class BoundedRays(LitRays):
    """Rays in bounded media, and one light: integrals are sums of albedo_j
    sigma_j J_j, RGB [1/m^2].
    """

    pieces: tuple[Piece, ...] = ()

    def airlight(self, x0, x1):
        """Return sum_j albedo_j sigma_j J_j over the lit segment [x0, x1] [m], RGB
        [1/m^2], from infinity [1].

        `x1` may be infinite. Times intensity / (4 pi), or irradiance / (4 pi), it is the radiance.
        """
        x0, x1 = self.geometry.lit_segment(x0, x1)
        Color = type(self.medium.albedo)
        total = dr.zeros(Color, dr.width(self.geometry.height, x0, x1))
        # Lanes whose lit segment misses a piece skip its integral.
        for piece in self.pieces:
            total += dr.if_stmt(
                args=(dr.maximum(x0, piece.begin), dr.minimum(x1, piece.end)),
                cond=dr.minimum(x1, piece.end) > dr.maximum(x0, piece.begin),
                true_fn=lambda begin, end, piece=piece: self.integral(piece, begin, end),
                false_fn=lambda begin, end: Color(0),
            )
        return total

    def integral(self, piece: Piece, x0, x1):
        """Return albedo sigma J over a segment [m] in one piece, a colour [1/m^2]."""
        # Beyond its optical reach nothing is left: an unbounded piece gets an end.
        x1 = dr.minimum(x1, x0 + optical_reach(type(x0)) / piece.medium.least_extinction())
        paths = tuple(self.light_paths(piece, x0, x1))
        lit = PieceRays(self.medium, self.light, self.rays, self.geometry, None, self, piece, paths)
        sums = zip(piece.medium.sigma_t, integral(lit, x0, x1), strict=True)
        return piece.medium.albedo * type(piece.medium.albedo)(
            *(sigma * total for sigma, total in sums)
        )

    def light_paths(self, piece: Piece, x0, x1) -> list[LightPaths]:
        """Return the paths from the light to a segment [m] in one piece, through each
        medium that they may meet.
        """
        rays = self.rays
        return paths_from(
            self.medium, self.light, rays.origin, rays.direction, own=piece.number, segment=(x0, x1)
        )

    def growth(self, piece: Piece, x, r):
        """Return how fast the depth of both paths grows along the ray, bounded media on
        the light's left out [1/m].
        """
        around, left = self.medium.sigma_t, self.left(piece, x)
        rate = reduce(dr.maximum, map(dr.select, left, piece.medium.sigma_t, repeat(type(x)(0))))
        # The distance to a light at a place grows by 1 m a metre at most, in the medium around. A
        # sun shines through vacuum between the bounded media.
        if self.light.w and not self.medium.clear:
            rate = rate + reduce(dr.maximum, map(dr.select, left, around, repeat(type(x)(0))))
        return rate

    def left(self, piece: Piece, x) -> list[Any]:
        """Return by channel whether something is left on the way to the camera. Others do not
        count: the panels of those that do may be a thousand times as long.
        """
        return [
            dr.fma(sigma_t, x - piece.begin, before) < optical_reach(type(x))
            for sigma_t, before in zip(piece.medium.sigma_t, piece.before, strict=True)
        ]

    def depths(self, piece: Piece, x, r, lengths) -> list[Any]:
        """Return the optical depth of both paths at x, by channel; `lengths` of
        the light's by medium [m].
        """
        depths = []
        for channel, around in enumerate(self.medium.sigma_t):
            depth = dr.fma(piece.medium.sigma_t[channel], x - piece.begin, piece.before[channel])
            # The path to the light: sigma_0 r, and (sigma_k - sigma_0) l_k in each medium.
            if not self.medium.clear:
                depth = dr.fma(around, r, depth)
            for medium, length in lengths:
                depth = dr.fma(medium.sigma_t[channel] - around, length, depth)
            depths.append(depth)
        return depths

    @property
    def height(self):
        """The height [m]; a ray through the light has an infinite integral,
        and so nearly is its value.
        """
        return dr.maximum(self.geometry.height, 1e-15)


@dataclass(frozen=True)
class PieceRays(LitRays):
    """Rays in one piece: values are p exp(-tau) by channel, the state is the
    envelopes of the light's paths.
    """

    whole: Any = None  #: `BoundedRays`
    piece: Any = None  #: `Piece`
    paths: tuple[LightPaths, ...] = ()

    @property
    def most_panels(self):
        """Some, and two for each facet: a path enters and leaves each
        facet of a convex body once.
        """
        return _MOST + 2 * sum(path.bounded.count for path in self.paths)

    @property
    def size(self):
        """The radius of the largest bounded medium [m]."""
        return reduce(dr.maximum, [bounded.radius for bounded in self.medium.bounded_media])

    @property
    def phase(self):
        """The phase function of the piece."""
        return self.piece.medium.phase

    def bends(self):
        """Return where paths graze spheres [m]."""
        return tuple(x for path in self.paths for x in path.grazed_at())

    def zeros(self, width):
        """Return nothing by channel."""
        return [dr.zeros(type(self.geometry.height), width) for _ in self.piece.before]

    def begin(self, x):
        """Return the envelopes at x [m]."""
        return [path.envelopes_at(beyond(x, self.size)) for path in self.paths]

    def shines(self, envelopes):
        """Return true: segments end where nothing is left."""
        return mi.Bool(True)

    def panel(self, start: Start, envelopes):
        """Return the ends of panels, p exp(-tau) by channel at nodes, and the
        envelopes behind the panels.
        """
        x, end = start.x, start.end(self._rate(start, envelopes))
        # The next place at which a facet takes over, or a path passes an edge: beyond a rounding
        # error of x. The panel ends there. Spheres have no envelopes.
        at = beyond(x, self.size)
        changes = [
            lines and path.next_change(lines, at) for path, lines in zip(self.paths, envelopes)
        ]
        for lines, change in zip(envelopes, changes):
            if lines:
                bend = dr.minimum(dr.maximum(dr.minimum(*change[0]), at), lines.crossing(at))
                end = dr.minimum(end, bend - start.foot)

        def values(node: Node):
            # Within the panel the envelopes are two lines each, so that a length needs no search.
            lengths = [
                (path.bounded.medium, path.length(lines, node.x, node.r))
                for path, lines in zip(self.paths, envelopes)
            ]
            phase = self.phase.evaluate_half(node.down, node.up)
            return [
                phase * exp_bounded(-depth)
                for depth in self.whole.depths(self.piece, node.x, node.r, lengths)
            ]

        return (
            end,
            values,
            [
                lines and _after(lines, change, start.foot + end)
                for lines, change in zip(envelopes, changes)
            ],
        )

    def _rate(self, start: Start, envelopes):
        """Return the reciprocal of the longest panels [1/m]."""
        rate, bending = self.whole.growth(self.piece, start.x, start.r), type(start.s)(0)
        left, around = self.whole.left(self.piece, start.x), self.medium.sigma_t
        # The rate of the depths is at most the sum of all their rates; the length of a path in a
        # medium rises steeply where the path grazes a facet, and there the panel is short.
        for path, lines in zip(self.paths, envelopes):
            growth, smooth = path.growth(lines, start.x, start.r, around, left)
            rate = rate + growth
            bending = dr.maximum(bending, 1 / smooth)
        # Paths along a facet change without limit where they pass its edge: a panel shorter than a
        # rounding error of x would end where it begins.
        least = beyond(start.x, self.size) - start.x
        return dr.minimum(dr.maximum(rate * (1 / CHANGE), bending), dr.rcp(least))


def camera_pieces(medium: Any, rays: Rays) -> tuple[Piece, ...]:
    """Return the pieces of camera rays in which something scatters."""
    Float = type(rays.direction.x)

    def piece(within: Homogeneous, number, begin, end):
        # The depth from the camera to the piece is one number a ray; it is 0 for rays that miss the
        # piece, which begin at infinity.
        before = medium.optical_depth(rays, 0, dr.select(dr.isfinite(begin), begin, 0))
        return Piece(within, number, begin, end, before)

    pieces = [
        piece(bounded.medium, number, *ends)
        for number, (bounded, ends) in enumerate(
            zip(medium.bounded_media, rays.crossed, strict=True)
        )
    ]
    if not medium.clear:
        around = Homogeneous(medium.sigma_t, medium.albedo, medium.phase)
        # A gap begins at the camera or behind a bounded medium, and ends where the ray enters the
        # next.
        starts = [dr.zeros(Float, dr.width(rays.direction)), *(leave for _, leave in rays.crossed)]
        for begin in starts:
            end = Float(dr.inf)
            for enter, _ in rays.crossed:
                end = dr.minimum(end, dr.select(enter >= begin, enter, dr.inf))
            # A camera within a bounded medium has no gap before it.
            inside = reduce(
                or_, [(enter <= begin) & (begin < leave) for enter, leave in rays.crossed]
            )
            pieces.append(piece(around, None, begin, dr.select(inside, begin, end)))
    return tuple(pieces)


def _after(before: Envelopes, change, x) -> Envelopes:
    """Return the envelopes from x on, a distance not beyond the next change of either [m]."""
    # The panel that ends where a line takes over, or behind it by rounding, hands on the new line.
    (until_low, until_high), after = change
    return Envelopes(
        dr.select(until_low <= x, after.least, before.least),
        dr.select(until_high <= x, after.largest, before.largest),
        (
            dr.select(until_low <= x, after.planes[0], before.planes[0]),
            dr.select(until_high <= x, after.planes[1], before.planes[1]),
        ),
    )
