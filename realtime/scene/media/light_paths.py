# SPDX-License-Identifier: BSD-3-Clause
"""How much of the paths from a light to the points of a ray lies in a convex medium, and how fast
that changes along the ray.

For a polyhedron the ends e_0 and e_1 of this part are those of
`realtime.scene.media.facet_paths`, whose names hold here too.

**Spheres.** With C and R the middle and the radius, p = P - C and M = L - w C, p x D = p x M is
linear in x too. The path is nearest to C at the distance b = -p . D/|D| from P, and half its chord
is q, q^2 = R^2 - |p x M|^2/|D|^2. Paths graze the sphere where

    |p x M|^2 = R^2 |D|^2,
    with the discriminant (|M|^2 - w R^2)(R^2 |D x d|^2 - (M . (p x d))^2),

whose second factor is one difference. Before and behind these points q rises like a root.
"""

from dataclasses import dataclass, replace
from functools import reduce
from typing import Any

import drjit as dr

from airlight.realtime.scene.lights import Light
from airlight.realtime.scene.media.facet_paths import BoundedMedium, Envelopes, FacetPaths
from airlight.realtime.scene.media.medium import Medium, optical_reach
from airlight.realtime.scene.rule_reach import CHANGE


@dataclass(frozen=True)
class LightPaths(FacetPaths):
    """The paths from a light to the points of rays, and their lengths in one bounded medium."""

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
