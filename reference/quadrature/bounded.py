# SPDX-License-Identifier: BSD-3-Clause
"""The airlight of lit intervals in scenes with bounded media, added up for every ray, with an error bound.

In w = asinh((x - foot)/height) the single scattering of a piece of a ray inside one medium m is

    L = albedo_m sigma_m I / (4 pi height) int exp(-tau_camera - tau_leg) p_m(-tanh w) / cosh w dw,
    tau_camera = tau_0 + sigma_m (x - x_0),
    tau_leg = s sigma_0 r + sum_j (sigma_j - sigma_0) |[enter_j, leave_j] and [(1 - s) r, r]|,      r = height cosh w,

enter_j and leave_j the distances from the light at which the leg enters and leaves body j (s is `shadow_scale`). Lit
intervals are cut at the bounds of the media and at every kink of tau_leg (`reference.quadrature.segments`). On such a
piece the leg enters and leaves a polyhedron through the same two facets n . p = d, at d/(n . u(w)), u the direction of
the leg. These are looked up once between two kinks of the leg, for all the pieces there that a tabulated phase function
is cut into, and a node costs as much as its bodies, not their facets. The pieces are integrated by Gauss and Kronrod's
pairs on panels that are halved until a ray meets the tolerance (see `analytic.panels`), once for channels whose
extinction is the same in all media.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from analytic.kronrod import Pair
from analytic.panels import blocks_by_rule
from reference.quadrature.adaptive_panels import RTOL, Panels, first_panels, sum_panels
from reference.quadrature.pieces import Pieces, Setup, cut_pieces
from reference.quadrature.segments import Segments, leg_kinks
from reference.quadrature.unbounded import Rays, lit_stretches, sums_of
from reference.scene.convex_bounds import Sphere
from reference.scene.read import BoundedMedium, TruthLight, TruthScene
from reference.visibility.intervals import LitIntervals
from reference.visibility.line_crossings import crossed_facets, sphere_crossings
from reference.visibility.spot_cone import falloff

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Chord = Callable[[Index, Array, Array], tuple[Array, Array]]
Kinks = tuple[Index, Array]  # rays, and distances along them [m]

_PANEL = 2.4  # width in w of the first panels, as in `analytic.panels`
_AT_LIGHT = 1e-290  # height [m] below which a ray meets the light
_NEAR_ZERO = 1e-15  # height over distance below which a light beside a piece may as well be at this height
_RAYS = 4096  # rays at once
_PANELS = 8192  # panels at once


def sum_media(
    truth: TruthScene,
    light: TruthLight,
    rays: Rays,
    lit: LitIntervals,
    segments: Segments,
    *,
    shadow_scale: float,
    rtol: float = RTOL,
) -> tuple[Array, Array]:
    """Integrate every lit interval through the media that it passes and add up the intervals of each ray.

    Parameters
    ----------
    truth, light, rays
        The scene, one of its lights, and the camera rays in the planes with that light.
    lit
        Lit intervals of the rays.
    segments
        From `reference.quadrature.segments.camera_segments`.
    shadow_scale
        Share of the leg from the light that is attenuated, measured from the scattering point.
    rtol
        Relative tolerance of the sum of each ray [1].

    Returns
    -------
    radiance, bound
        Airlight [W/(m^2 sr)] and a bound of its error, (rays, 3) each; infinite where a ray meets the light inside a
        medium that scatters.
    """
    setup = Setup(truth, rays.direction, segments, light, rays, shadow_scale, lit.edge)
    ray, x0, x1 = lit_stretches(light, rays, lit)
    total, bound = np.zeros((len(rays.foot), 3)), np.zeros((len(rays.foot), 3))
    for first in range(0, len(rays.foot), _RAYS):
        chosen = (ray >= first) & (ray < first + _RAYS) & (x1 > x0)
        stretches = ray[chosen], x0[chosen], x1[chosen]
        pieces, legs = smooth_pieces(setup, stretches)
        if len(pieces.ray):
            block = slice(first, first + _RAYS)
            value, error = _Sum(setup, pieces, legs, first, len(rays.foot[block])).adapt(rtol)
            total[block], bound[block] = value, error
    return total * light.intensity / (4 * np.pi), bound * light.intensity / (4 * np.pi)


def smooth_pieces(setup: Setup, stretches: tuple[Index, Array, Array]) -> tuple[Pieces, list[Kinks]]:
    """Cut lit stretches at the bounds of media and at the kinks of legs from the light and of phase functions.

    Parameters
    ----------
    setup
        The rays and the light.
    stretches
        Rays, (stretches,), and distances of both ends, (stretches,) each [m].

    Returns
    -------
    pieces, legs
        And the rays and distances of the kinks of the legs through each of the bounded media.
    """
    rays, used = setup.rays, np.unique(stretches[0])
    axes, height = (rays.direction[used], rays.normal[used]), rays.height[used]
    found = [leg_kinks(medium.bounds, setup.light.position, axes, height) for medium in setup.truth.media]
    legs = [(used[row], rays.foot[used[row]] + offset) for row, offset in found]
    return cut_pieces(setup, stretches, _joined([*legs, _kinks_of_phases(setup, used)]), rays.foot), legs


def _kinks_of_phases(setup: Setup, used: Index) -> Kinks:
    """Return rays, among those used, and distances of the kinks of phase functions."""
    rays, every = setup.rays, []
    for phase in {id(medium.phase): medium.phase for medium in (setup.truth.medium, *setup.truth.media)}.values():
        offset = np.outer(rays.height[used], -phase.kinks / np.sqrt(1 - phase.kinks**2))
        every.append((np.repeat(used, len(phase.kinks)), (rays.foot[used, None] + offset).ravel()))
    return _joined(every)


def _joined(kinks: list[Kinks]) -> Kinks:
    ray, x = (np.concatenate(column) for column in zip(*kinks, strict=True))
    return ray, x


@dataclass
class _Sum:
    """The sums of one block of rays."""

    setup: Setup
    pieces: Pieces
    legs: list[Kinks]  # of each bounded medium, see `smooth_pieces`
    first: int  # number of the first ray
    count: int
    foot: Array = field(init=False)
    height: Array = field(init=False)
    start: Array = field(init=False)  # w of the beginning of each piece
    width: Array = field(init=False)
    factor: Array = field(init=False)  # albedo sigma_t of the medium of each piece
    different: Index = field(init=False)  # a channel of each set of extinctions, (sets,)
    same: Index = field(init=False)  # number of the set of each channel, (3,)
    sigma_t: Array = field(init=False)  # of these sets, (pieces, sets)
    chords: list[Chord] = field(init=False)

    def __post_init__(self):
        setup, pieces = self.setup, self.pieces
        self.foot = setup.rays.foot[pieces.ray]
        s0, s1 = pieces.x0 - self.foot, pieces.x1 - self.foot
        beside = np.where(s0 > 0, s0, np.where(s1 < 0, -s1, 0.0))
        self.height = np.maximum(setup.rays.height[pieces.ray], np.maximum(_NEAR_ZERO * beside, _AT_LIGHT))
        self.start = np.arcsinh(s0 / self.height)
        self.width = np.arcsinh(s1 / self.height) - self.start
        sigma_t = setup.by_medium("sigma_t", pieces.medium)
        self.factor = sigma_t * setup.by_medium("albedo", pieces.medium)
        every = np.stack([medium.sigma_t for medium in (setup.truth.medium, *setup.truth.media)])
        _, self.different, self.same = np.unique(every, axis=1, return_index=True, return_inverse=True)
        self.sigma_t = sigma_t[:, self.different]
        self.chords = [_chord(self, medium, legs) for medium, legs in zip(setup.truth.media, self.legs, strict=True)]

    def axes(self, rows: Index) -> tuple[Array, Array]:
        ray = self.pieces.ray[rows]
        return self.setup.rays.direction[ray], self.setup.rays.normal[ray]

    def adapt(self, rtol: float) -> tuple[Array, Array]:
        """Halve panels until all rays meet the tolerance, or only rounding is left."""
        owner = self.pieces.ray - self.first
        value, error = sum_panels(first_panels(self.start, self.width, _PANEL), self.evaluate, owner, self.count, rtol)
        error = error + sums_of(owner, self.edge_error(), self.count)
        meets = sums_of(owner, self.meets_light()[:, None] * self.factor, self.count) > 0
        return np.where(meets, np.inf, value), np.where(meets, np.inf, error)

    def meets_light(self) -> NDArray[np.bool_]:
        near = self.setup.rays.height[self.pieces.ray] < _AT_LIGHT
        return near & (self.pieces.x0 <= self.foot) & (self.foot <= self.pieces.x1)

    def evaluate(self, piece: Index, start: Array, width: Array) -> Panels:
        """Integrate panels by both rules, a block at a time so that the arrays stay in the cache."""
        both, noise = np.empty((2, len(piece), 3)), np.empty((len(piece), 3))
        for pair, block in blocks_by_rule(width, _PANELS):
            both[:, block], noise[block] = self.evaluate_block(pair, piece[block], start[block], width[block])
        return Panels(piece, start, width, both[0], np.abs(both[0] - both[1]), noise)

    def evaluate_block(self, pair: Pair, rows: Index, start: Array, width: Array) -> tuple[Array, Array]:
        """Return the integrals of panels by both rules, (2, m, 3), and the rounding errors of the first, (m, 3)."""
        half = 0.5 * width
        f, depth = self.integrand(rows, start[:, None] + half[:, None] * (1 + pair.nodes))
        scale = (half / self.height[rows])[:, None] * self.factor[rows]
        both = np.einsum("mnc,nk->kmc", f, pair.weights)[..., self.same] * scale
        return both, np.finfo(float).eps * (16 + depth[:, len(pair.nodes) // 2, self.same]) * np.abs(both[0])

    def integrand(self, rows: Index, w: Array) -> tuple[Array, Array]:
        """Return exp(-tau) p / cosh w times the light's profile, and tau, at w, (m, nodes): (m, nodes, sets) each."""
        truth, scale = self.setup.truth, self.setup.shadow_scale
        height, foot = self.height[rows, None], self.foot[rows, None]
        sine, cosine = np.tanh(w), 1 / np.cosh(w)
        s, r = height * np.sinh(w), height / cosine
        inside = np.maximum(s + (foot - self.pieces.x0[rows, None]), 0.0)
        depth = self.pieces.depth[rows][:, None, self.different] + inside[:, :, None] * self.sigma_t[rows, None]
        depth += (scale * r)[:, :, None] * truth.medium.sigma_t[self.different]
        for medium, chord in zip(truth.media, self.chords, strict=True):
            enter, leave = chord(rows, sine, cosine)
            length = np.maximum(np.minimum(leave, r) - np.maximum(enter, (1 - scale) * r), 0.0)
            depth += length[:, :, None] * (medium.sigma_t - truth.medium.sigma_t)[self.different]
        f = np.exp(-depth) * (cosine * self.directional(rows, s, sine))[:, :, None]
        return f, depth

    def directional(self, rows: Index, s: Array, sine: Array) -> Array:
        """Return the phase function of each piece's medium times the profile of the light."""
        result = np.ones_like(sine)
        numbers = self.pieces.medium[rows]
        for number in np.unique(numbers):
            phase = self.setup.medium(int(number)).phase
            if not phase.is_constant:
                chosen = numbers == number
                result[chosen] = phase(-sine[chosen])
        light = self.setup.light
        if light.is_soft:
            result *= falloff(np.arctan2(s, self.height[rows, None]), *self.axes(rows), light)
        return result

    def edge_error(self) -> Array:
        """Return what the uncertain places of edges between light and shadow are worth: integrand times rounding."""
        total = np.zeros((len(self.width), 3))
        for chosen, w in ((self.pieces.first, self.start), (self.pieces.last, self.start + self.width)):
            rows = np.flatnonzero(chosen)
            f, _ = self.integrand(rows, w[rows, None])
            total[rows] += self.setup.edge * f[:, 0, self.same] * self.factor[rows] / self.height[rows, None]
        return total


def _chord(block: _Sum, medium: BoundedMedium, legs: Kinks) -> Chord:
    """Return a function (pieces, sin, cos of the angle at the light) -> where the leg enters and leaves a medium."""
    bounds, light = medium.bounds, block.setup.light.position
    if isinstance(bounds, Sphere):
        along, away = block.axes(np.arange(len(block.width)))
        centre = bounds.centre - light
        c1, c2, power = along @ centre, away @ centre, float(centre @ centre - bounds.radius**2)
        return lambda rows, sine, cosine: sphere_crossings(c1[rows, None] * sine + c2[rows, None] * cosine, power)
    run, first, last = _runs(block.pieces, legs)
    along, away = block.axes(first)
    height = block.height[first]
    middle = 0.5 * (block.start[first] + block.start[last] + block.width[last])
    leg = np.tanh(middle)[:, None] * along + (1 / np.cosh(middle))[:, None] * away
    r = height * np.cosh(middle)
    enter, leave, low, high = crossed_facets(bounds, light, leg)
    # No corner between light and ray is on the run, so what the middle says of these cases holds for all of it. The
    # planes of facets before the light or beyond the ray would not: corners there were not looked for.
    missed = (low >= high) | (low >= r) | (high <= 0)
    room = bounds.offset - bounds.normal @ light
    planes = []
    for facet, near, far in ((enter, missed | (low <= 0), False), (leave, missed, high >= r)):
        given = near | far
        rate1 = np.where(given, 0.0, np.sum(bounds.normal[facet] * along, axis=1))
        rate2 = np.where(given, 1.0, np.sum(bounds.normal[facet] * away, axis=1))
        planes.append((rate1, rate2, np.where(near, 0.0, np.where(far, np.inf, room[facet]))))

    def chord(rows: Index, sine: Array, cosine: Array) -> tuple[Array, Array]:
        runs = run[rows]
        with np.errstate(divide="ignore", invalid="ignore"):
            low, high = (d[runs, None] / (a[runs, None] * sine + b[runs, None] * cosine) for a, b, d in planes)
        return low, high

    return chord


def _runs(pieces: Pieces, kinks: Kinks) -> tuple[Index, Index, Index]:
    """Return the number of the run of each piece, and the first and the last piece of each run.

    A run is what lies of a part of a lit interval between two kinks of a leg.
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
