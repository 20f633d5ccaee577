# SPDX-License-Identifier: BSD-3-Clause
"""The airlight of a directional light in bounded media, added up for every ray, with an error bound.

With the names of `reference.visibility.parallel_rays` the single scattering of a piece [x0, x1] of a ray in a medium m
is

    L = albedo_m sigma_m E p_m(c) / (4 pi)  int exp(-tau_camera(x) - tau_leg(x)) dx,
    tau_camera = tau_0 + sigma_m (x - x0),      tau_leg = sum_j sigma_j l_j(x),

l_j the length of the leg (x + c l, s l), l >= 0, in body j, E the irradiance; nothing falls with a distance, and the
phase function does not change along the ray. Outside of the bodies nothing dims the light.

The leg enters and leaves a polyhedron at two planes n . p = d, at

    l = (d - n . o - x n . w) / (n . u),

linear in x, through the same two until it passes a corner of the polygon in the plane of ray and light, (z, y), on its
way from x = z - y c/s. Pieces are cut there, so tau is linear on each, and with its values at both ends

    int exp(-tau) dx = (x1 - x0) exp(-min tau) (1 - exp(-|tau_1 - tau_0|)) / |tau_1 - tau_0|

in closed form. A sphere, a disk of the centre (c_z, c_y) and the radius rho in that plane, holds
2 sqrt(rho^2 - (x s - q_c)^2) of the leg, q_c = c_z s - c_y c, or what is left of it behind the ray. That is smooth
between the x of both tangents, (q_c +- rho)/s; where a scene has spheres of media, panels are summed as for
other lights.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from analytic.kronrod import WIDE
from reference.quadrature.adaptive_panels import Panels, first_panels, sum_panels
from reference.quadrature.pieces import Crossed, Pieces, cut_pieces
from reference.quadrature.segments import Segments, polygon_corners
from reference.quadrature.unbounded import sums_of
from reference.scene.convex_bounds import Polyhedron, Sphere
from reference.scene.directional_light import DirectionalLight
from reference.scene.read import TruthScene
from reference.visibility.intervals import LitIntervals
from reference.visibility.line_crossings import crossed_facets, half_chord
from reference.visibility.parallel_rays import ParallelRays

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Length = Callable[[Index, Array], Array]

_RAYS = 4096  # rays at once
_PANELS = 8192  # panels at once
_EPS = float(np.finfo(float).eps)


def sum_directional(
    truth: TruthScene,
    light: DirectionalLight,
    rays: ParallelRays,
    lit: LitIntervals,
    segments: Segments,
    *,
    scale: Array,
    closed: bool = True,
) -> tuple[Array, Array]:
    """Integrate every lit interval through the media that it passes and add up the intervals of each ray.

    Parameters
    ----------
    truth, light, rays
        The scene, one of its directional lights, and the camera rays in the planes with that light.
    lit
        Lit intervals of the rays, as shares.
    segments
        From `reference.quadrature.segments.camera_segments`.
    scale
        What the relative uncertainty of coordinates is worth on each ray (`reference.visibility.directional_casting`),
        (n,) [m].
    closed
        Take the closed form where no body is a sphere; False sums panels there too.

    Returns
    -------
    radiance, bound
        Airlight [W/(m^2 sr)] and a bound of its error, (rays, 3) each.
    """
    setup = Crossed(truth, rays.direction, segments)
    closed = closed and not any(isinstance(medium.bounds, Sphere) for medium in truth.media)
    count = len(rays.direction)
    total, bound = np.zeros((count, 3)), np.zeros((count, 3))
    x0, x1 = rays.distance(lit.ray, lit.low), rays.distance(lit.ray, lit.high)
    uncertain = np.minimum(lit.edge * scale, rays.last - rays.first)
    for first in range(0, count, _RAYS):
        chosen = (lit.ray >= first) & (lit.ray < first + _RAYS) & (x1 > x0)
        stretches = lit.ray[chosen], x0[chosen], x1[chosen]
        pieces = cut_pieces(setup, stretches, kinks(truth, rays, np.unique(lit.ray[chosen])))
        if not len(pieces.ray):
            continue
        block = slice(first, first + _RAYS)
        part = _Sum(setup, rays, pieces)
        owner, rows = pieces.ray - first, len(total[block])
        value, error = part.closed_form(owner, rows) if closed else part.by_panels(owner, rows)
        total[block] = value
        bound[block] = error + sums_of(owner, part.edge_error(uncertain, _EPS * scale), rows)
    factor = light.irradiance / (4 * np.pi)
    return total * factor, bound * factor


def kinks(truth: TruthScene, rays: ParallelRays, used: Index) -> tuple[Index, Array]:
    """Return rays, among those used, and the distances at which their legs pass corners or tangents of the bodies."""
    numbers, places = [], []
    along, across, sine, cosine = (part[used] for part in (rays.direction, rays.across, rays.sine, rays.cosine))
    for medium in truth.media:
        if isinstance(medium.bounds, Polyhedron):
            row, z, y = polygon_corners(medium.bounds, rays.origin, along, across)
            x = z - y * (cosine / sine)[row]
        else:
            c_z, c_y, disk = _disks(medium.bounds, rays, used)
            row = np.tile(np.arange(len(used)), 2)
            y = np.concatenate([c_y - disk * cosine, c_y + disk * cosine])
            q = c_z * sine - c_y * cosine
            x = np.concatenate([q + disk, q - disk]) / np.tile(sine, 2)
        ahead = (y > 0) & np.isfinite(x)
        numbers.append(used[row[ahead]])
        places.append(x[ahead])
    return np.concatenate(numbers), np.concatenate(places)


def _disks(sphere: Sphere, rays: ParallelRays, ray: Index) -> tuple[Array, Array, Array]:
    """Return the disks in which the planes of rays cut a sphere: c_z, c_y, radius, 0 where they miss it."""
    centre = sphere.centre - rays.origin
    along, across = rays.direction[ray], rays.across[ray]
    return along @ centre, across @ centre, half_chord(sphere.radius, np.abs(np.cross(along, across) @ centre))


@dataclass
class _Sum:
    """The sums of one block of rays."""

    setup: Crossed
    rays: ParallelRays
    pieces: Pieces
    sigma_t: Array = field(init=False)  # of the medium of each piece
    factor: Array = field(init=False)  # albedo sigma_t p(c)
    lengths: list[Length] = field(init=False)

    def __post_init__(self):
        setup, numbers = self.setup, self.pieces.medium
        self.sigma_t = setup.by_medium("sigma_t", numbers)
        self.factor = self.sigma_t * setup.by_medium("albedo", numbers)
        cosine = self.rays.cosine[self.pieces.ray]
        for number in np.unique(numbers):
            chosen = numbers == number
            self.factor[chosen] *= setup.medium(int(number)).phase(np.clip(cosine[chosen], -1, 1))[:, None]
        bodies = [medium.bounds for medium in setup.truth.media]
        self.lengths = [
            _planes(self, bounds) if isinstance(bounds, Polyhedron) else _chords(self, bounds) for bounds in bodies
        ]

    def depth(self, rows: Index, x: Array) -> Array:
        """Return the optical depth from the camera to points x of pieces, (m, k), and on to the light, (m, k, 3)."""
        depth = self.pieces.depth[rows, None] + (x - self.pieces.x0[rows, None])[:, :, None] * self.sigma_t[rows, None]
        for medium, length in zip(self.setup.truth.media, self.lengths, strict=True):
            depth = depth + np.maximum(length(rows, x), 0.0)[:, :, None] * medium.sigma_t
        return depth

    def ends(self) -> Array:
        """Return the optical depth at both ends of every piece, (pieces, 2, 3)."""
        return self.depth(np.arange(len(self.pieces.ray)), np.stack([self.pieces.x0, self.pieces.x1], axis=1))

    def closed_form(self, owner: Index, count: int) -> tuple[Array, Array]:
        ends = self.ends()
        change = np.abs(ends[:, 1] - ends[:, 0])
        mean = np.where(change > 0, -np.expm1(-change) / np.where(change > 0, change, 1), 1.0)
        width = (self.pieces.x1 - self.pieces.x0)[:, None]
        value = self.factor * width * np.exp(-ends.min(axis=1)) * mean
        noise = _EPS * (16 + ends.max(axis=1)) * value
        return sums_of(owner, value, count), sums_of(owner, noise, count)

    def by_panels(self, owner: Index, count: int) -> tuple[Array, Array]:
        width = self.pieces.x1 - self.pieces.x0
        return sum_panels(first_panels(self.pieces.x0, width, np.inf), self.evaluate, owner, count)

    def evaluate(self, piece: Index, start: Array, width: Array) -> Panels:
        both, noise = np.empty((2, len(piece), 3)), np.empty((len(piece), 3))
        for first in range(0, len(piece), _PANELS):
            block = slice(first, first + _PANELS)
            rows, half = piece[block], 0.5 * width[block]
            depth = self.depth(rows, start[block, None] + half[:, None] * (1 + WIDE.nodes))
            integral = np.einsum("mnc,nk->kmc", np.exp(-depth), WIDE.weights)
            both[:, block] = integral * half[:, None] * self.factor[rows]
            noise[block] = _EPS * (16 + depth[:, 10]) * np.abs(both[0, block])
        return Panels(piece, start, width, both[0], np.abs(both[0] - both[1]), noise)

    def edge_error(self, uncertain: Array, rounding: Array) -> Array:
        """Return what uncertain places of edges of shadows, and of kinks, are worth, (pieces, 3).

        Both are given by ray [m]. A kink that is misplaced matters where a facet lies along the light: there the
        integrand jumps.
        """
        strip = np.exp(-self.ends()) * self.factor[:, None]
        ray, x0, x1 = self.pieces.ray, self.pieces.x0, self.pieces.x1
        total = np.zeros(self.factor.shape)
        for end, chosen in enumerate((self.pieces.first, self.pieces.last)):
            total += (chosen * uncertain[ray])[:, None] * strip[:, end]
        same = (ray[1:] == ray[:-1]) & (x0[1:] == x1[:-1]) & (self.pieces.medium[1:] == self.pieces.medium[:-1])
        total[1:] += (16 * same * rounding[ray[1:]])[:, None] * np.abs(strip[1:, 0] - strip[:-1, 1])
        return total


def _planes(block: _Sum, body: Polyhedron) -> Length:
    """Return a function (pieces, x) -> length of the legs in a polyhedron, by the planes that the middle leg meets."""
    ray, origin = block.pieces.ray, block.rays.origin
    middle = 0.5 * (block.pieces.x0 + block.pieces.x1)
    towards, along = block.rays.to_light[ray], block.rays.direction[ray]
    enter, leave, low, high = crossed_facets(body, origin + middle[:, None] * along, towards)
    missed = (low >= high) | (high <= 0)
    room = body.offset - body.normal @ origin
    planes = []
    # Where the middle lies in the body, so does the whole piece, and its legs begin there.
    for facet, from_start in ((enter, low <= 0), (leave, np.zeros(len(ray), bool))):
        rate = np.sum(body.normal[facet] * towards, axis=1)
        rate = np.where(missed | from_start, 1.0, rate)
        slope = np.where(missed | from_start, 0.0, -np.sum(body.normal[facet] * along, axis=1) / rate)
        planes.append((np.where(missed | from_start, 0.0, room[facet] / rate), slope))

    def length(rows: Index, x: Array) -> Array:
        near, far = (start[rows, None] + slope[rows, None] * x for start, slope in planes)
        return far - near

    return length


def _chords(block: _Sum, sphere: Sphere) -> Length:
    """Return a function (pieces, x) -> length of the legs in a sphere."""
    ray = block.pieces.ray
    c_z, c_y, disk = _disks(sphere, block.rays, ray)
    sine, cosine = block.rays.sine[ray], block.rays.cosine[ray]

    def length(rows: Index, x: Array) -> Array:
        beyond, aside = c_z[rows, None] - x, c_y[rows, None]
        s, c = sine[rows, None], cosine[rows, None]
        half = half_chord(disk[rows, None], np.abs(beyond * s - aside * c))
        closest = beyond * c + aside * s
        return closest + half - np.maximum(closest - half, 0.0)

    return length
