# SPDX-License-Identifier: BSD-3-Clause
"""Airlight of a directional light, in bounded media in clear air.

Light of the irradiance E arrives everywhere from one direction, along the unit vector a. In the medium j a ray has

    L = E/(4 pi) p(cos) albedo_j sigma_j int exp(-tau_camera(x) - sum_k sigma_k l_k(x)) dx,        cos = -a . d,

with l_k the part in the medium k of the leg to the light (`realtime.bounded_media.directional_legs`). The cosine is one
for a ray: for narrow lobes (1 - cos)/2 = |a + d|^2 / 4 and (1 + cos)/2 = |a - d|^2 / 4 keep all digits.

Between two bends of polyhedra the exponent is linear, from tau_0 to tau_1 over the length D, and the integral is

    D exp(-min(tau_0, tau_1)) (1 - exp(-z))/z,      z = |tau_1 - tau_0|,

where 1 - exp(-z) = 2 T/(1 + T), T = tanh(z/2), cancels nothing. A bend is met a rounding error late: lines are extended
back to it, and no leg becomes shorter than nothing.

With spheres, q = sqrt(R^2 - |w x a|^2) ends like a square root at both ends of a piece. In u, with x = x_0 + D u^2 (3 -
2 u), such an end is smooth; Gauss and Legendre's nodes in u do the rest, between the bends of polyhedra, too. Pieces
are cut so that none is optically thick.

In a medium without bounds nothing arrives: the light would have crossed an endless way through it.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

from realtime.bounded_media.directional_legs import ParallelSeen, cylinder_bend, leg_lines, linear_length, parallel_legs
from realtime.bounded_media.envelopes import MOST_BENDS, Envelopes, beyond, envelopes_at, next_change
from realtime.bounded_media.ray_segments import Piece, sum_over_pieces
from realtime.numerics.array_types import is_single
from realtime.numerics.fast_exp import exp_bounded
from realtime.numerics.gauss_legendre import unit_nodes
from realtime.scene.lights import Light
from realtime.scene.medium import Medium, least_extinction

_NODES, _NODES_DOUBLE = 10, 24
_THICK = 8.0  # optical depth of the pieces that nodes are placed in
_DARK = 60.0  # optical depth before the camera beyond which nothing is left, e^-60 = 9e-27


@dataclass(frozen=True)
class ParallelRay:
    """Camera rays in bounded media, and a directional light."""

    medium: Medium
    light: Light
    origin: Any  #: the camera [m]
    direction: Any  #: unit directions
    pieces: tuple[Piece, ...]
    seen: tuple[ParallelSeen, ...]

    def airlight(self, x0, x1):
        """Return sum_j albedo_j sigma_j p times the integral over the lit segment [x0, x1], RGB [1].

        Parameters
        ----------
        x0, x1
            The segment [m]; `x1` may be infinite.

        Notes
        -----
        Valid for any segment. Times irradiance / (4 pi) it is the radiance.
        """
        zero = dr.zeros(type(self.medium.albedo), dr.width(x0, x1, self.direction))
        return sum_over_pieces(self.pieces, [(x0, x1)], lambda *segment: _integral(self, *segment), zero)

    def source(self, x):
        """Return albedo sigma exp(-tau) p at the distance x of the rays, RGB [1/m], 0 where nothing scatters."""
        Color = type(self.medium.albedo)
        total = dr.zeros(Color, dr.width(x))
        for piece in self.pieces:
            total += dr.if_stmt(
                args=(x,),
                cond=(x >= piece.begin) & (x < piece.end),
                true_fn=lambda x, piece=piece: _weight(self, piece) * Color(*_attenuation(self, piece, [x])[0]),
                false_fn=lambda x: Color(0),
            )
        return total


def _integral(ray: ParallelRay, piece: Piece, x0, x1):
    """Integrate one segment in one piece, from bend to bend."""
    linear = all(seen.planes is not None for seen in ray.seen)
    Float, Color = type(x0), type(ray.medium.albedo)
    reach = piece.begin + _DARK / least_extinction(piece.medium)
    x1 = dr.minimum(x1, reach)
    lines = {
        number: leg_lines(seen, ray.origin, ray.direction)
        for number, seen in enumerate(ray.seen)
        if seen.planes is not None
    }

    def step(turn, x, envelopes, total):
        at = beyond(x)
        changes = {number: next_change(lines[number], own, at) for number, own in envelopes.items()}
        end = x1
        for change in changes.values():
            end = dr.minimum(end, change.next_bend(0))
        if linear:
            channels = _linear_channels(ray, piece, envelopes, at, x, end)
        else:
            end = dr.minimum(_next_cylinder(ray, at, end), x + _THICK / _largest_extinction(piece.medium))
            channels = _node_channels(ray, piece, envelopes, x, end)
        envelopes = {number: change.envelopes(end) for number, change in changes.items()}
        return turn + 1, dr.maximum(end, at), envelopes, total + Color(*channels)

    width = dr.width(x0, x1)
    x0 = x0 + dr.zeros(Float, width)
    envelopes = {number: envelopes_at(own, beyond(x0)) for number, own in lines.items()}
    *_, total = dr.while_loop(
        state=(dr.zeros(mi.UInt32, width), x0, envelopes, dr.zeros(Color, width)),
        cond=lambda turn, x, envelopes, total: (x < x1) & (turn < MOST_BENDS),
        body=step,
        labels=("turn", "x", "envelopes", "total"),
    )
    return _weight(ray, piece) * total


def _linear_channels(ray: ParallelRay, piece: Piece, envelopes, at, x, end) -> list[Any]:
    """Return the integral from x to end, by channel, where the legs are linear."""
    slopes = [linear_length(own, at) for own in envelopes.values()]
    lengths = [[dr.maximum(dr.fma(rate, here - at, length), 0) for length, rate in slopes] for here in (x, end)]
    channels = []
    for channel, own in enumerate(piece.medium.sigma_t):
        depths = []
        for here, parts in zip((x, end), lengths):
            depth = dr.fma(own, here - piece.begin, piece.before[channel])
            for seen, length in zip(ray.seen, parts):
                depth = dr.fma(seen.bounded_medium.medium.sigma_t[channel], length, depth)
            depths.append(depth)
        z = dr.maximum(dr.abs(depths[1] - depths[0]), 1e-30)
        tangent = dr.tanh(0.5 * z)
        mean = exp_bounded(-dr.minimum(*depths)) * (2 * tangent / ((1 + tangent) * z))
        channels.append(dr.maximum(end - x, 0) * mean)
    return channels


def _next_cylinder(ray: ParallelRay, at, x1):
    """Return where legs begin or end to meet a sphere next beyond `at`, or the end of the segment."""
    end = x1
    for seen in ray.seen:
        if seen.planes is None:
            end = dr.minimum(end, cylinder_bend(seen, ray.origin, ray.direction, at))
    return end


def _node_channels(ray: ParallelRay, piece: Piece, envelopes, x, end) -> list[Any]:
    """Return the integral from x to end, by channel, by nodes that are close at both ends."""
    nodes = unit_nodes(_NODES if is_single(type(x)) else _NODES_DOUBLE)
    xs = [x + (end - x) * (u * u * (3 - 2 * u)) for u, _ in nodes]
    weights = [weight * 6 * u * (1 - u) for u, weight in nodes]
    kept = _attenuation(ray, piece, xs, envelopes)
    return [
        (end - x) * sum(weight * values[channel] for weight, values in zip(weights, kept))
        for channel in range(len(piece.medium.sigma_t))
    ]


def _attenuation(
    ray: ParallelRay, piece: Piece, xs, envelopes: Mapping[int, Envelopes] | None = None
) -> list[list[Any]]:
    """Return exp(-tau) of both legs, by node and channel; `envelopes` by medium, where they are known for all nodes."""
    known = envelopes or {}
    insides = [
        [linear_length(known[number], x)[0] for x in xs]
        if number in known
        else parallel_legs(seen, ray.origin, ray.direction, xs)
        for number, seen in enumerate(ray.seen)
    ]
    result = []
    for node, x in enumerate(xs):
        channels = []
        for channel, own in enumerate(piece.medium.sigma_t):
            depth = piece.before[channel] + own * (x - piece.begin)
            for seen, inside in zip(ray.seen, insides):
                depth += seen.bounded_medium.medium.sigma_t[channel] * inside[node]
            channels.append(exp_bounded(-depth))
        result.append(channels)
    return result


def _weight(ray: ParallelRay, piece: Piece):
    """Return albedo sigma p, as a colour [1/m]."""
    down = 0.25 * dr.squared_norm(ray.light.axis + ray.direction)
    up = 0.25 * dr.squared_norm(ray.light.axis - ray.direction)
    phase = piece.medium.phase.evaluate_half(down, up)
    return piece.medium.albedo * type(ray.medium.albedo)(*(sigma * phase for sigma in piece.medium.sigma_t))


def _largest_extinction(medium: Medium):
    largest = medium.sigma_t[0]
    for sigma_t in medium.sigma_t[1:]:
        largest = dr.maximum(largest, sigma_t)
    return largest
