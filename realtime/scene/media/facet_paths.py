# SPDX-License-Identifier: BSD-3-Clause
"""Where the paths from a light to the points of a ray cross the planes of a convex medium.

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
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import mitsuba as mi

from airlight.realtime.numerics.array_types import four_numbers
from airlight.realtime.scene.closed_mesh import CELLS
from airlight.realtime.scene.media.medium import Homogeneous

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
class FacetPaths:
    """The paths from a light to the points of rays, and the planes of one bounded medium."""

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
