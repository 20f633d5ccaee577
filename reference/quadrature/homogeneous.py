# SPDX-License-Identifier: BSD-3-Clause
r"""Homogeneous media, bounded or not: optical depth, corners, and the light that they scatter.

The bodies are disjoint, so the optical depth between two points is

    tau = sigma_0 l + sum_j (sigma_j - sigma_0) l_j,

l the distance, l_j what lies in body j, sigma_0 the extinction of what surrounds the bodies. A body
holds one interval [enter, leave] of a straight line; l_j is the part of it between the points.

The single scattering of a piece of a ray inside one medium m is, for a light at a place (w = 1) or
in a direction (w = 0, `reference.visibility.planes`),

    L = albedo_m sigma_m I / (4 pi)  int exp(-tau_camera - tau_shadow) p_m(cos) dx / (r^2 or 1),
    tau_camera = tau_0 + sigma_m (x - x_0),
    tau_shadow = sigma_0 s r + sum_j (sigma_j - sigma_0) |[enter_j, leave_j] and [0, s r]|,

a model (`reference.quadrature.model_terms`) having a tau_camera + b tau_shadow + sigma_m M instead,

I the intensity or irradiance of the light, r the distance to it, enter_j and leave_j the distances
from the point x at which the shadow segment enters and leaves body j; s is `shadow_scale`. Under a
directional light sigma_0 = 0 and r is unbounded. Near a place the integral is taken in the variable
v = asinh((x - foot)/height), dx/r^2 = dv/(height cosh v), where it is as smooth beside the light as
far from it; else in x.

Lit stretches are cut at the bounds of the media, where a shadow segment passes a corner of a body
or touches it (`reference.quadrature.intervals`), and at the kinks of tabulated phase functions. On
such a piece the segment enters and leaves a polyhedron through the same two facets n . p = d, at
the distance

    r (d - n . x) / (n . P - w n . x),      P the light, x the point, r = |P - w x|.

The two facets are looked up once between two kinks of the segment, so that the cost of a node
grows with the number of bodies, not of facets. The pieces are integrated by Gauss and Kronrod's
pairs on panels that are halved until a ray meets the tolerance (see `analytic.panels`), once for
channels whose extinction is the same in all media.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from airlight.reference.quadrature.integrate import (
    AT_LIGHT,
    TERMS,
    ErrorKind,
    Paths,
    Terms,
    strongest,
    sum_stretches,
)
from airlight.reference.quadrature.intervals import (
    AMBIENT,
    Kinks,
    Pieces,
    Segments,
    Stretches,
    camera_segments,
    cut,
    parts_in_media,
    shadow_kinks,
)
from airlight.reference.scene.convex_bounds import Bounds, Sphere
from airlight.reference.scene.homogeneous_medium import ReferenceMedium
from airlight.reference.scene.read import ReferenceScene, homogeneous_around
from airlight.reference.visibility.distances import crossed_facets, crossings, sphere_crossings
from airlight.reference.visibility.planes import Rays

Array = NDArray[np.float64]
Index = NDArray[np.int64]


@dataclass(frozen=True)
class HomogeneousField:
    """The medium around the camera, and media in disjoint convex bounds; a field
    (`reference.quadrature.fields`).
    """

    reference: ReferenceScene

    @property
    def error_kind(self) -> ErrorKind:
        """The kind of the errors: the integrand is analytic on a piece, and the worse
        rule bounds the better one.
        """
        return "proven"

    @property
    def strongest(self) -> Array:
        """The most that a metre of a ray scatters, (3,) [1/m]."""
        return np.max(
            [
                strongest(medium)
                for medium in (homogeneous_around(self.reference), *self.reference.media)
            ],
            axis=0,
        )

    def optical_depth(self, origin: Array, direction: Array, low: Array, high: Array) -> Array:
        """Return the optical depth of parts of straight lines, (n, 3) [1]: the tau of the
        derivation, for any points, inside or outside of the media.
        """
        # The medium around over all of the part, then what each body differs from it over what lies
        # in the body.
        around = self.reference.medium.sigma_t
        total = np.maximum(high - low, 0.0)[:, None] * around
        for medium in self.reference.media:
            enter, leave = crossings(medium.bounds, origin, direction)
            inside = np.maximum(np.minimum(leave, high) - np.maximum(enter, low), 0.0)
            total += inside[:, None] * (medium.sigma_t - around)
        # A body thinner than the medium around it leaves a difference, which rounding may turn
        # negative.
        return np.maximum(total, 0.0)

    def leave(self, origin: Array, direction: Array) -> Array:
        """Return the distance behind which rays meet nothing that scatters, (n,) [m]."""
        # A medium without bounds that scatters goes on for ever.
        if strongest(homogeneous_around(self.reference)).any():
            return np.full(len(direction), np.inf)
        spans = [crossings(medium.bounds, origin, direction) for medium in self.reference.media]
        # A body that the ray misses, or that is behind its beginning, ends at 0.
        ends = [np.where(enter < leave, np.maximum(leave, 0.0), 0.0) for enter, leave in spans]
        return np.max([np.zeros(len(direction)), *ends], axis=0)

    def sums(
        self, rays: Rays, stretches: Stretches, distance: Array, terms: Terms = TERMS
    ) -> tuple[Array, Array]:
        """Return the airlight of each ray from its lit stretches, and a bound of
        its error, (rays, 3) each.
        """
        if not self.strongest.any():
            return np.zeros((len(rays.foot), 3)), np.zeros((len(rays.foot), 3))
        segments = camera_segments(replace(self.reference, direction=rays.direction), distance)

        def source(lit: Stretches) -> "_Integrand | None":
            parts = parts_in_media(self.reference, rays, segments, lit, terms.paths.fall)
            if not len(parts.ray):
                return None
            pieces, kinks = _cut_at_kinks(self.reference, rays, parts, np.unique(lit[0]))
            # The optical depth between camera and piece grows linearly on a part, which lies in one
            # medium: from the camera to the part once, then by sigma_t times the distance into it.
            before = self.optical_depth(
                rays.origin, rays.direction[parts.ray], np.zeros(len(parts.ray)), parts.x0
            )
            into = (pieces.x0 - parts.x0[pieces.part])[:, None]
            depth = before[pieces.part] + into * by_medium(self.reference, "sigma_t", pieces.medium)
            return _Integrand(
                self.reference,
                pieces,
                depth,
                rays[pieces.ray],
                kinks,
                terms.shadow_scale,
                terms.paths,
            )

        return sum_stretches(rays, stretches, source, terms, rtol=1e-10, step=4096)


def medium_of(reference: ReferenceScene, number: int) -> ReferenceMedium:
    """Return the medium of this number."""
    return homogeneous_around(reference) if number == AMBIENT else reference.media[number]


def by_medium(reference: ReferenceScene, name: str, numbers: Index) -> Array:
    """Return a property of the media of these numbers, (n, 3)."""
    media = (*reference.media, reference.medium)  # AMBIENT is the last
    return np.stack([getattr(medium, name) for medium in media])[numbers]


def smooth_pieces(
    reference: ReferenceScene, rays: Rays, segments: Segments, stretches: Stretches
) -> Pieces:
    """Cut lit stretches at the bounds of media and at the kinks of shadow segments and of phase
    functions.
    """
    parts = parts_in_media(reference, rays, segments, stretches)
    if not len(parts.ray):  # of a batch of rays none is lit within the media
        return parts
    return _cut_at_kinks(reference, rays, parts, np.unique(stretches[0]))[0]


def _cut_at_kinks(
    reference: ReferenceScene, rays: Rays, parts: Pieces, used: Index
) -> tuple[Pieces, list[Kinks]]:
    """Return the smooth pieces of parts in one medium each, and the kinks of the shadow segments
    through each of the bounded media.

    `used`: rays that have a lit stretch.
    """
    body_kinks: list[Kinks] = []
    for medium in reference.media:
        row, x = shadow_kinks(medium.bounds, rays[used])
        body_kinks.append((used[row], x))
    # Along a ray a directional light has one scattering angle, and no kink of a phase function.
    phases = _kinks_of_phases(reference, rays, used) if rays.w else []
    none = np.empty(0, np.int64), np.empty(0)
    ray, x = (np.concatenate(column) for column in zip(none, *body_kinks, *phases, strict=True))
    return cut(parts, (ray, x)), body_kinks


def _kinks_of_phases(reference: ReferenceScene, rays: Rays, used: Index) -> list[Kinks]:
    """Return rays, among those used, and distances of the kinks of phase functions."""
    every = []
    for phase in {
        id(medium.phase): medium.phase for medium in (reference.medium, *reference.media)
    }.values():
        # The scattering angle has the cosine c where x - foot = -height c / sqrt(1 - c^2). Phase
        # functions that media share are asked once.
        offset = np.outer(rays.height[used], -phase.kinks / np.sqrt(1 - phase.kinks**2))
        every.append((np.repeat(used, len(phase.kinks)), (rays.foot[used, None] + offset).ravel()))
    return every


@dataclass
class _Integrand:
    """exp(-tau) p on the pieces of one block of rays
    (`reference.quadrature.integrate.Integrand`).
    """

    reference: ReferenceScene
    pieces: Pieces
    depth: Array  # optical depth between camera and each piece, (pieces, 3)
    own: Rays  # the ray of each piece
    kinks: list[Kinks]  # of the shadow segments through each bounded medium
    scale: float
    paths: Paths
    factor: Array = field(init=False)  # albedo sigma_t of the medium of each piece, (pieces, 3)
    extinction: Array = field(init=False)  # the largest of the channels, (pieces,)
    different: Index = field(init=False)  # a channel of each set of extinctions, (sets,)
    same: Index = field(init=False)  # number of the set of each channel, (3,)
    # of these sets, (pieces, sets): what attenuates from the camera to the piece and along it, and
    # on the constant length of ways from the light
    before: Array = field(init=False)
    along: Array = field(init=False)
    bodies: list["_Body"] = field(init=False)

    def __post_init__(self):
        reference, pieces = self.reference, self.pieces
        sigma_t = by_medium(reference, "sigma_t", pieces.medium)
        self.factor, self.extinction = (
            sigma_t * by_medium(reference, "albedo", pieces.medium),
            sigma_t.max(axis=1),
        )
        # Channels whose extinction is the same in all media have the same integrals: each set is
        # integrated once, and `same` gives it to its channels.
        every = np.stack([medium.sigma_t for medium in (reference.medium, *reference.media)])
        _, self.different, self.same = np.unique(
            every, axis=1, return_index=True, return_inverse=True
        )
        camera, own = self.paths.of_camera(pieces.ray)[:, None], sigma_t[:, self.different]
        self.before = camera * self.depth[:, self.different] + self.paths.length * own
        self.along = camera * own
        self.bodies = [
            _Body.of(self.own, pieces, medium.bounds, kinks)
            for medium, kinks in zip(reference.media, self.kinks, strict=True)
        ]

    @property
    def densest(self) -> float:
        """The largest extinction of the bodies, 0 where there are none [1/m]; under a directional
        light, whose panels are even in the distance, also that of the medium around them.
        """
        around = () if self.own.w else (self.reference.medium,)
        media = (*self.reference.media, *around)
        return max((float(each.sigma_t.max()) for each in media), default=0.0)

    def __call__(
        self, rows: Index, x: Array, inside: Array, r: Array, scatter: Array
    ) -> tuple[Array, Array]:
        reference = self.reference
        depth = self.before[rows, None] + inside[:, :, None] * self.along[rows, None]
        around, fraction = reference.medium.sigma_t[self.different], self.paths.light
        # `tau_shadow` of the derivation: the medium around over all of the segment, and what bodies
        # differ from it over what lies in them. A directional light's segment is unbounded and only
        # bodies attenuate it; around * inf would be no number where around is 0.
        limit = self.scale * r if self.own.w else r
        if np.any(around > 0) and fraction:
            depth += limit[:, :, None] * (fraction * around)
        for medium, body in zip(reference.media if fraction else (), self.bodies):
            depth += body.length(rows, x, r, limit)[:, :, None] * (
                fraction * (medium.sigma_t[self.different] - around)
            )
        return np.exp(-depth) * self.phase(rows, scatter)[:, :, None], depth

    def phase(self, rows: Index, scatter: Array) -> Array:
        """Return the phase function of each piece's medium."""
        numbers = self.pieces.medium[rows]
        media = np.unique(numbers)
        # Most blocks lie in one medium; then its phase function is asked for the whole array.
        if len(media) == 1:
            return medium_of(self.reference, int(media[0])).phase(scatter)
        result = np.empty(scatter.shape)
        for number in media:
            chosen = numbers == number
            result[chosen] = medium_of(self.reference, int(number)).phase(scatter[chosen])
        return result


@dataclass(frozen=True)
class _Body:
    """How much of shadow segments lies in a body, of the points of pieces."""

    own: Rays  # the ray of each piece
    bounds: Bounds
    run: Index  # of a polyhedron: the number of the run of each piece
    #: of each run and both facets, d - n . o, n . d and n . (P - w o): given numbers
    #: where the segment meets none
    facets: tuple[tuple[Array, Array, Array], ...]

    @staticmethod
    def of(own: Rays, pieces: Pieces, bounds: Bounds, kinks: Kinks) -> "_Body":
        if isinstance(bounds, Sphere):
            return _Body(own, bounds, np.empty(0, np.int64), ())
        # Within a run the segment enters and leaves through the same two facets: the middle of the
        # run finds them for all of its nodes.
        run, first, last = _runs(pieces, kinks)
        lines = own[first]
        middle = 0.5 * (pieces.x0[first] + pieces.x1[last])
        point = own.origin + middle[:, None] * lines.direction
        towards = lines.position - own.w * point
        r = np.linalg.norm(towards, axis=1)
        towards /= r[:, None]
        enter, leave, low, high = crossed_facets(bounds, point, towards)
        # No corner between ray and light is on the run, so what the middle says of these cases
        # holds for all of it. The planes of facets behind the ray or beyond the light would not:
        # corners there were not looked for.
        r = r if own.w else np.full(len(r), np.inf)
        missed = (low >= high) | (low >= r) | (high <= 0)
        facets = []
        for facet, at_zero, unbounded in (
            (enter, missed | (low <= 0), False),
            (leave, missed, high >= r),
        ):
            # Where the segment misses the body, or begins inside of it, it enters at 0; where it
            # ends inside of it, it leaves at infinity, and `length` cuts it at the light. Slope 0
            # and rise 1 make the quotient of `length` these numbers.
            given = at_zero | unbounded
            room = bounds.offset[facet] - bounds.normal[facet] @ own.origin
            slope = np.sum(bounds.normal[facet] * lines.direction, axis=1)
            rise = np.sum(bounds.normal[facet] * (lines.position - own.w * own.origin), axis=1)
            facets.append(
                (
                    np.where(at_zero, 0.0, np.where(unbounded, np.inf, room)),
                    np.where(given, 0.0, slope),
                    np.where(given, 1.0, rise),
                )
            )
        return _Body(own, bounds, run, tuple(facets))

    def length(self, rows: Index, x: Array, r: Array, limit: Array) -> Array:
        """Return the length inside of [0, limit] of segments from points x of pieces to the
        light, at r, (m, nodes).
        """
        if isinstance(self.bounds, Sphere):
            enter, leave = self._sphere(rows, x, r)
        else:
            run, w = self.run[rows], self.own.w
            # The distance r (d - n . x) / (n . P - w n . x) to the planes of both facets.
            way = r if w else 1.0
            with np.errstate(divide="ignore", invalid="ignore"):
                enter, leave = (
                    way
                    * (room[run, None] - x * slope[run, None])
                    / (rise[run, None] - w * x * slope[run, None])
                    for room, slope, rise in self.facets
                )
        return np.maximum(np.minimum(leave, limit) - np.maximum(enter, 0.0), 0.0)

    def _sphere(self, rows: Index, x: Array, r: Array) -> tuple[Array, Array]:
        assert isinstance(self.bounds, Sphere)
        own, centre = self.own, self.bounds.centre - self.own.origin
        along = np.sum(own.direction * centre, axis=1)[rows, None]
        towards = np.sum((own.position - own.w * own.origin) * centre, axis=1)[rows, None]
        # (C - x) . (P - w x), by components: C . P - x d . P - w x d . C + w
        # x^2, all from the camera.
        place = np.sum((own.position - own.w * own.origin) * own.direction, axis=1)[rows, None]
        product = towards - x * place - own.w * x * (along - x)
        power = (x - along) ** 2 + (centre @ centre - self.bounds.radius**2 - along**2)
        return sphere_crossings(product / (np.maximum(r, AT_LIGHT) if own.w else 1.0), power)


def _runs(pieces: Pieces, kinks: Kinks) -> tuple[Index, Index, Index]:
    """Return the number of the run of each piece, and the first and the last piece of each run.

    A run is what lies of a part of a lit stretch between two kinks of a shadow segment.
    """
    # Kinks come before the pieces that begin at them.
    ray, x = np.concatenate([kinks[0], pieces.ray]), np.concatenate([kinks[1], pieces.x0])
    everything = np.lexsort((np.arange(len(ray)), x, ray))
    # All kinks and beginnings of pieces in the order of rays and distances: the kinks before a
    # piece are a running count. A run begins with a part of a stretch, or where this count changes.
    is_piece = everything >= len(kinks[0])
    kinks_before = np.empty(len(pieces.ray), np.int64)
    kinks_before[everything[is_piece] - len(kinks[0])] = np.cumsum(~is_piece)[is_piece]
    begins = np.ones(len(pieces.ray), bool)
    begins[1:] = (pieces.part[1:] != pieces.part[:-1]) | (kinks_before[1:] != kinks_before[:-1])
    first = np.flatnonzero(begins)
    return np.cumsum(begins) - 1, first, np.append(first[1:], len(begins)) - 1
