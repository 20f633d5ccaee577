# SPDX-License-Identifier: BSD-3-Clause
"""The airlight of lit intervals in scenes with bounded media, added up for every ray, with an error bound.

In w = asinh((x - foot)/height) the single scattering of a piece of a ray inside one medium m is

    L = albedo_m sigma_m I / (4 pi height) int exp(-tau_camera - tau_leg) p_m(-tanh w) / cosh w dw,
    tau_camera = tau_0 + sigma_m (x - x_0),
    tau_leg = s sigma_0 r + sum_j (sigma_j - sigma_0) |[enter_j, leave_j] and [(1 - s) r, r]|,      r = height cosh w,

enter_j and leave_j the distances from the light at which the leg enters and leaves body j (s is `shadow_scale`). Lit
intervals are cut at the bounds of the media and at every kink of tau_leg (`reference.quadrature.segments`). On such a
piece the leg enters and leaves a polyhedron through the same two facets n . p = d, at d/(n . u(w)), u the direction of
the leg; so these are looked up once a piece, and a node costs as much as its bodies, not their facets. The pieces are
integrated by Gauss and Kronrod's pair on panels that are halved until a ray meets the tolerance (see
`analytic.panels`).
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from analytic.kronrod import KRONROD_AND_GAUSS, NODES
from reference.quadrature.adaptive_panels import Panels, first_panels, sum_panels
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

_PANEL = 2.4  # width in w of the first panels, as in `analytic.panels`
_AT_LIGHT = 1e-290  # height [m] below which a ray meets the light
_NEAR_ZERO = 1e-15  # height over distance below which a light beside a piece may as well be at this height
_RAYS = 4096  # rays at once
_PANELS = 8192  # panels at once


def sum_media(
    truth: TruthScene, light: TruthLight, rays: Rays, lit: LitIntervals, segments: Segments, *, shadow_scale: float
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
        pieces = cut_pieces(setup, stretches, kinks(setup, np.unique(ray[chosen])), rays.foot)
        if len(pieces.ray):
            block = slice(first, first + _RAYS)
            value, error = _Sum(setup, pieces, first, len(rays.foot[block])).adapt()
            total[block], bound[block] = value, error
    return total * light.intensity / (4 * np.pi), bound * light.intensity / (4 * np.pi)


def kinks(setup: Setup, used: Index) -> tuple[Index, Array]:
    """Return rays, among those used, and distances of the kinks of the leg from the light and of phase functions."""
    truth, rays = setup.truth, setup.rays
    axes, height = (rays.direction[used], rays.normal[used]), rays.height[used]
    owners, offsets = [], []
    for medium in truth.media:
        row, offset = leg_kinks(medium.bounds, setup.light.position, axes, height)
        owners.append(row)
        offsets.append(offset)
    for phase in (truth.medium.phase, *(medium.phase for medium in truth.media)):
        kinks = phase.kinks
        owners.append(np.repeat(np.arange(len(used)), len(kinks)))
        offsets.append(np.outer(height, -kinks / np.sqrt(1 - kinks**2)).ravel())
    ray = used[np.concatenate(owners)]
    return ray, rays.foot[ray] + np.concatenate(offsets)


@dataclass
class _Sum:
    """The sums of one block of rays."""

    setup: Setup
    pieces: Pieces
    first: int  # number of the first ray
    count: int
    foot: Array = field(init=False)
    height: Array = field(init=False)
    start: Array = field(init=False)  # w of the beginning of each piece
    width: Array = field(init=False)
    factor: Array = field(init=False)  # albedo sigma_t of the medium of each piece
    sigma_t: Array = field(init=False)
    chords: list[Chord] = field(init=False)

    def __post_init__(self):
        setup, pieces = self.setup, self.pieces
        self.foot = setup.rays.foot[pieces.ray]
        s0, s1 = pieces.x0 - self.foot, pieces.x1 - self.foot
        beside = np.where(s0 > 0, s0, np.where(s1 < 0, -s1, 0.0))
        self.height = np.maximum(setup.rays.height[pieces.ray], np.maximum(_NEAR_ZERO * beside, _AT_LIGHT))
        self.start = np.arcsinh(s0 / self.height)
        self.width = np.arcsinh(s1 / self.height) - self.start
        self.sigma_t = setup.by_medium("sigma_t", pieces.medium)
        self.factor = self.sigma_t * setup.by_medium("albedo", pieces.medium)
        self.chords = [_chord(self, medium) for medium in setup.truth.media]

    def axes(self, rows: Index) -> tuple[Array, Array]:
        ray = self.pieces.ray[rows]
        return self.setup.rays.direction[ray], self.setup.rays.normal[ray]

    def adapt(self) -> tuple[Array, Array]:
        """Halve panels until all rays meet the tolerance, or only rounding is left."""
        owner = self.pieces.ray - self.first
        value, error = sum_panels(first_panels(self.start, self.width, _PANEL), self.evaluate, owner, self.count)
        error = error + sums_of(owner, self.edge_error(), self.count)
        meets = sums_of(owner, self.meets_light()[:, None] * self.factor, self.count) > 0
        return np.where(meets, np.inf, value), np.where(meets, np.inf, error)

    def meets_light(self) -> NDArray[np.bool_]:
        near = self.setup.rays.height[self.pieces.ray] < _AT_LIGHT
        return near & (self.pieces.x0 <= self.foot) & (self.foot <= self.pieces.x1)

    def evaluate(self, piece: Index, start: Array, width: Array) -> Panels:
        """Integrate panels by both rules, a block at a time so that the arrays stay in the cache."""
        both, noise = np.empty((2, len(piece), 3)), np.empty((len(piece), 3))
        for first in range(0, len(piece), _PANELS):
            block = slice(first, first + _PANELS)
            rows, half = piece[block], 0.5 * width[block]
            f, depth = self.integrand(rows, start[block, None] + half[:, None] * (1 + NODES))
            scale = (half / self.height[rows])[:, None] * self.factor[rows]
            integral = np.einsum("mnc,nk->kmc", f, KRONROD_AND_GAUSS)
            both[:, block] = integral * scale
            noise[block] = np.finfo(float).eps * (16 + depth[:, 10]) * np.abs(both[0, block])
        return Panels(piece, start, width, both[0], np.abs(both[0] - both[1]), noise)

    def integrand(self, rows: Index, w: Array) -> tuple[Array, Array]:
        """Return exp(-tau) p / cosh w times the light's profile, and tau, at w of shape (m, nodes): (m, nodes, 3)."""
        truth, scale = self.setup.truth, self.setup.shadow_scale
        height, foot = self.height[rows, None], self.foot[rows, None]
        sine, cosine = np.tanh(w), 1 / np.cosh(w)
        s, r = height * np.sinh(w), height / cosine
        inside = np.maximum(s + (foot - self.pieces.x0[rows, None]), 0.0)
        depth = self.pieces.depth[rows, None] + inside[:, :, None] * self.sigma_t[rows, None]
        depth += (scale * r)[:, :, None] * truth.medium.sigma_t
        for medium, chord in zip(truth.media, self.chords, strict=True):
            enter, leave = chord(rows, sine, cosine)
            length = np.maximum(np.minimum(leave, r) - np.maximum(enter, (1 - scale) * r), 0.0)
            depth += length[:, :, None] * (medium.sigma_t - truth.medium.sigma_t)
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
            total[rows] += self.setup.edge * f[:, 0] * self.factor[rows] / self.height[rows, None]
        return total


def _chord(block: _Sum, medium: BoundedMedium) -> Chord:
    """Return a function (pieces, sin, cos of the angle at the light) -> where the leg enters and leaves a medium."""
    bounds, light = medium.bounds, block.setup.light.position
    every = np.arange(len(block.width))
    along, away = block.axes(every)
    if isinstance(bounds, Sphere):
        centre = bounds.centre - light
        c1, c2, power = along @ centre, away @ centre, float(centre @ centre - bounds.radius**2)
        return lambda rows, sine, cosine: sphere_crossings(c1[rows, None] * sine + c2[rows, None] * cosine, power)
    middle = block.start + 0.5 * block.width
    leg = np.tanh(middle)[:, None] * along + (1 / np.cosh(middle))[:, None] * away
    r = block.height * np.cosh(middle)
    enter, leave, low, high = crossed_facets(bounds, light, leg)
    # No corner between light and ray is on the piece, so what the middle says of these cases holds for all of it. The
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
        with np.errstate(divide="ignore", invalid="ignore"):
            low, high = (d[rows, None] / (a[rows, None] * sine + b[rows, None] * cosine) for a, b, d in planes)
        return low, high

    return chord
