# SPDX-License-Identifier: BSD-3-Clause
"""Airlight in bounded media: homogeneous, convex and disjoint, in clear air or in another medium.

A ray runs through *pieces*, the bounded media that it meets and, where the air is not clear, the gaps between them. In
a piece of the medium j, over a lit segment of it,

    J = int exp(-tau_camera(x) - tau_light(x)) p / r^2 dx,

with the true optical depths on both legs. Camera: what is behind it when the ray enters the piece is one number a ray,
then sigma_j (x - x_j). Light: the leg from the light to x has the part l_k in the medium k
(`realtime.bounded_media.convex_clip`), and

    tau_light = sigma_0 r + sum_k (sigma_k - sigma_0) l_k,        sigma_0 = 0 in clear air.

In a medium, where the legs meet no other one, the segment is cut where the leg passes from facet to facet of it,
and further as depth and angle need it (`realtime.bounded_media.panels`). Elsewhere, and for the published
approximation, the nodes are those of Gauss and Legendre in the angle theta at the light, dx / r^2 = dtheta / h,
between the ends of the segment: with s = x - foot and the angle u from the near end, s_0, on

    s = h (s_0 cos u + h sin u)/(h cos u - s_0 sin u),     u_1 = atan2(h (s_1 - s_0), h^2 + s_0 s_1),

so that a segment far from the light or a ray close to it loses nothing. The parts l_k have kinks where the leg passes
an edge of a medium, or of its outline: segments are cut there. Where legs graze a sphere, l_k rises like a root:
segments are cut there too, and the rule is used in the u of u^2 (3 - 2 u), in which roots at both ends are smooth.

The published approximation (section 4.2) puts a constant R for r in the exponent, and takes the distance x_n at which
the ray enters from x. As printed it is

    L = k_t exp(-k_t (r + R - x_n)) Omega/(4 pi h) int I exp(-k_t R (sin theta + 1)/cos theta) p dtheta,

which cannot be meant: r before the integral is a variable of it, and the exponent within it counts R once more and lets
h go. The exponent
x - x_n + R with x = t + h tan theta gives

    L = k_t exp(-k_t (t + R - x_n)) Omega/(4 pi h) int I exp(-k_t h tan theta) p dtheta.

That is ``media=paper``. ``media=printed`` is the first equation with t for the r before the integral, which alone can
be meant, and the exponent within it as it stands. A kernel may have a polynomial for either
(`realtime.kernels.bounded`); without one they are summed over nodes. The paper has each medium alone: the light reaches
a body through clear air, however many bodies are before it. What is before the body on the camera's side is one factor
for a ray, and is kept.

References
----------
Biri, Arques, Michelin 2006, sections 4.2 and 5.2.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

from realtime.bounded_media.convex_clip import crossing_lines
from realtime.bounded_media.directional_airlight import ParallelRay
from realtime.bounded_media.envelopes import MOST_BENDS, Envelopes, Lines, beyond, next_change
from realtime.bounded_media.panels import MediumSegment, medium_integral
from realtime.bounded_media.ray_segments import (
    MediaRay,
    Piece,
    grazed_at,
    legs_near,
    light_leg,
    other_media_near,
    ray_envelopes,
    sum_over_pieces,
)
from realtime.bounded_media.views import light_views
from realtime.errors import InputError
from realtime.numerics.array_types import chosen_value, is_single
from realtime.numerics.fast_exp import exp_bounded
from realtime.numerics.gauss_legendre import unit_nodes
from realtime.rays.ray_light import distance_to_light, falloff, ray_geometry, smooth_subsegments
from realtime.scene.lights import Light
from realtime.scene.medium import Medium, least_extinction

FORMS = ("exact", "paper", "printed")
_NODES, _NODES_PAPER = 24, 6
_AT_ONCE = 8  # nodes that a kernel's code has side by side
_OPTICAL_REACH = 18.0  # e^-18 = 1.5e-8 of the light is left


@dataclass(frozen=True)
class PlacedRay(MediaRay):
    """Camera rays in bounded media, and one light that has a place; `ParallelRay` answers for one at infinity."""

    def airlight(self, x0, x1):
        """Return sum_j albedo_j sigma_j J_j over the lit segment [x0, x1], RGB [1/m^2].

        Parameters
        ----------
        x0, x1
            The segment [m]; `x1` may be infinite.

        Notes
        -----
        Valid for any segment. Times intensity / (4 pi) it is the radiance.
        """
        panels = smooth_subsegments(self.geometry, self.light, *self.geometry.lit_segment(x0, x1))
        zero = dr.zeros(type(self.medium.albedo), dr.width(self.geometry.height, x0, x1))
        return sum_over_pieces(self.pieces, panels, lambda *segment: _piece_integral(self, *segment), zero)

    def gamma(self, x):
        """Return the integral from where the ray enters the one piece up to the distance x, and beyond, RGB [1/m^2]."""
        (piece,) = self.pieces
        zero = dr.zeros(type(self.medium.albedo), dr.width(self.geometry.height, x))
        if self.polynomial is None:
            return self.airlight(type(x)(0), x)
        segment = self.geometry.lit_segment(piece.begin, dr.maximum(x, piece.begin))
        panels = smooth_subsegments(self.geometry, self.light, *segment)
        return sum((published_integral(self, piece, begin, end) for begin, end in panels), zero)

    def source(self, x):
        """Return albedo sigma exp(-tau) p at the distance x of the rays, RGB [1/m], 0 where nothing scatters."""
        Color = type(self.medium.albedo)
        total = dr.zeros(Color, dr.width(x))
        r = distance_to_light(self.geometry, x)
        for piece in self.pieces:
            total += dr.if_stmt(
                args=(x, r),
                cond=(x >= piece.begin) & (x < piece.end),
                true_fn=lambda x, r, piece=piece: _scattered(self, piece, _attenuation(self, piece, [x], [r])[0], x, r),
                false_fn=lambda x, r: Color(0),
            )
        return total


LitRay = PlacedRay | ParallelRay  #: camera rays in bounded media and one light: what answers `airlight` and `source`


def lit_ray(
    medium: Medium,
    light: Light,
    *,
    origin,
    direction,
    low=None,
    pieces: tuple[Piece, ...],
    form: str = "exact",
    views: tuple[Any, ...] | None = None,
    polynomial: Any = None,
) -> LitRay:
    """Return camera rays in bounded media with one light.

    Parameters
    ----------
    medium, light
        The medium with others in it, and any light.
    origin, direction, low
        The camera, one for all lanes [m], unit directions, and what rounding took from these if it is known.
    pieces
        Of the rays, from `realtime.bounded_media.ray_segments.camera_pieces`.
    form
        One of `FORMS`.
    views
        The media as the light sees them, from `realtime.bounded_media.views.light_views`, if they are known.
    polynomial
        For the published forms, what takes the place of nodes: a function (geometry, x0, x1, light, phase, (sigma_t,
        depth, R, printed)) -> J, see `realtime.kernels.bounded`.

    Raises
    ------
    InputError
        For the published form with a light at infinity.
    """
    if not light.w:
        if form != "exact":
            raise InputError(f"media={form}: the published approximation is of lights with a place; use media=exact")
        return ParallelRay(medium, light, origin, direction, pieces, views or light_views(medium, light))
    geometry = ray_geometry(origin, direction, light, low=low)
    # The published form needs no legs from the light.
    known = () if form != "exact" else views or light_views(medium, light)
    seen, entries = tuple(view.seen for view in known), tuple(view.entering for view in known)
    exits = tuple(view.leaving for view in known) if len(known) > 1 else ()
    place = geometry, origin - light.position, direction, pieces
    return PlacedRay(medium, light, *place, seen, entries, exits, form, polynomial)


def ambient_radiance(ray_pieces: tuple[Piece, ...], distance, ambient: float):
    """Return the light of a constant field in the media, RGB [W/(m^2 sr)]: albedo ambient (1 - exp(-tau)) a piece.

    `ambient` is the radiance of the field [W/(m^2 sr)]; what lies beyond `distance` [m] counts nothing.
    """
    total = type(ray_pieces[0].medium.albedo)(0)
    for piece in ray_pieces:
        length = dr.maximum(dr.minimum(dr.minimum(piece.end, distance), 1e30) - piece.begin, 0)
        kept = [dr.exp(-tau) - dr.exp(-dr.fma(s, length, tau)) for s, tau in zip(piece.medium.sigma_t, piece.before)]
        channels = [dr.select(length > 0, value, 0) for value in kept]
        total += piece.medium.albedo * (ambient * type(total)(*channels))
    return total


def check_form(medium: Medium, form: str) -> None:
    """Refuse a form that is unknown or does not fit the media.

    Raises
    ------
    InputError
        For a name that is not in `FORMS`, and for the published form in media that another one surrounds.
    """
    if form not in FORMS:
        raise InputError(f"media: got {form!r}, wanted one of {', '.join(FORMS)}")
    if form != "exact" and medium.bounded_media and not medium.clear:
        raise InputError(f"media={form}: wanted clear air around the bounded media; use media=exact")


def _piece_integral(ray: MediaRay, piece: Piece, x0, x1):
    """Integrate one segment in one piece."""
    if ray.form != "exact":
        return _integral(ray, piece, x0, x1)
    if piece.number is None:
        return _integral_between_bends(ray, piece, x0, x1)
    number = piece.number
    segment = MediumSegment(
        medium=piece.medium,
        around=None if ray.medium.clear else ray.medium.sigma_t,
        light=ray.light,
        geometry=ray.geometry,
        start=ray.start,
        direction=ray.direction,
        begin=piece.begin,
        before=piece.before,
        seen=ray.seen[number],
        planes=ray.entries[number],
    )
    if len(ray.seen) == 1:
        return medium_integral(segment, x0, x1)
    return dr.if_stmt(
        args=(x0, x1),
        cond=other_media_near(ray, number, x0, x1),
        true_fn=lambda x0, x1: _integral_between_bends(ray, piece, x0, x1),
        false_fn=lambda x0, x1: medium_integral(segment, x0, x1),
    )


def _integral_between_bends(ray: MediaRay, piece: Piece, x0, x1):
    """Integrate one segment in one piece, from one bend of the legs to the next."""
    x1 = dr.minimum(x1, x0 + _OPTICAL_REACH / least_extinction(piece.medium))
    ends = [x0, x1], [distance_to_light(ray.geometry, x) for x in (x0, x1)]
    grazes: list[Any] = []
    lines: dict[int, Lines] = {}
    for number, seen in enumerate(ray.seen):
        own = number == piece.number
        if seen.planes is not None:
            lines[number] = crossing_lines(seen, ray.start, ray.direction, own or legs_near(ray, seen, *ends))
        elif not own:
            grazes += grazed_at(seen, ray)

    def part(turn, begin, envelopes, total):
        at = beyond(begin)
        changes = {number: next_change(lines[number], own, at) for number, own in envelopes.items()}
        end = x1
        for x in grazes:
            end = dr.minimum(end, dr.select(x > at, x, dr.inf))
        for change in changes.values():
            end = dr.minimum(end, change.next_bend(1))
        total += _integral(ray, piece, begin, end, envelopes=envelopes, like_roots=bool(grazes))
        envelopes = {number: change.envelopes(end) for number, change in changes.items()}
        return turn + 1, dr.maximum(end, at), envelopes, total

    width = dr.width(ray.geometry.height, x0, x1)
    begin = x0 + dr.zeros(type(ray.geometry.height), width)
    envelopes = {number: ray_envelopes(own, beyond(begin)) for number, own in lines.items()}
    *_, total = dr.while_loop(
        state=(dr.zeros(mi.UInt32, width), begin, envelopes, dr.zeros(type(ray.medium.albedo), width)),
        cond=lambda turn, begin, envelopes, total: (begin < x1) & (turn < MOST_BENDS),
        body=part,
        labels=("turn", "begin", "envelopes", "total"),
    )
    return total


def _integral(
    ray: MediaRay,
    piece: Piece,
    x0,
    x1,
    *,
    envelopes: Mapping[int, Envelopes] | None = None,
    like_roots: bool = False,
):
    """Integrate one segment in one piece; its integrand may rise and fall `like_roots` at the ends."""
    if ray.polynomial is not None:
        return published_integral(ray, piece, x0, x1)
    Float = type(ray.geometry.height)
    x1 = dr.minimum(x1, x0 + _OPTICAL_REACH / least_extinction(piece.medium))
    # A ray passes through the light itself: its integral is infinite, and so nearly is this value.
    h = dr.maximum(ray.geometry.height, 1e-15)
    s0, s1 = x0 - ray.geometry.foot, x1 - ray.geometry.foot
    width = dr.select(dr.isfinite(x1), dr.atan2(h * (s1 - s0), dr.fma(h, h, s0 * s1)), dr.atan2(h, s0))
    nodes = unit_nodes(_node_count(ray.form, single=is_single(Float)))
    if like_roots:  # in the t of t^2 (3 - 2 t) it is smooth
        nodes = tuple((t * t * (3 - 2 * t), 6 * t * (1 - t) * weight) for t, weight in nodes)

    def part(nodes):
        """Add up the terms of some nodes: the planes of media are read once for all of them."""
        xs, rs = [], []
        for fraction, _ in nodes:
            sine, cosine = dr.sincos(width * fraction)
            s = h * dr.fma(s0, cosine, h * sine) / dr.fma(h, cosine, -s0 * sine)
            xs.append(ray.geometry.foot + s)
            rs.append(dr.sqrt(dr.fma(s, s, h * h)))
        exact = ray.form == "exact"
        kept = _attenuation(ray, piece, xs, rs, envelopes) if exact else _paper_attenuation(ray, piece, xs)
        return sum(
            weight * _scattered(ray, piece, value, x, r)
            for (_, weight), value, x, r in zip(nodes, kept, xs, rs, strict=True)
        )

    return _sum_in_parts(nodes, part, dr.zeros(type(ray.medium.albedo), dr.width(h, s0, s1))) * (width / h)


def _sum_in_parts(nodes: Sequence[tuple[float, float]], part: Callable[[Sequence[tuple[Any, Any]]], Any], zero):
    """Return the sum of `part` over parts of the nodes, by a loop whose code has one part.

    The integral is recorded for every piece, light and walk: with all nodes written out kernels took a minute to
    compile in scenes with several lights and media, and ran no faster.
    """
    turns, left = divmod(len(nodes), _AT_ONCE)
    if turns < 2 or left:
        return part(nodes)
    Float = type(zero.x)

    def body(turn, total):
        columns = [nodes[first::_AT_ONCE] for first in range(_AT_ONCE)]
        numbers = [[tuple(map(Float, values)) for values in zip(*column, strict=True)] for column in columns]
        chosen = [tuple(chosen_value(values, turn) for values in pair) for pair in numbers]
        return turn + 1, total + part(chosen)

    _, total = dr.while_loop(
        state=(mi.UInt32(0), zero), cond=lambda turn, total: turn < turns, body=body, labels=("turn", "total")
    )
    return total


def _node_count(form: str, *, single: bool) -> int:
    if form == "paper":
        return _NODES_PAPER
    return _NODES if single or form == "printed" else 2 * _NODES


def _scattered(ray: MediaRay, piece: Piece, transmittance: list[Any], x, r):
    """Return albedo sigma p and the spot's profile times a transmittance, as a colour."""
    Color = type(ray.medium.albedo)
    weight = piece.medium.phase.evaluate((ray.geometry.foot - x) / r)
    if ray.light.varies:
        weight = weight * falloff(ray.geometry, ray.light, x)
    channels = [sigma * weight * value for sigma, value in zip(piece.medium.sigma_t, transmittance)]
    return piece.medium.albedo * Color(*channels)


def _attenuation(
    ray: MediaRay, piece: Piece, xs, rs, envelopes: Mapping[int, Envelopes] | None = None
) -> list[list[Any]]:
    """Return exp(-tau) of both legs, by node and channel."""
    insides = light_leg(ray, piece, xs, rs, envelopes)
    result = []
    for node, (x, r) in enumerate(zip(xs, rs)):
        channels = []
        for channel, around in enumerate(ray.medium.sigma_t):
            depth = piece.before[channel] + piece.medium.sigma_t[channel] * (x - piece.begin)
            if not ray.medium.clear:
                depth += around * r
            for bounded_medium, inside in zip(ray.medium.bounded_media, insides):
                depth += (bounded_medium.medium.sigma_t[channel] - around) * inside[node]
            channels.append(exp_bounded(-depth))
        result.append(channels)
    return result


def _paper_attenuation(ray: MediaRay, piece: Piece, xs) -> list[list[Any]]:
    """Return exp(-tau) with the constant R for the light's leg, by node and channel."""
    assert piece.number is not None
    distance = ray.medium.bounded_media[piece.number].mean_distance
    constants = [before + s * (distance - piece.begin) for before, s in zip(piece.before, piece.medium.sigma_t)]
    if ray.form == "printed":
        return [[dr.exp(-depth) for depth in _printed_depths(ray, piece, x, distance, constants)] for x in xs]
    return [[exp_bounded(-(constant + s * x)) for constant, s in zip(constants, piece.medium.sigma_t)] for x in xs]


def _printed_depths(ray: MediaRay, piece: Piece, x, distance, constants):
    """Return t + R - x_n and R (sin theta + 1)/cos theta in optical depths, by channel."""
    geometry = ray.geometry
    s, h = x - geometry.foot, dr.maximum(geometry.height, 1e-15)
    r = dr.sqrt(dr.fma(s, s, h * h))
    ratio = dr.select(s > 0, (r + s) / h, h / (r - s))  # neither cancels
    return [c + sigma * (geometry.foot + distance * ratio) for c, sigma in zip(constants, piece.medium.sigma_t)]


def published_integral(ray: MediaRay, piece: Piece, x0, x1):
    """Return albedo sigma J over a segment with the constant R, by the polynomial of a kernel, a colour [1/m^2].

    The segment may lie before the medium: there the exponent is continued, as section 4.2 does that begins all
    integrals at the camera.
    """
    assert piece.number is not None
    distance = ray.medium.bounded_media[piece.number].mean_distance
    channels = []
    for before, sigma in zip(piece.before, piece.medium.sigma_t):
        depth = dr.fma(sigma, distance - piece.begin, before)
        leg = sigma, depth, distance, ray.form == "printed"
        channels.append(sigma * ray.polynomial(ray.geometry, x0, x1, ray.light, piece.medium.phase, leg))
    return piece.medium.albedo * type(ray.medium.albedo)(*channels)
