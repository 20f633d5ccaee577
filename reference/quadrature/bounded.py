# SPDX-License-Identifier: BSD-3-Clause
r"""The airlight of lit stretches in scenes with bounded media, added up for every ray, with an error bound.

The single scattering of a piece of a ray inside one medium m is, for a light at a place (w = 1) or in a direction
(w = 0, `reference.visibility.planes`),

    L = albedo_m sigma_m I / (4 pi)  int exp(-tau_camera - tau_shadow) p_m(cos) dx / (r^2 or 1),
    tau_camera = tau_0 + sigma_m (x - x_0),
    tau_shadow = sigma_0 s r + sum_j (sigma_j - sigma_0) |[enter_j, leave_j] and [0, s r]|,

I its intensity or irradiance, r the distance to it, enter_j and leave_j the distances from the point x at which the
shadow segment enters and leaves body j; s is `shadow_scale`. Under a directional light sigma_0 = 0 and r is endless.
Near a place the integral is taken in v = asinh((x - foot)/height), dx/r^2 = dv/(height cosh v), where it is as smooth
beside the light as far from it; else in x.

Lit stretches are cut at the bounds of the media, where a shadow segment passes a corner of a body or touches it
(`reference.quadrature.segments`), and at the kinks of tabulated phase functions. On such a piece the segment enters and
leaves a polyhedron through the same two facets n . p = d, at the distance

    r (d - n . x) / (n . P - w n . x),      P the light, x the point, r = |P - w x|.

These are looked up once between two kinks of the segment, so that a node costs as much as its bodies, not their facets.
The pieces are integrated by Gauss and Kronrod's pairs on panels that are halved until a ray meets the tolerance (see
`analytic.panels`), once for channels whose extinction is the same in all media.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from analytic.kronrod import Pair
from analytic.panels import blocks_by_rule
from reference.quadrature.adaptive_panels import RTOL, Panels, first_panels, sum_panels
from reference.quadrature.pieces import Kinks, Pieces, by_medium, cut_pieces, medium_of
from reference.quadrature.segments import Segments, shadow_kinks
from reference.quadrature.unbounded import Profile, Stretches, sums_of
from reference.scene.convex_bounds import Bounds, Sphere
from reference.scene.read import TruthScene
from reference.visibility.line_crossings import crossed_facets, sphere_crossings
from reference.visibility.planes import Rays

Array = NDArray[np.float64]
Index = NDArray[np.int64]

_PANEL = 2.4  # width in v of the first panels, as in `analytic.panels`
_THICK = 0.2  # optical depth over which a panel in x is as wide as one of this width in v times ten
_AT_LIGHT = 1e-290  # height [m] below which a ray meets the light
_NEAR_ZERO = 1e-15  # height over distance below which a light beside a piece may as well be at this height
_RAYS = 4096  # rays at once
_PANELS = 8192  # panels at once
_EPS = float(np.finfo(float).eps)


def sum_media(
    truth: TruthScene,
    rays: Rays,
    stretches: Stretches,
    segments: Segments,
    *,
    profile: Profile | None = None,
    shadow_scale: float = 1.0,
    edge: float | Array = 0.0,
    rounding: Array | None = None,
    rtol: float = RTOL,
) -> tuple[Array, Array]:
    """Integrate lit stretches through the media that they pass and add up those of each ray, for a light of strength 1.

    Parameters
    ----------
    truth, rays, stretches
        The scene, the rays in their planes with lights, and lit stretches of them.
    segments
        From `reference.quadrature.segments.camera_segments`.
    profile
        Of the lights; None: they are isotropic.
    shadow_scale
        Share of the shadow segment that is attenuated over, from the scattering point on.
    edge
        Uncertainty of the ends of stretches: relative to their distance from the light, or a length by ray [m].
    rounding
        Of the places of kinks, by ray [m]; it matters where a facet lies along a directional light.
    rtol
        Relative tolerance of the sum of each ray [1].

    Returns
    -------
    airlight, bound
        And a bound of its error, (rays, 3) each; infinite where a ray meets the light inside a medium that scatters.
    """
    count = len(rays.foot)
    total, bound = np.zeros((count, 3)), np.zeros((count, 3))
    ray, x0, x1 = stretches
    edge = np.broadcast_to(edge, count)
    rounding = np.zeros(count) if rounding is None else rounding
    for first in range(0, count, _RAYS):
        chosen = (ray >= first) & (ray < first + _RAYS) & (x1 > x0)
        pieces, kinks = smooth_pieces(truth, rays, segments, (ray[chosen], x0[chosen], x1[chosen]))
        if len(pieces.ray):
            block = slice(first, first + _RAYS)
            part = _Sum(truth, rays, pieces, kinks, profile, shadow_scale, first, len(rays.foot[block]))
            total[block], bound[block] = part.adapt(rtol, edge, rounding)
    return total / (4 * np.pi), bound / (4 * np.pi)


def smooth_pieces(
    truth: TruthScene, rays: Rays, segments: Segments, stretches: Stretches
) -> tuple[Pieces, list[Kinks]]:
    """Cut lit stretches at the bounds of media and at the kinks of shadow segments and of phase functions.

    Returns
    -------
    pieces, kinks
        And the rays and distances of the kinks of the shadow segments through each of the bounded media.
    """
    used = np.unique(stretches[0])
    found = []
    for medium in truth.media:
        row, x = shadow_kinks(medium.bounds, rays[used])
        found.append((used[row], x))
    phases = _kinks_of_phases(truth, rays, used) if rays.w else []
    ray, x = (np.concatenate(column) for column in zip(*found, *phases, strict=True))
    return cut_pieces(truth, rays, segments, stretches, (ray, x)), found


def _kinks_of_phases(truth: TruthScene, rays: Rays, used: Index) -> list[Kinks]:
    """Return rays, among those used, and distances of the kinks of phase functions."""
    every = []
    for phase in {id(medium.phase): medium.phase for medium in (truth.medium, *truth.media)}.values():
        offset = np.outer(rays.height[used], -phase.kinks / np.sqrt(1 - phase.kinks**2))
        every.append((np.repeat(used, len(phase.kinks)), (rays.foot[used, None] + offset).ravel()))
    return every


@dataclass
class _Sum:
    """The sums of one block of rays."""

    truth: TruthScene
    rays: Rays
    pieces: Pieces
    kinks: list[Kinks]  # of each bounded medium, see `smooth_pieces`
    profile: Profile | None
    scale: float
    first: int  # number of the first ray
    count: int
    own: Rays = field(init=False)  # the ray of each piece
    height: Array = field(init=False)
    start: Array = field(init=False)  # where each piece begins, in v or x
    width: Array = field(init=False)
    factor: Array = field(init=False)  # albedo sigma_t of the medium of each piece
    different: Index = field(init=False)  # a channel of each set of extinctions, (sets,)
    same: Index = field(init=False)  # number of the set of each channel, (3,)
    sigma_t: Array = field(init=False)  # of these sets, (pieces, sets)
    bodies: list["_Body"] = field(init=False)

    def __post_init__(self):
        truth, pieces = self.truth, self.pieces
        self.own = self.rays[pieces.ray]
        if self.rays.w:
            s0, s1 = pieces.x0 - self.own.foot, pieces.x1 - self.own.foot
            beside = np.where(s0 > 0, s0, np.where(s1 < 0, -s1, 0.0))
            self.height = np.maximum(self.own.height, np.maximum(_NEAR_ZERO * beside, _AT_LIGHT))
            self.start = np.arcsinh(s0 / self.height)
            self.width = np.arcsinh(s1 / self.height) - self.start
        else:
            self.height, self.start, self.width = self.own.height, pieces.x0, pieces.x1 - pieces.x0
        sigma_t = by_medium(truth, "sigma_t", pieces.medium)
        self.factor = sigma_t * by_medium(truth, "albedo", pieces.medium)
        every = np.stack([medium.sigma_t for medium in (truth.medium, *truth.media)])
        _, self.different, self.same = np.unique(every, axis=1, return_index=True, return_inverse=True)
        self.sigma_t = sigma_t[:, self.different]
        self.bodies = [
            _Body.of(self.own, pieces, medium.bounds, kinks)
            for medium, kinks in zip(truth.media, self.kinks, strict=True)
        ]

    def adapt(self, rtol: float, edge: Array, rounding: Array) -> tuple[Array, Array]:
        """Halve panels until all rays meet the tolerance, or only rounding is left."""
        owner = self.pieces.ray - self.first
        widest = _PANEL if self.rays.w else np.inf
        value, error = sum_panels(first_panels(self.start, self.width, widest), self.evaluate, owner, self.count, rtol)
        error = error + sums_of(owner, self.edge_error(edge, rounding), self.count)
        meets = sums_of(owner, self.meets_light()[:, None] * self.factor, self.count) > 0
        return np.where(meets, np.inf, value), np.where(meets, np.inf, error)

    def meets_light(self) -> NDArray[np.bool_]:
        near = (self.own.height < _AT_LIGHT) & bool(self.rays.w)
        return near & (self.pieces.x0 <= self.own.foot) & (self.own.foot <= self.pieces.x1)

    def evaluate(self, piece: Index, start: Array, width: Array) -> Panels:
        """Integrate panels by both rules, a block at a time so that the arrays stay in the cache."""
        both, noise = np.empty((2, len(piece), 3)), np.empty((len(piece), 3))
        size = width if self.rays.w else width * self.sigma_t[piece].max(axis=1) / (10 * _THICK)
        for pair, block in blocks_by_rule(size, _PANELS):
            both[:, block], noise[block] = self.evaluate_block(pair, piece[block], start[block], width[block])
        return Panels(piece, start, width, both[0], np.abs(both[0] - both[1]), noise)

    def evaluate_block(self, pair: Pair, rows: Index, start: Array, width: Array) -> tuple[Array, Array]:
        """Return the integrals of panels by both rules, (2, m, 3), and the rounding errors of the first, (m, 3)."""
        half = 0.5 * width
        f, depth = self.integrand(rows, start[:, None] + half[:, None] * (1 + pair.nodes))
        scale = half[:, None] * self.factor[rows]
        both = np.einsum("mnc,nk->kmc", f, pair.weights)[..., self.same] * scale
        return both, _EPS * (16 + depth[:, len(pair.nodes) // 2, self.same]) * np.abs(both[0])

    def integrand(self, rows: Index, v: Array) -> tuple[Array, Array]:
        """Return exp(-tau) p dx/r^2 or dx, by dv, times the profile, and tau, at v, (m, nodes): (m, nodes, sets)."""
        truth, own = self.truth, self.own
        begin = self.pieces.x0[rows, None]
        if self.rays.w:
            height, foot = self.height[rows, None], own.foot[rows, None]
            cosine = 1 / np.cosh(v)
            s, r, scatter, rate = height * np.sinh(v), height / cosine, -np.tanh(v), cosine / height
            x, inside = foot + s, np.maximum(s + (foot - begin), 0.0)
        else:
            x, inside, r = v, v - begin, np.full_like(v, np.inf)
            scatter, rate = np.broadcast_to(np.clip(own.foot[rows, None], -1, 1), v.shape), np.ones_like(v)
        depth = self.pieces.depth[rows][:, None, self.different] + inside[:, :, None] * self.sigma_t[rows, None]
        around = truth.medium.sigma_t[self.different]
        limit = self.scale * r if self.rays.w else r
        if np.any(around > 0):
            depth += limit[:, :, None] * around
        for medium, body in zip(truth.media, self.bodies, strict=True):
            depth += body.length(rows, x, r, limit)[:, :, None] * (medium.sigma_t[self.different] - around)
        f = np.exp(-depth) * (rate * self.directional(rows, x, scatter))[:, :, None]
        return f, depth

    def directional(self, rows: Index, x: Array, scatter: Array) -> Array:
        """Return the phase function of each piece's medium times the profile of the light."""
        result = np.ones(x.shape)
        numbers = self.pieces.medium[rows]
        for number in np.unique(numbers):
            phase = medium_of(self.truth, int(number)).phase
            if not phase.is_constant:
                chosen = numbers == number
                result[chosen] = phase(scatter[chosen])
        return result if self.profile is None else result * self.profile(x, self.pieces.ray[rows])

    def edge_error(self, edge: Array, rounding: Array) -> Array:
        """Return what the uncertain places of edges of shadows and of kinks are worth: integrand times uncertainty."""
        pieces, every = self.pieces, np.arange(len(self.width))
        ends = np.stack([self.start, self.start + self.width], axis=1)
        f = self.integrand(every, ends)[0][..., self.same] * self.factor[:, None]
        total = np.zeros((len(every), 3))
        for end, chosen in enumerate((pieces.first, pieces.last)):
            total += (chosen * edge[pieces.ray])[:, None] * f[:, end]
        same = (pieces.ray[1:] == pieces.ray[:-1]) & (pieces.x0[1:] == pieces.x1[:-1])
        same &= pieces.medium[1:] == pieces.medium[:-1]
        total[1:] += (16 * same * rounding[pieces.ray[1:]])[:, None] * np.abs(f[1:, 0] - f[:-1, 1])
        return total


@dataclass(frozen=True)
class _Body:
    """How much of shadow segments lies in a body, of the points of pieces."""

    own: Rays  # the ray of each piece
    bounds: Bounds
    run: Index  # of a polyhedron: the number of the run of each piece
    #: of each run and both facets, d - n . o, n . d and n . (P - w o): given numbers where the segment meets none
    facets: tuple[tuple[Array, Array, Array], ...]

    @staticmethod
    def of(own: Rays, pieces: Pieces, bounds: Bounds, kinks: Kinks) -> "_Body":
        if isinstance(bounds, Sphere):
            return _Body(own, bounds, np.empty(0, np.int64), ())
        run, first, last = _runs(pieces, kinks)
        lines = own[first]
        middle = 0.5 * (pieces.x0[first] + pieces.x1[last])
        point = own.origin + middle[:, None] * lines.direction
        towards = lines.position - own.w * point
        r = np.linalg.norm(towards, axis=1)
        towards /= r[:, None]
        enter, leave, low, high = crossed_facets(bounds, point, towards)
        # No corner between ray and light is on the run, so what the middle says of these cases holds for all of it. The
        # planes of facets behind the ray or beyond the light would not: corners there were not looked for.
        r = r if own.w else np.full(len(r), np.inf)
        missed = (low >= high) | (low >= r) | (high <= 0)
        facets = []
        for facet, at_zero, endless in ((enter, missed | (low <= 0), False), (leave, missed, high >= r)):
            given = at_zero | endless
            room = bounds.offset[facet] - bounds.normal[facet] @ own.origin
            slope = np.sum(bounds.normal[facet] * lines.direction, axis=1)
            rise = np.sum(bounds.normal[facet] * (lines.position - own.w * own.origin), axis=1)
            facets.append(
                (
                    np.where(at_zero, 0.0, np.where(endless, np.inf, room)),
                    np.where(given, 0.0, slope),
                    np.where(given, 1.0, rise),
                )
            )
        return _Body(own, bounds, run, tuple(facets))

    def length(self, rows: Index, x: Array, r: Array, limit: Array) -> Array:
        """Return the length inside of [0, limit] of segments from points x of pieces to the light, at r, (m, nodes)."""
        if isinstance(self.bounds, Sphere):
            enter, leave = self._sphere(rows, x, r)
        else:
            run, w = self.run[rows], self.own.w
            way = r if w else 1.0
            with np.errstate(divide="ignore", invalid="ignore"):
                enter, leave = (
                    way * (room[run, None] - x * slope[run, None]) / (rise[run, None] - w * x * slope[run, None])
                    for room, slope, rise in self.facets
                )
        return np.maximum(np.minimum(leave, limit) - np.maximum(enter, 0.0), 0.0)

    def _sphere(self, rows: Index, x: Array, r: Array) -> tuple[Array, Array]:
        assert isinstance(self.bounds, Sphere)
        own, centre = self.own, self.bounds.centre - self.own.origin
        along = np.sum(own.direction * centre, axis=1)[rows, None]
        towards = np.sum((own.position - own.w * own.origin) * centre, axis=1)[rows, None]
        # (C - x) . (P - w x), by components: C . P - x d . P - w x d . C + w x^2, all from the camera.
        place = np.sum((own.position - own.w * own.origin) * own.direction, axis=1)[rows, None]
        product = towards - x * place - own.w * x * (along - x)
        power = (x - along) ** 2 + (centre @ centre - self.bounds.radius**2 - along**2)
        return sphere_crossings(product / (np.maximum(r, _AT_LIGHT) if own.w else 1.0), power)


def _runs(pieces: Pieces, kinks: Kinks) -> tuple[Index, Index, Index]:
    """Return the number of the run of each piece, and the first and the last piece of each run.

    A run is what lies of a part of a lit stretch between two kinks of a shadow segment.
    """
    # Kinks come before the pieces that begin at them.
    ray, x = np.concatenate([kinks[0], pieces.ray]), np.concatenate([kinks[1], pieces.x0])
    everything = np.lexsort((np.arange(len(ray)), x, ray))
    is_piece = everything >= len(kinks[0])
    kinks_before = np.empty(len(pieces.ray), np.int64)
    kinks_before[everything[is_piece] - len(kinks[0])] = np.cumsum(~is_piece)[is_piece]
    begins = np.ones(len(pieces.ray), bool)
    begins[1:] = (pieces.part[1:] != pieces.part[:-1]) | (kinks_before[1:] != kinks_before[:-1])
    first = np.flatnonzero(begins)
    return np.cumsum(begins) - 1, first, np.append(first[1:], len(begins)) - 1
