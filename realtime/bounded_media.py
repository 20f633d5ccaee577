# SPDX-License-Identifier: BSD-3-Clause
"""Airlight in bounded media: bodies of homogeneous media, each convex, disjoint, in clear air or in another medium.

A ray runs through *pieces*, the bodies that it meets and, where the air is not clear, the gaps between them. In a piece
of the medium j, over a lit segment of it,

    J = int exp(-tau_camera(x) - tau_light(x)) p / r^2 dx,

with the true optical depths on both legs. Camera: what is behind it when the ray enters the piece is one number a ray,
then sigma_j (x - x_j). Light: the leg from the light to x has the part l_k in the body k (`realtime.clipping`), and

    tau_light = sigma_0 r + sum_k (sigma_k - sigma_0) l_k,        sigma_0 = 0 in clear air.

The nodes are those of Gauss and Legendre in the angle theta at the light, dx / r^2 = dtheta / h, between the ends of
the segment: with s = x - foot and the angle u from the near end, s_0, on

    s = h (s_0 cos u + h sin u)/(h cos u - s_0 sin u),     u_1 = atan2(h (s_1 - s_0), h^2 + s_0 s_1),

so that a segment far from the light or a ray close to it loses nothing. The parts l_k have kinks where the leg passes
an edge of the body, and there the rule is of second order.

The published approximation (section 4.2) puts a constant R for r in the exponent, and takes the distance x_n at which
the ray enters from x. As printed it is

    L = k_t exp(-k_t (r + R - x_n)) Omega/(4 pi h) int I exp(-k_t R (sin theta + 1)/cos theta) p dtheta,

which cannot be meant: r before the integral is a variable of it, and the exponent within it counts R once more and lets
h go. The exponent
x - x_n + R with x = t + h tan theta gives

    L = k_t exp(-k_t (t + R - x_n)) Omega/(4 pi h) int I exp(-k_t h tan theta) p dtheta.

That is ``media=paper``. The paper has each medium alone: the light reaches a body through clear air, however many
bodies are before it. What is before the body on the camera's side is one factor for a ray, and is kept.

References
----------
Biri, Arques, Michelin 2006, sections 4.2 and 5.2.
"""

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

from realtime.arrays import is_single
from realtime.body_tiles import PlaneLists, ball_range, plane_lists
from realtime.clipping import Seen, inverse_crossings, near_line, passage, seen_from, share_inside
from realtime.errors import InputError
from realtime.exponential import exp_bounded
from realtime.geometry import RayGeometry, clip_to_cone, distance_to_light, falloff
from realtime.lights import Light
from realtime.medium import Body, Medium
from realtime.phase import evaluate

FORMS = ("exact", "paper")
_NODES, _NODES_DOUBLE, _NODES_PAPER = 10, 24, 6
_FEW_PLANES = 12  # which are read as fast as listed
_RANGES = 5  # of a chord, in which a tile's list of planes for the legs from a light is made
_OPTICAL_REACH = 18.0  # e^-18 = 1.5e-8 of the light is left


@dataclass(frozen=True)
class Piece:
    """A part of every ray that lies in one medium."""

    medium: Medium
    number: int | None  #: of the body; None between bodies
    begin: Any  #: distances from the camera [m], equal or infinite where the ray misses it
    end: Any
    before: tuple[Any, ...]  #: optical depth from the camera to `begin`, by channel


@dataclass(frozen=True)
class MediaRay:
    """Camera rays in bounded media, and one light."""

    medium: Medium
    light: Light
    geometry: RayGeometry
    start: Any  #: from the light to the camera [m]
    direction: Any
    pieces: tuple[Piece, ...]
    seen: tuple[Seen, ...]  #: the bodies as the light sees them
    lists: tuple[PlaneLists | None, ...]  #: by body, the planes where legs to points within it enter


def camera_pieces(medium: Medium, origin, direction, *, corners=None) -> tuple[Piece, ...]:
    """Return the pieces of the camera rays in which something scatters.

    Parameters
    ----------
    medium
        The medium with its bodies.
    origin, direction
        The camera, one for all lanes [m], and unit directions.
    corners
        Directions at the corners of the tiles (`realtime.body_tiles`), if the rays come in tiles.
    """
    import drjit as dr

    Float = type(direction.x)
    passages = [_passage(seen_from(body, origin), direction, corners) for body in medium.bodies]

    def piece(own: Medium, number, begin, end):
        before = []
        for channel, around in enumerate(medium.sigma_t):
            depth = Float(0) if medium.clear else around * begin
            for body, (enter, leave) in zip(medium.bodies, passages):
                excess = body.medium.sigma_t[channel] - around
                depth += dr.select(leave <= begin, excess * (leave - enter), 0)
            before.append(depth)
        return Piece(own, number, begin, end, tuple(before))

    pieces = [
        piece(body.medium, number, *ends)
        for number, (body, ends) in enumerate(zip(medium.bodies, passages, strict=True))
    ]
    if not medium.clear:
        starts = [dr.zeros(Float, dr.width(direction)), *(leave for _, leave in passages)]
        for begin in starts:
            end = Float(dr.inf)
            for enter, _ in passages:
                end = dr.minimum(end, dr.select(enter >= begin, enter, dr.inf))
            # A camera within a body has no gap before it.
            inside = [(enter <= begin) & (begin < leave) for enter, leave in passages]
            pieces.append(piece(medium, None, begin, dr.select(_any(inside), begin, end)))
    return tuple(pieces)


def media_ray(
    medium: Medium, light: Light, geometry: RayGeometry, *, origin, direction, pieces, corners=None
) -> MediaRay:
    """Return what the integrals of one light need; `pieces` is from `camera_pieces`."""
    seen = tuple(seen_from(body, light.position) for body in medium.bodies)
    start = origin - light.position
    lists = tuple(_leg_lists(one, origin, start, corners) for one in seen)
    return MediaRay(medium, light, geometry, start, direction, pieces, seen, lists)


def _worth_lists(body: Body, corners) -> bool:
    return corners is not None and body.count > _FEW_PLANES


def _passage(seen: Seen, direction, corners):
    """Return the passage of camera rays through a body, by lists of planes where there are many."""
    lists = None
    if _worth_lists(seen.body, corners):
        _, _, near = ball_range(seen, corners)
        lists = plane_lists(seen, [corners], near)
    return passage(seen, direction, lists=lists)


def _leg_lists(seen: Seen, origin, start, corners) -> PlaneLists | None:
    """Return the planes at which legs from the light enter the body to reach the parts of the rays in it."""
    if not _worth_lists(seen.body, corners):
        return None
    # The ball as the camera sees it.
    low, high, near = ball_range(replace(seen, toward=seen.body.centre - origin), corners)
    distances = [low + (high * (1 + 1e-4) - low) * (k / _RANGES) for k in range(_RANGES + 1)]
    slices = [[start + corner * x for corner in corners] for x in distances]
    return plane_lists(seen, slices, near, leaves=False)


def bounded_airlight(ray: MediaRay, x0, x1, *, form: str = "exact"):
    """Return sum_j albedo_j sigma_j J_j over the lit segment [x0, x1], RGB [1/m^2].

    Parameters
    ----------
    ray
        The rays.
    x0, x1
        The segment [m]; `x1` may be infinite.
    form
        'exact', or 'paper' for the constant R.

    Notes
    -----
    Valid for any segment. Times intensity / (4 pi) it is the radiance.
    """
    import drjit as dr

    if ray.light.kind == "spot":
        x0, x1 = clip_to_cone(ray.geometry, ray.light.cos_cutoff, x0, x1)
    panels = [(x0, x1)]
    if ray.light.soft:
        inner0, inner1 = clip_to_cone(ray.geometry, ray.light.cos_beam, x0, x1)
        panels = [(x0, inner0), (inner0, inner1), (inner1, x1)]
    Float, Color = type(ray.geometry.height), type(ray.medium.albedo)
    zero = dr.zeros(Color, dr.width(ray.geometry.height, x0, x1))
    total = zero
    for piece in ray.pieces:
        for low, high in panels:
            begin, end = dr.maximum(low, piece.begin), dr.minimum(high, piece.end)
            total += dr.if_stmt(
                args=(begin, end),
                cond=end > begin,
                true_fn=lambda begin, end, piece=piece: _integral(ray, piece, begin, end, form),
                false_fn=lambda begin, end: Color(Float(0)),
            )
    return total


def bounded_source(ray: MediaRay, x):
    """Return albedo sigma exp(-tau) p at the distance x of the rays, RGB [1/m], 0 where nothing scatters."""
    import drjit as dr

    Color = type(ray.medium.albedo)
    total = dr.zeros(Color, dr.width(x))
    r = distance_to_light(ray.geometry, x)
    for piece in ray.pieces:
        total += dr.if_stmt(
            args=(x, r),
            cond=(x >= piece.begin) & (x < piece.end),
            true_fn=lambda x, r, piece=piece: _scattered(ray, piece, _attenuation(ray, piece, [x], [r])[0], x, r),
            false_fn=lambda x, r: Color(0),
        )
    return total


def camera_depths(medium: Medium, origin, direction, distance, *, corners=None) -> tuple[Any, ...]:
    """Return the optical depth of camera rays up to a distance, by channel; arguments as in `camera_pieces`."""
    import drjit as dr

    depths = [type(distance)(0) if medium.clear else sigma * distance for sigma in medium.sigma_t]
    for body in medium.bodies:
        ends = _passage(seen_from(body, origin), direction, corners)
        enter, leave = (dr.minimum(end, distance) for end in ends)
        inside = dr.select(leave > enter, leave - enter, 0)
        excess = [own - sigma for own, sigma in zip(body.medium.sigma_t, medium.sigma_t)]
        depths = [dr.fma(more, inside, depth) for more, depth in zip(excess, depths)]
    return tuple(depths)


def path_transmittance(medium: Medium, light: Light, *, depths, point, active):
    """Return the transmittance from the light to points and on to the camera, a colour [1].

    Parameters
    ----------
    medium, light
        What the light crosses and where it comes from.
    depths
        From `camera_depths`.
    point
        The points.
    active
        Lanes to compute.
    """
    import drjit as dr

    vector = point - light.position
    length = dr.norm(vector)
    depths = [dr.fma(sigma, length, depth) for depth, sigma in zip(depths, medium.sigma_t)]
    for body in medium.bodies:
        seen = seen_from(body, light.position)
        near = active & near_line(seen, vector / length, length)
        (enter,), (leave,) = inverse_crossings(seen, vector, dr.zeros(type(vector)), [type(length)(0)], near)
        inside = dr.select(near, share_inside(enter, leave) * length, 0)
        excess = [own - sigma for own, sigma in zip(body.medium.sigma_t, medium.sigma_t)]
        depths = [dr.fma(more, inside, depth) for more, depth in zip(excess, depths)]
    channels = [dr.exp(-depth) for depth in depths]
    return type(medium.albedo)(*(channels * 3)[:3])


def ambient_radiance(ray_pieces: tuple[Piece, ...], distance, ambient: float):
    """Return the light of a constant field in the media, albedo ambient (1 - exp(-tau)) a piece, before `distance`."""
    import drjit as dr

    total = type(ray_pieces[0].medium.albedo)(0)
    for piece in ray_pieces:
        length = dr.maximum(dr.minimum(dr.minimum(piece.end, distance), 1e30) - piece.begin, 0)
        kept = [dr.exp(-tau) - dr.exp(-dr.fma(s, length, tau)) for s, tau in zip(piece.medium.sigma_t, piece.before)]
        channels = [dr.select(length > 0, value, 0) for value in kept]
        total += piece.medium.albedo * (ambient * type(total)(*(channels * 3)[:3]))
    return total


def check_form(medium: Medium, form: str) -> None:
    """Refuse a form that is unknown or does not fit the media."""
    if form not in FORMS:
        raise InputError(f"media: got {form!r}, wanted one of {', '.join(FORMS)}")
    if form == "paper" and medium.bodies and not medium.clear:
        raise InputError("media=paper: wanted clear air around the bounded media; use media=exact")


def _integral(ray: MediaRay, piece: Piece, x0, x1, form: str):
    """Integrate one segment in one piece."""
    import drjit as dr

    Float = type(ray.geometry.height)
    least = _least(piece.medium)
    x1 = dr.minimum(x1, x0 + _OPTICAL_REACH / least)
    # A ray through the light itself: its integral is infinite, and so nearly is this.
    h = dr.maximum(ray.geometry.height, 1e-15)
    s0, s1 = x0 - ray.geometry.foot, x1 - ray.geometry.foot
    width = dr.select(dr.isfinite(x1), dr.atan2(h * (s1 - s0), dr.fma(h, h, s0 * s1)), dr.atan2(h, s0))
    exact = _NODES if is_single(Float) else _NODES_DOUBLE
    nodes = _nodes(_NODES_PAPER if form == "paper" else exact)
    xs, rs = [], []
    for fraction, _ in nodes:
        sine, cosine = dr.sincos(width * fraction)
        s = h * dr.fma(s0, cosine, h * sine) / dr.fma(h, cosine, -s0 * sine)
        xs.append(ray.geometry.foot + s)
        rs.append(dr.sqrt(dr.fma(s, s, h * h)))
    kept = _attenuation(ray, piece, xs, rs) if form == "exact" else _paper_attenuation(ray, piece, xs)
    total = sum(
        weight * _scattered(ray, piece, value, x, r)
        for (_, weight), value, x, r in zip(nodes, kept, xs, rs, strict=True)
    )
    return total * (width / h)


def _scattered(ray: MediaRay, piece: Piece, transmittance: list[Any], x, r):
    """Return albedo sigma p and the spot's profile times a transmittance, as a colour."""
    Color = type(ray.medium.albedo)
    weight = evaluate(piece.medium.phase, (ray.geometry.foot - x) / r)
    if ray.light.soft:
        weight = weight * falloff(ray.geometry, ray.light, x)
    channels = [sigma * weight * value for sigma, value in zip(piece.medium.sigma_t, transmittance)]
    return piece.medium.albedo * Color(*(channels * 3)[:3])


def _attenuation(ray: MediaRay, piece: Piece, xs, rs) -> list[list[Any]]:
    """Return exp(-tau) of both legs, by node and channel."""
    insides = _light_leg(ray, piece, xs, rs)
    result = []
    for node, (x, r) in enumerate(zip(xs, rs)):
        channels = []
        for channel, around in enumerate(ray.medium.sigma_t):
            depth = piece.before[channel] + piece.medium.sigma_t[channel] * (x - piece.begin)
            if not ray.medium.clear:
                depth += around * r
            for body, inside in zip(ray.medium.bodies, insides):
                depth += (body.medium.sigma_t[channel] - around) * inside[node]
            channels.append(exp_bounded(-depth))
        result.append(channels)
    return result


def _light_leg(ray: MediaRay, piece: Piece, xs, rs) -> list[list[Any]]:
    """Return by body and node what of the leg from the light lies in it [m]."""
    import drjit as dr

    insides = []
    for number, seen in enumerate(ray.seen):
        own = number == piece.number
        near = dr.full(dr.mask_t(xs[0]), True, dr.width(xs[0])) if own else _near_legs(ray, seen, xs, rs)
        lists = ray.lists[number] if own else None
        enter, leave = inverse_crossings(seen, ray.start, ray.direction, xs, near, leaves=not own, lists=lists)
        ends = [None] * len(xs) if own else leave
        shares = [share_inside(one, other) for one, other in zip(enter, ends)]
        insides.append([dr.select(near, share * r, 0) for share, r in zip(shares, rs)])
    return insides


def _near_legs(ray: MediaRay, seen: Seen, xs, rs):
    """Return whether legs from the light to points of a segment may come near a body.

    In the plane of ray and light, with u along the ray and v to it, the legs fill a triangle with the corner at the
    light and the others at (s_0, h) and (s_1, h); q is the distance of the body's centre from the plane. First and last
    node stand for the ends.
    """
    import drjit as dr

    geometry, radius = ray.geometry, seen.body.radius * 1.001
    foot = dr.fma(ray.direction, geometry.foot, ray.start)
    size = dr.norm(foot)
    # A ray through the light has no such plane: all legs lie in the ray.
    away = dr.select(size > 0, foot / size, 0)
    u, v = dr.dot(seen.toward, ray.direction), dr.dot(seen.toward, away)
    beside = dr.squared_norm(seen.toward - ray.direction * u - away * v) > dr.square(radius)
    h, s0, s1 = geometry.height, xs[0] - geometry.foot, xs[-1] - geometry.foot
    before = s0 * v - h * u > radius * rs[0]
    behind = h * u - s1 * v > radius * rs[-1]
    return ~(beside | before | behind | (v > h + radius))


def _paper_attenuation(ray: MediaRay, piece: Piece, xs) -> list[list[Any]]:
    """Return exp(-tau) with the constant R for the light's leg, by node and channel."""
    assert piece.number is not None
    distance = ray.medium.bodies[piece.number].mean_distance
    constants = [before + s * (distance - piece.begin) for before, s in zip(piece.before, piece.medium.sigma_t)]
    return [[exp_bounded(-(constant + s * x)) for constant, s in zip(constants, piece.medium.sigma_t)] for x in xs]


def _least(medium: Medium):
    import drjit as dr

    least = medium.sigma_t[0]
    for sigma in medium.sigma_t[1:]:
        least = dr.minimum(least, sigma)
    return least


def _any(conditions: list[Any]):
    result: Any = False
    for condition in conditions:
        result = condition | result
    return result


@lru_cache
def _nodes(count: int) -> tuple[tuple[float, float], ...]:
    """Return the Gauss-Legendre nodes and weights of [0, 1]."""
    import numpy as np

    xi, weight = np.polynomial.legendre.leggauss(count)
    return tuple((float(0.5 + 0.5 * x), float(0.5 * w)) for x, w in zip(xi, weight))
