# SPDX-License-Identifier: BSD-3-Clause
"""The least of some lines along a ray and the largest of others: where legs from a light run through a polyhedron.

Every plane of a convex medium gives a line c + s x along a ray, x the distance from the camera: for a light with a
place 1/f, with f where the leg crosses the plane (`realtime.bounded_media.convex_clip`), for light from infinity how
far before the point that is (`realtime.bounded_media.directional_legs`). The planes through which legs enter or leave
are the least of the lines of one side and the largest of those of the other: *envelopes*, which bend where another line
takes over. The least of lines is concave, so beyond a place only steeper falling lines can take over from the one that
is least there, and the first of them to cross it does. One pass over the planes finds that place, and the line.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

Line = tuple[Any, Any]  #: c and s [1/m]

MOST_BENDS = 512  #: of a segment: no rounding can make a loop endless


@dataclass(frozen=True)
class Lines:
    """The lines of the planes of a medium along rays."""

    line: Callable[[Any], tuple[Any, Any, Any]]  #: by number c, s, and whether it is of those of which the least counts
    count: int
    active: Any = True  #: lanes in which legs may meet the medium; in others no line counts


@dataclass
class Envelopes:
    """The lines that are least and largest at a place; where there is none, infinite ones."""

    least: Line
    largest: Line

    def values(self, x) -> tuple[Any, Any]:
        """Return the least and the largest value at a distance [m] on both lines."""
        return _at(self.least, x), _at(self.largest, x)

    def crossing(self, x, level: float):
        """Return the next distance beyond x at which the lines meet one another or a level, or infinity [m]."""
        (low, high), (falling, rising) = self.values(x), (self.least[1], self.largest[1])
        gaps = (low - high, rising - falling), (low - level, -falling), (high - level, -rising)
        until = type(x)(dr.inf)
        for gap, closing in gaps:
            ahead = gap / closing
            until = dr.minimum(until, dr.select(ahead > 0, x + ahead, dr.inf))
        return until


@dataclass(frozen=True)
class Change:
    """What becomes of envelopes beyond a place."""

    before: Envelopes
    after: Envelopes  #: with the lines that take over next
    ends: tuple[Any, Any]  #: where they do [m]
    x: Any  #: the place [m]

    @property
    def next(self):
        """Where the first of them does, or infinity [m]."""
        return dr.maximum(dr.minimum(*self.ends), self.x)

    def next_bend(self, level: float):
        """Return where that is, or the lines meet one another or a level before it, or infinity [m]."""
        return dr.minimum(self.next, self.before.crossing(self.x, level))

    def envelopes(self, x) -> Envelopes:
        """Return the envelopes from x on, a distance not beyond the next change of either [m]."""
        least, largest = (
            _chosen(end <= x, new, old)
            for end, new, old in zip(
                self.ends, (self.after.least, self.after.largest), (self.before.least, self.before.largest)
            )
        )
        return Envelopes(least, largest)


def beyond(x):
    """Return a distance a rounding error beyond x [m]: there the line counts that took over at x."""
    return x + 64 * dr.epsilon(type(x)) * (x + 1)


def envelopes_at(lines: Lines, x) -> Envelopes:
    """Return the envelopes of lines at a distance x [m]."""
    Float = type(x)
    width = dr.width(x, lines.active)

    def step(number, low, high, found):
        constant, slope, of_least = lines.line(number)
        value = dr.fma(slope, x, constant)
        less, more = of_least & (value < low), ~of_least & (value > high)
        line = constant, slope
        found = Envelopes(_chosen(less, line, found.least), _chosen(more, line, found.largest))
        return number + 1, dr.select(less, value, low), dr.select(more, value, high), found

    low, high = dr.full(Float, dr.inf, width), dr.full(Float, -dr.inf, width)
    none = Envelopes((low + 0, dr.zeros(Float, width)), (high + 0, dr.zeros(Float, width)))
    *_, found = dr.while_loop(
        state=(mi.UInt32(0), low, high, none),
        cond=lambda number, low, high, found: lines.active & (number < lines.count),
        body=step,
        labels=("number", "low", "high", "found"),
    )
    return found


def next_change(lines: Lines, envelopes: Envelopes, x) -> Change:
    """Return where other lines take over from the envelopes at x, and which.

    `x` is at least a rounding error `beyond` the last change [m]: so each is met once.
    """
    Float = type(x)
    low, high = envelopes.values(x)

    def step(number, until_low, until_high, after):
        constant, slope, of_least = lines.line(number)
        value = dr.fma(slope, x, constant)
        nearing = dr.select(of_least, envelopes.least[1] - slope, slope - envelopes.largest[1])
        # Below 0 where rounding has let a crossing pass: the earliest is still the next of the envelope.
        gap = dr.select(of_least, value - low, high - value)
        at = dr.select(nearing > 0, x + gap / nearing, dr.inf)
        less, more = of_least & (at < until_low), ~of_least & (at < until_high)
        line = constant, slope
        after = Envelopes(_chosen(less, line, after.least), _chosen(more, line, after.largest))
        return number + 1, dr.select(less, at, until_low), dr.select(more, at, until_high), after

    never = dr.full(Float, dr.inf, dr.width(x, low, lines.active))
    _, until_low, until_high, after = dr.while_loop(
        state=(mi.UInt32(0), never, never + 0, envelopes),
        cond=lambda number, until_low, until_high, after: lines.active & (number < lines.count),
        body=step,
        labels=("number", "until_low", "until_high", "after"),
    )
    return Change(envelopes, after, (until_low, until_high), x)


def _at(line: Line, x):
    return dr.fma(line[1], x, line[0])


def _chosen(condition, new: Line, old: Line) -> Line:
    return dr.select(condition, new[0], old[0]), dr.select(condition, new[1], old[1])
