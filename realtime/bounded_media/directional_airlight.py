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
2 u), such an end is smooth; Gauss and Legendre's nodes in u do the rest. So they do for media of many planes, whose
bends lie close together and are small: there the rule is of second order. Pieces are cut so that none is optically
thick.

In a medium without bounds nothing arrives: the light would have crossed an endless way through it.
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

from realtime.bounded_media.directional_legs import ParallelSeen, cylinder_bend, parallel_legs, slope_from
from realtime.bounded_media.ray_segments import Piece, sum_over_pieces
from realtime.numerics.array_types import is_single
from realtime.numerics.fast_exp import exp_bounded
from realtime.numerics.gauss_legendre import unit_nodes
from realtime.scene.lights import Light
from realtime.scene.medium import Medium, least_extinction

_FEW_PLANES = 12  # whose bends are worth the search for them
_NODES, _NODES_DOUBLE = 10, 24
_THICK = 8.0  # optical depth of the pieces that nodes are placed in
_DARK = 60.0  # optical depth before the camera beyond which nothing is left, e^-60 = 9e-27
_PIECES = 512  # of a ray in a medium, at most: no rounding can make a loop endless


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
    linear = all(_has_few_planes(seen) for seen in ray.seen)
    Float, Color = type(x0), type(ray.medium.albedo)
    reach = piece.begin + _DARK / least_extinction(piece.medium)
    x1 = dr.minimum(x1, reach)
    slack = 64 * dr.epsilon(Float)

    def step(count, x, total):
        at = x + slack * (x + 1)
        if linear:
            slopes = [slope_from(seen, ray.origin, ray.direction, at) for seen in ray.seen]
            end = x1
            for slope in slopes:
                end = dr.minimum(end, slope.until)
            channels = _linear_channels(ray, piece, slopes, at, x, end)
        else:
            end = dr.minimum(_next_facet_change(ray, at, x1), x + _THICK / _largest_extinction(piece.medium))
            channels = _node_channels(ray, piece, x, end)
        return count + 1, dr.maximum(end, at), total + Color(*channels)

    width = dr.width(x0, x1)
    _, _, total = dr.while_loop(
        state=(dr.zeros(mi.UInt32, width), x0 + dr.zeros(Float, width), dr.zeros(Color, width)),
        cond=lambda count, x, total: (x < x1) & (count < _PIECES),
        body=step,
        labels=("count", "x", "total"),
    )
    return _weight(ray, piece) * total


def _has_few_planes(seen: ParallelSeen) -> bool:
    return seen.planes is not None and seen.bounded_medium.count <= _FEW_PLANES


def _linear_channels(ray: ParallelRay, piece: Piece, slopes, at, x, end) -> list[Any]:
    """Return the integral from x to end, by channel, where the legs are linear."""
    lengths = [[dr.maximum(dr.fma(slope.rate, here - at, slope.length), 0) for slope in slopes] for here in (x, end)]
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


def _next_facet_change(ray: ParallelRay, at, x1):
    """Return where the legs bend next beyond `at`, or the end of the segment."""
    end = x1
    for seen in ray.seen:
        if seen.planes is None:
            end = dr.minimum(end, cylinder_bend(seen, ray.origin, ray.direction, at))
        elif _has_few_planes(seen):
            end = dr.minimum(end, slope_from(seen, ray.origin, ray.direction, at).until)
    return end


def _node_channels(ray: ParallelRay, piece: Piece, x, end) -> list[Any]:
    """Return the integral from x to end, by channel, by nodes that are close at both ends."""
    nodes = unit_nodes(_NODES if is_single(type(x)) else _NODES_DOUBLE)
    xs = [x + (end - x) * (u * u * (3 - 2 * u)) for u, _ in nodes]
    weights = [weight * 6 * u * (1 - u) for u, weight in nodes]
    kept = _attenuation(ray, piece, xs)
    return [
        (end - x) * sum(weight * values[channel] for weight, values in zip(weights, kept))
        for channel in range(len(piece.medium.sigma_t))
    ]


def _attenuation(ray: ParallelRay, piece: Piece, xs) -> list[list[Any]]:
    """Return exp(-tau) of both legs, by node and channel."""
    insides = [parallel_legs(seen, ray.origin, ray.direction, xs) for seen in ray.seen]
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
