# SPDX-License-Identifier: BSD-3-Clause
"""How much of the paths from a light to the points of a ray lies in a convex medium.

A light is a homogeneous position L with w = 1, a place, or w = 0, against the direction of its rays
(`realtime.scene.lights`). The path from the point P is P + t D, D = L - w P, up to t = 1 or without
end. It crosses the plane n . P = c of a half space at

    t = e/(1 + w e),     e = (c - n . P)/N,     N = n . L - w c.

e rises with t. Where N > 0 the light comes in through the plane, and the path is in the half space
up to e, from P on; where N < 0 it is so beyond e. With

    e_0 = max(0, max e over the planes with N < 0),     e_1 = max(0, min e over those with N > 0)

the path has in the medium the length max(0, e_1 - e_0) |D|/((1 + w e_0)(1 + w e_1)).
Nothing cancels but e itself.

e is linear in P: along a ray P = o + x d it is a line, c + s x, for a light at any place. The least
of some lines and the largest of others, the *envelopes*, bend where another line takes over. The
length bends at these places, where an envelope is 0, and where both meet. The least of lines is
concave: beyond a place only steeper falling lines can take over from the one that is least there,
and the first of them to cross it does. One pass over the planes finds it.

The facets through which the light comes in tile the medium as the light sees it. A path that meets
the medium therefore finds its plane by going from facet to facet while a neighbour has less: the
straight way from a point of the facet k to the point of the path leaves k over an edge, and from
this edge on the neighbour beyond it has less than k, since the difference of both is linear. Where
no neighbour on the light's side has less, and none on the other has more, the crossing lies in the
facet. Otherwise the path misses the medium, and e_0 > e_1 says so. The walk begins at the facet in
the direction, from the medium's centre, of the place where the path crosses the sphere around it.
For points within the medium the next plane along a ray shares an edge with the last one, too.

A camera ray is the path of a light at infinity in its direction, from its origin.

**Spheres.** With C and R the middle and the radius, p = P - C and M = L - w C, p x D = p x M is
linear in x too. The path is nearest to C at the distance b = -p . D/|D| from P, and half its chord
is q, q^2 = R^2 - |p x M|^2/|D|^2. Paths graze the sphere where

    |p x M|^2 = R^2 |D|^2,
    with the discriminant (|M|^2 - w R^2)(R^2 |D x d|^2 - (M . (p x d))^2),

whose second factor is one difference. Before and behind these points q rises like a root.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import reduce
from typing import Any

import drjit as dr
import mitsuba as mi

from airlight.realtime.numerics.array_types import four_numbers
from airlight.realtime.scene.closed_mesh import CELLS
from airlight.realtime.scene.lights import Light
from airlight.realtime.scene.media.medium import Homogeneous, Medium, optical_reach
from airlight.realtime.scene.rule_reach import CHANGE

_FAR = 1e30  #: e of no plane


@dataclass(frozen=True)
class BoundedMedium:
    """A homogeneous medium within convex bounds (`realtime.scene.closed_mesh`)."""

    medium: Homogeneous
    #: four numbers a half space: its outward normal, and its distance from
    #: `centre` [m]; None for a sphere
    planes: Any
    count: int  #: half spaces
    centre: Any  #: of the sphere, or of one that holds the medium [m]
    radius: Any  #: of that sphere [m]
    mean_distance: Any  #: R, see `realtime.scene.closed_mesh.mean_distance` [m]
    #: `sides` numbers a half space: planes that share an edge with it, or itself; None: sphere
    neighbours: Any = None
    beside: Any = None  #: `planes` of the neighbours
    sides: int = 0
    #: by cell of directions a half space, see `realtime.scene.closed_mesh.radial_planes`
    starts: Any = None


@dataclass
class Envelopes:
    """The lines of the planes through which paths enter and leave a medium,
    near one place of the rays.
    """

    least: tuple[Any, Any]  #: constant and slope [1/m] of the least e with N > 0
    largest: tuple[Any, Any]  #: and of the largest with N < 0
    planes: tuple[Any, Any]  #: the numbers of their planes

    def ends(self, x) -> tuple[Any, Any]:
        """Return e_0 and e_1 at a distance x [m]."""
        return dr.maximum(_value(self.largest, x), 0), dr.maximum(_value(self.least, x), 0)

    def crossing(self, x):
        """Return the next distance beyond x at which the lines meet or one of
        them is 0, or infinity [m].
        """
        low, high = _value(self.largest, x), _value(self.least, x)
        rising, falling = self.largest[1], self.least[1]
        until = type(x)(dr.inf)
        # Three differences of lines that may reach 0: e_1 - e_0, e_1 and e_0.
        for gap, closing in ((high - low, rising - falling), (high, -falling), (low, -rising)):
            ahead = gap / closing
            until = dr.minimum(until, dr.select(ahead > 0, x + ahead, dr.inf))
        return until


@dataclass(frozen=True)
class LightPaths:
    """The paths from a light to the points of rays, and one bounded medium."""

    bounded: BoundedMedium
    w: float  #: 1 for a light at a place, 0 for one at infinity
    toward: Any  #: M: from the medium's centre to the light [m], or the unit direction to it
    start: Any  #: from the medium's centre to the origin of the rays [m]
    direction: Any  #: unit directions of the rays, or 0 for points
    active: Any = True  #: lanes in which paths may meet the medium
    own: bool = False  #: whether the points lie within the medium

    @property
    def round(self) -> bool:
        """Whether the medium is a sphere."""
        return self.bounded.planes is None

    def away(self, x):
        """Return D [m] from the points at x."""
        return self.toward - dr.fma(self.direction, x, self.start) if self.w else self.toward

    def length(self, envelopes: Envelopes | None, x, r):
        """Return the length within the medium of the paths to x [m]; `r` is |D|, and
        spheres have no envelopes.
        """
        if envelopes is None:
            # A sphere: the path is nearest to the centre at b, q is half of its chord, and the path
            # lies in the medium from b - q to b + q, as far as it is between the point and the
            # light.
            nearest, half = self._chord(x, r)
            last = dr.minimum(nearest + half, r) if self.w else nearest + half
            length = dr.maximum(last - dr.maximum(nearest - half, 0), 0)
        else:
            # A polyhedron: max(0, e_1 - e_0) |D|/((1 + w e_0)(1 + w e_1)).
            first, last = envelopes.ends(x)
            length = dr.maximum(last - first, 0)
            if self.w:
                length = r * (length / (1 + last)) / (1 + first)
        return dr.select(self.active, length, 0)

    def _chord(self, x, r):
        """Return b and q of a sphere for the paths to x [m], q = 0 where they miss it."""
        point, away = dr.fma(self.direction, x, self.start), self.away(x)
        square = dr.squared_norm(away)
        half = (
            dr.square(self.bounded.radius) - dr.squared_norm(dr.cross(point, self.toward)) / square
        )
        return -dr.dot(point, away) / r, dr.sqrt(dr.maximum(half, 0))

    def length_at(self, x, r):
        """Return `length` for points by themselves."""
        return self.length(None if self.round else self._walk(x), x, r)

    def ends_at(self, x):
        """Return e_0 and e_1 of a polyhedron for points by themselves."""
        return self._walk(x).ends(x)

    def envelopes_at(self, x) -> Envelopes | None:
        """Return the envelopes at a distance x [m]; None for a sphere."""
        if self.round:
            return None
        return (
            self._walk(x)
            if self.own
            else self._over_planes(self._none(x), self._tighter(x), self.active)
        )

    def _none(self, x) -> Envelopes:
        # The envelopes of no planes: the path is in the medium up to any e, and from any e on. They
        # are copies: each state of a loop has a variable of its own.
        width = dr.width(x, self.start, self.direction, self.toward, self.active)
        far, flat, number = (
            dr.full(type(x), _FAR, width),
            dr.zeros(type(x), width),
            dr.zeros(mi.UInt32, width),
        )
        return Envelopes((far, flat), (-far, flat + 0), (number, number + 0))

    def _tighter(self, x):
        """Return the step that takes a plane for an envelope at x if it has less, or more."""

        def step(number, line, envelopes):
            # A plane through which the light comes in, line[2], limits the path from above, e_1;
            # any other from below, e_0.
            value = dr.fma(line[1], x, line[0])
            less = line[2] & (value < _value(envelopes.least, x))
            more = ~line[2] & (value > _value(envelopes.largest, x))
            return _replaced(envelopes, number, line, less, more)

        return step

    def _walk(self, x) -> Envelopes:
        """Return the envelopes of paths to x that meet the medium, from facet to
        facet; others have e_0 > e_1.

        For points within the medium only the plane with the least e is searched.
        """
        step, sides = self._tighter(x), 1 if self.own else 2
        # Up to 16 planes are read faster than walked over. The walk makes frames of `three-media`,
        # with bodies of 320 and 120 facets, 6.4 times as fast as all planes: 69 and 437 ms (shadow
        # planes, 320 x 240, 29 November 2026).
        if self.bounded.count <= 16:
            return self._over_planes(self._none(x), step, self.active)

        # The path crosses the sphere around the medium on the light's side and on the other. The
        # facets in the directions of these places from the centre begin the walks.
        point, away = dr.fma(self.direction, x, self.start), self.away(x)
        length, radius = dr.norm(away), self.bounded.radius
        away = away / length
        nearest = -dr.dot(point, away)
        half = dr.sqrt(dr.maximum(dr.square(radius) - dr.squared_norm(dr.cross(point, away)), 0))
        envelopes = self._none(x)
        for side, end in enumerate((nearest + half, nearest - half)[:sides]):
            number = self._plane_towards(dr.fma(away, end, point) / radius)
            # The first walk may have met a plane of the other side: the second goes on from there.
            without = (envelopes.least[0] == _FAR, envelopes.largest[0] == -_FAR)[side]
            planes = tuple(dr.select(without, number, plane) for plane in envelopes.planes)
            envelopes = replace(envelopes, planes=planes)
            envelopes = self._descend(
                step(number, self._line(self.bounded.planes, number, self.active), envelopes),
                step,
                side,
            )
        # The walk may begin on the other side, with no neighbour on its own: then all planes count.
        unset = envelopes.least[0] == _FAR
        unset = unset if self.own else unset | (envelopes.largest[0] == -_FAR)
        return self._over_planes(envelopes, step, self.active & unset)

    def _descend(self, envelopes: Envelopes, step: Callable[..., Any], side: int) -> Envelopes:
        """Go from facet to facet while a neighbour has a tighter plane of one side: 0 for
        the least, 1 the largest.
        """

        def further(turn, searches, envelopes):
            # The search ends at a facet that none of its neighbours takes over from.
            after = self._over_neighbours(envelopes.planes[side], envelopes, step)
            return turn + 1, searches & (after.planes[side] != envelopes.planes[side]), after

        # Each turn finds a tighter plane, so that the number of planes bounds the turns.
        width = dr.width(envelopes.least[0])
        *_, envelopes = dr.while_loop(
            state=(
                dr.zeros(mi.UInt32, width),
                dr.full(mi.Bool, True, width) & self.active,
                envelopes,
            ),
            cond=lambda turn, searches, envelopes: searches & (turn < self.bounded.count),
            body=further,
            labels=("turn", "searches", "envelopes"),
        )
        return envelopes

    def _plane_towards(self, direction):
        """Return the number of a plane that is met in about a direction
        from the medium's centre.
        """
        # From -1 to 1 along each axis to the number of a cell.
        column, row, layer = (
            mi.UInt32(dr.clip(dr.fma(part, 0.5 * CELLS, 0.5 * CELLS), 0, CELLS - 1))
            for part in direction
        )
        return dr.gather(
            mi.UInt32, self.bounded.starts, (layer * CELLS + row) * CELLS + column, self.active
        )

    def next_change(self, envelopes: Envelopes, x) -> tuple[tuple[Any, Any], Envelopes]:
        """Return where other lines take over from the least and the largest
        at x [m], and these lines.

        `x` is at least a rounding error `beyond` the last change: so each is met once.
        """
        low, high = _value(envelopes.least, x), _value(envelopes.largest, x)

        def step(number, line, state):
            until_low, until_high, after = state
            constant, slope, facing = line
            # A line takes over where its gap to the envelope closes: from the least a line that
            # falls against it, from the largest one that rises against it.
            value = dr.fma(slope, x, constant)
            nearing = dr.select(facing, envelopes.least[1] - slope, slope - envelopes.largest[1])
            # Below 0 where rounding has let a crossing pass: the earliest is still
            # the next of the envelope.
            gap = dr.select(facing, value - low, high - value)
            at = dr.select(nearing > 0, x + gap / nearing, dr.inf)
            less, more = facing & (at < until_low), ~facing & (at < until_high)
            after = _replaced(after, number, line, less, more)
            return dr.select(less, at, until_low), dr.select(more, at, until_high), after

        # For points within the medium the next plane shares an edge with the present one.
        never = dr.full(type(x), dr.inf, dr.width(x, low))
        state = never, never + 0, envelopes
        if self.own:
            until_low, until_high, after = self._over_neighbours(envelopes.planes[0], state, step)
        else:
            until_low, until_high, after = self._over_planes(state, step, self.active)
        return (until_low, until_high), after

    def growth(self, envelopes: Envelopes | None, x, r, around, left):
        """Return how fast the depths of paths in this medium change along the ray at most [1/m],
        and the longest panel from x on, as far as this medium says [m].

        `around`: the extinctions of the medium around it [1/m]: a length l adds (sigma_k - sigma_0)
        l to a depth, which falls as fast in a bubble of thin fog. `left`: the channels that count,
        of which something is left on the way to the camera.
        """
        Float, nothing = type(x), type(x)(0)
        # By channel the length of which nothing is left, the change by a metre of it, `left`.
        channels = [
            (optical_reach(Float) / own, dr.abs(own - other), counts)
            for own, other, counts in zip(self.bounded.medium.sigma_t, around, left, strict=True)
        ]
        if envelopes is None:
            # The chord of a sphere changes like a root: `_smooth_chord` limits the panel, and
            # `_turning` stands for the rate. Paths that miss the sphere have no chord until they
            # graze it, where panels end; and of paths through most of a dense one nothing is left.
            turning = self._turning(r)
            longest = self._smooth_chord(x, turning)
            between = self._between(x, r, longest)
            rates = [
                dr.select(counts & (between <= reach), turning * change, nothing)
                for reach, change, counts in channels
            ]
            rate = dr.select(self.active & ~self._misses(x), reduce(dr.maximum, rates), 0)
            return rate, dr.select(self.active, longest, dr.inf)
        first, last = envelopes.ends(x)
        meets = self.active & (last > first)
        # `rising` is the rate of the logarithms of 1 + w e_0 and 1 + w e_1 together, and no
        # fraction of r changes faster than that; r itself grows by 1 m a metre at most. A panel
        # ends where 1 + e has changed by about half of itself.
        w = self.w
        rising = dr.abs(envelopes.least[1]) / (1 + w * last)
        rising += dr.select(first > 0, dr.abs(envelopes.largest[1]) / (1 + w * first), 0)
        rising = dr.select(meets, rising, 0)
        steepness = dr.select(meets, w + r * rising, 0)
        # While the length is beyond that of which nothing is left in a channel, a panel may take
        # half of what is beyond.
        length = r * ((last - first) / (1 + w * last)) / (1 + w * first)
        rate = nothing
        for reach, change, counts in channels:
            beyond_it = length - reach
            change = dr.select(beyond_it > 0, dr.minimum(change, 2 * CHANGE / beyond_it), change)
            rate = dr.maximum(rate, dr.select(counts, steepness * change, nothing))
        return rate, (0.5 / rising if w else Float(dr.inf))

    def _turning(self, r):
        """Return how far a path moves at a sphere where its point moves by 1 m [1].

        The path turns about the light, by 1/|D|. It moves by |M|/|D| at the sphere's centre, and
        by R/|D| at most in a sphere around the light. Within the medium the point moves itself.
        """
        if self.own or not self.w:
            return type(r)(1)
        return dr.minimum(dr.maximum(dr.norm(self.toward), self.bounded.radius) / r, 1)

    def _misses(self, x):
        """Return whether the path from x passes the sphere, beyond a hundredth of its squared
        radius and the rounding of coordinates: |p x M|^2 > R^2 |D|^2.
        """
        radius, place = self.bounded.radius, dr.fma(self.direction, x, self.start)
        rounding = (2.0**-18) * radius * dr.norm(place)
        reach = dr.fma(1.01 * radius, radius, rounding)
        cross = dr.squared_norm(dr.cross(place, self.toward))
        return cross > reach * dr.squared_norm(self.away(x))

    def _between(self, x, r, longest):
        """Return the length in the sphere of paths to points behind it, as the light sees them, and
        to those up to `longest`, in which q^2 falls by a fifth at most [m]; 0 for other paths.
        """
        nearest, half = self._chord(x, r)
        between = nearest > half
        if self.w:
            between &= nearest + half < r
        # The least panel of `_smooth_chord` may be longer than the chord keeps its length.
        kept = longest > 0.0021 * self.bounded.radius / self._turning(r)
        left = 2 * 0.89  # of half the chord: sqrt(0.8) = 0.894
        return dr.select(between & kept, left * half, 0)

    def _smooth_chord(self, x, turning):
        """Return the length in which q^2 changes by a fraction of it: q is a root of it [m].

        With f = |p x M|^2/|D|^2 it is R^2 - f, and over a length t f changes by

            (2 ((p x M) . (d x M) + w f D . d) t + (|d x M|^2 - w f) t^2)/|D - w t d|^2,

        whose divisor is taken for |D|^2: panels end before it changes by much. The second term
        counts where the first is none: where a segment begins with the longest chord of its paths.
        """
        # f, and the coefficients of its change: linear in t, `rate`, and square, `bend`.
        radius, away, w = self.bounded.radius, self.away(x), self.w
        cross = dr.cross(dr.fma(self.direction, x, self.start), self.toward)
        turned, square = dr.cross(self.direction, self.toward), dr.squared_norm(away)
        distance = dr.squared_norm(cross) / square
        rate = dr.abs(
            2 * (dr.dot(cross, turned) + w * distance * dr.dot(away, self.direction)) / square
        )
        bend = dr.abs(dr.squared_norm(turned) - w * distance) / square
        # The length t at which rate t + bend t^2 is a fifth of q^2, in a form that does not cancel.
        # In it paths move from 0.002 to 0.25 of the radius.
        change = 0.2 * dr.maximum(radius * radius - distance, 0)
        length = 2 * change / (rate + dr.sqrt(dr.fma(rate, rate, 4 * bend * change)))
        unit = radius / turning
        return dr.select(change > 0, dr.clip(length, 0.002 * unit, 0.25 * unit), dr.inf)

    def grazed_at(self) -> tuple[Any, ...]:
        """Return where the points lie whose paths graze a sphere: two distances or
        infinity [m]; () for planes.
        """
        if not self.round:
            return ()
        # |p x M|^2 - R^2 |D|^2 is a t^2 + 2 half t + c along the ray, with a and c as in `ends`.
        # Its discriminant is `inner`, the product of the module; `outside` is |M|^2 - w R^2.
        w, toward, start, direction = self.w, self.toward, self.start, self.direction
        square = dr.square(self.bounded.radius)
        away = toward - start if w else toward
        distance = dr.norm(toward)
        outside = (
            (distance - self.bounded.radius) * (distance + self.bounded.radius)
            if w
            else type(distance)(1)
        )
        cross, turned = dr.cross(start, toward), dr.cross(direction, toward)
        inner = square * dr.squared_norm(dr.cross(away, direction))
        inner = outside * (inner - dr.square(dr.dot(toward, dr.cross(start, direction))))
        half = dr.fma(w * square, dr.dot(away, direction), dr.dot(cross, turned))
        # One root is t/a, the other c/t: neither cancels.
        t = -(half + dr.mulsign(dr.sqrt(dr.maximum(inner, 0)), half))
        ends = (
            t / dr.fma(-w, square, dr.squared_norm(turned)),
            (dr.squared_norm(cross) - square * dr.squared_norm(away)) / t,
        )
        grazed = self.active & (inner > 0)
        return tuple(dr.select(grazed & dr.isfinite(x), x, dr.inf) for x in ends)

    def near_segment(self, x0, x1):
        """Return whether paths to points of a segment may meet the medium;
        never False where one does.

        They fill a triangle, or a strip without end, in the plane of ray and light. The medium's
        sphere may lie beside that plane, behind the ray, before the first path or beyond the last.
        """
        first, last = self.away(x0), self.away(x1)
        point0, point1 = (dr.fma(self.direction, x, self.start) for x in (x0, x1))
        plane = dr.cross(self.direction, first)
        beyond = dr.square(1.001 * self.bounded.radius)

        def outside(point, normal):
            # The medium's centre is the origin: `normal` points out of the triangle.
            height = dr.dot(point, normal)
            return (height < 0) & (dr.square(height) > beyond * dr.squared_norm(normal))

        # The normals, in this order: across the plane of ray and light, from the ray away from the
        # light, and across the first and the last path, away from the other one.
        beside = dr.square(dr.dot(point0, plane)) > beyond * dr.squared_norm(plane)
        behind = outside(point0, dr.cross(self.direction, plane))
        before = outside(point0, dr.cross(plane, first))
        after = outside(point1, dr.cross(last, plane))
        return ~(beside | behind | before | after)

    def near_points(self):
        """Return whether the paths to the origins of the rays may meet the medium;
        never False where one does.
        """
        away = self.away(type(self.start.x)(0))
        square, along = dr.squared_norm(away), -dr.dot(self.start, away)
        beyond = dr.square(1.001 * self.bounded.radius)
        # The place of the path, from the point at 0 to the light at 1, that is nearest to the
        # centre.
        nearest = dr.maximum(along / square, 0)
        nearest = dr.minimum(nearest, 1) if self.w else nearest
        return dr.squared_norm(dr.fma(away, nearest, self.start)) < beyond

    def _line(self, planes, number, active):
        """Return e of a plane along the rays, constant and slope, and whether the
        light comes in through it.
        """
        values = dr.gather(four_numbers(type(self.start.x)), planes, number, active)
        normal, offset = values.xyz, values.w
        # N = n . L - w c, and e = (c - n . P)/N of the module, with the centre as the origin.
        facing = dr.dot(normal, self.toward) - self.w * offset
        # A plane along the light is tilted a little.
        tilt = 16 * dr.epsilon(type(facing)) * (self.bounded.radius if self.w else 1)
        facing = dr.mulsign(dr.maximum(dr.abs(facing), tilt), facing)
        scale = dr.rcp(facing)
        return (
            (offset - dr.dot(normal, self.start)) * scale,
            -dr.dot(normal, self.direction) * scale,
            facing > 0,
        )

    def _over_planes(self, state, step: Callable[..., Any], active):
        """Return a state after step(number, line, state) over the planes."""
        _, state = dr.while_loop(
            state=(mi.UInt32(0), state),
            cond=lambda number, state: active & (number < self.bounded.count),
            body=lambda number, state: (
                number + 1,
                step(number, self._line(self.bounded.planes, number, active), state),
            ),
            labels=("number", "state"),
        )
        return state

    def _over_neighbours(self, plane, state, step: Callable[..., Any]):
        """Return a state after the planes that share an edge with one."""
        sides = self.bounded.sides

        # Planes of neighbours are side by side in a table of their own: one read each.
        def at(side, state):
            place = plane * sides + side
            number = dr.gather(mi.UInt32, self.bounded.neighbours, place, self.active)
            return step(number, self._line(self.bounded.beside, place, self.active), state)

        if sides <= 4:  # as many as facets of boxes have: no loop
            for side in range(sides):
                state = at(side, state)
            return state
        _, state = dr.while_loop(
            state=(mi.UInt32(0), state),
            cond=lambda side, state: side < sides,
            body=lambda side, state: (side + 1, at(side, state)),
            labels=("side", "state"),
        )
        return state


def paths_from(
    medium: Medium,
    light: Light,
    origin,
    direction,
    *,
    own=None,
    segment: tuple[Any, Any] | None = None,
    active=True,
) -> list[LightPaths]:
    """Return the paths from a light to the points of rays, by bounded medium.

    `own` is the number of the medium in which the points lie, if it is known; `segment` the ends of
    what the points lie on [m], if they are within one; `active` the lanes to compute.
    """
    paths = []
    for number, bounded in enumerate(medium.bounded_media):
        toward = light.toward(bounded.centre)
        path = LightPaths(
            bounded, light.w, toward, origin - bounded.centre, direction, active, own=number == own
        )
        # Paths to points within a medium always meet it. Others are left out where the triangle of
        # all paths to the segment lies beside the medium's sphere.
        if segment is not None and not path.own:
            path = replace(path, active=active & path.near_segment(*segment))
        paths.append(path)
    return paths


def beyond(x, size):
    """Return a distance a rounding error beyond x [m]: there the line
    counts that took over at x.

    `size` is that of the media [m]: coordinates are as large at the camera too, where x is 0.
    """
    return x + 64 * dr.epsilon(type(x)) * (x + size)


def chord(bounded: BoundedMedium, origin, direction) -> tuple[Any, Any]:
    """Return where rays enter and leave a medium [m], both infinite where they miss it;
    from within, 0 and the end.

    `origin` [m] is one for all lanes, `direction` unit vectors.
    """
    start = origin - bounded.centre
    nearest, across = -dr.dot(start, direction), dr.norm(dr.cross(start, direction))
    # A sphere: half of the chord as a product, which does not cancel for grazing rays.
    if bounded.planes is None:
        half = dr.sqrt(dr.maximum((bounded.radius - across) * (bounded.radius + across), 0))
        begin, end = dr.maximum(nearest - half, 0), nearest + half
    else:
        # A polyhedron: the ray is the path of a light at infinity in its direction. Rays that miss
        # the sphere around it need no walk.
        near = (across < 1.001 * bounded.radius) & (nearest > -1.001 * bounded.radius)
        path = LightPaths(bounded, 0.0, direction, start, dr.zeros(type(direction)), near)
        begin, end = path.ends_at(type(across)(0))
        end = dr.select(near, end, 0)
    hit = end > begin
    return dr.select(hit, begin, dr.inf), dr.select(hit, end, dr.inf)


def _value(line: tuple[Any, Any], x):
    return dr.fma(line[1], x, line[0])


def _replaced(envelopes: Envelopes, number, line, less, more) -> Envelopes:
    """Return envelopes with a line where it is `less` than the least or `more` than the largest."""
    least, largest = (
        (dr.select(chosen, line[0], old[0]), dr.select(chosen, line[1], old[1]))
        for chosen, old in ((less, envelopes.least), (more, envelopes.largest))
    )
    planes = (
        dr.select(less, number, envelopes.planes[0]),
        dr.select(more, number, envelopes.planes[1]),
    )
    return Envelopes(least, largest, planes)
