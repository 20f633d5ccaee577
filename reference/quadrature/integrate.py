# SPDX-License-Identifier: BSD-3-Clause
"""Integrals over lit stretches for any medium: pieces between corners, in panels that are halved
until each ray meets a tolerance.

A medium gives a function from stretches to its `Integrand`: the pieces that these stretches have
between its corners (`reference.quadrature.intervals`), and the light that it scatters along them.
Lights, tolerances and uncertain edges are known here. Panels, their rules, and the variable near a
place are as in `analytic.panels`; under a direction the variable is the distance. The integrals are
albedo sigma_t J [1/m^2] of a point light, and albedo sigma_t int exp(-tau) dx [1] of a directional
light.

**The error of a ray** adds three parts: by how much both rules of its panels differ, rounding, and
the integrand at every edge between light and shadow times the uncertainty of its place.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from airlight.analytic.kronrod import Pair
from airlight.analytic.panels import (
    Panels,
    adapted,
    blocks_by_rule,
    equal_panels,
    log_distance,
)
from airlight.reference.quadrature.intervals import Pieces, Stretches
from airlight.reference.scene.homogeneous_medium import ReferenceMedium
from airlight.reference.scene.point_light import ReferenceLight
from airlight.reference.scene.varying import VaryingMedium
from airlight.reference.visibility.planes import Rays, falloff

Array = NDArray[np.float64]
Index = NDArray[np.int64]
# distances, (m, k) [m], and rays, (m,) -> intensity over that on the axis
Profile = Callable[[Array, Index], Array]
#: An error that is a derived upper bound, or an estimate from two values of the same
#: quantity: by two rules, or two steps.
ErrorKind = Literal["proven", "estimated"]

AT_LIGHT = 1e-290  #: height [m] below which a ray meets the light
_EPS = float(np.finfo(float).eps)
_DEEP = 8.0  # optical depths of a body that both rules of a panel see by their nodes


@dataclass(frozen=True)
class Paths:
    """How much of the extinction attenuates on both ways."""

    camera: float | Array = 1.0  #: fraction a of the depth from the camera; may be by ray
    light: float = 1.0  #: fraction b of the depth from the light
    length: float = 0.0  #: M, the constant length of every way from a light [m]

    def of_camera(self, ray: Index) -> Array:
        """Return the fraction a of rays of these numbers."""
        if isinstance(self.camera, np.ndarray):
            return self.camera[ray]
        return np.full(len(ray), self.camera)

    @property
    def fall(self) -> float | Array:
        """The fraction that attenuates along a ray without end, at least; may be by ray."""
        if isinstance(self.camera, np.ndarray):
            return np.maximum(self.camera, self.light)
        return max(self.camera, self.light)


WHOLE = Paths()  #: the physical equation


@dataclass(frozen=True)
class Terms:
    """How lights of strength 1 shine on the lit stretches that are summed, and
    how well these are known.
    """

    profile: Profile | None = None  #: of lights at places; None: they are isotropic
    #: r^2 times the distance law of lights at places, by the distance [m]; None for 1
    law: Callable[[Array], Array] | None = None
    paths: Paths = WHOLE
    #: fraction of the way to a place that attenuates, from the scattering point on
    shadow_scale: float = 1.0
    #: uncertainty of ends: relative to their distance from a place, or by ray a length [m]
    edge: float | Array = 0.0
    rounding: Array | None = None  #: uncertainty of the places of kinks, by ray [m]
    rtol: float | None = None  #: relative tolerance of a sum; the field's own by default


TERMS = Terms()


def strongest(medium: ReferenceMedium | VaryingMedium) -> Array:
    """Return the most that a metre of a ray scatters in a medium, albedo sigma_t p, (3,) [1/m]."""
    # A table has its largest value at one of its entries.
    cosines = np.concatenate([np.linspace(-1, 1, 1001), medium.phase.kinks])
    return medium.albedo * medium.largest * float(medium.phase(cosines).max())


def sums_of(owner: Index, values: Array, count: int) -> Array:
    """Add up the rows that belong to each owner.

    `owner`: of each row, from 0 on, (n,); `values`: (n, columns), in any unit, such as [1/m];
    `count`: number of owners. Returns (count, columns), in the unit of the values.
    """
    return np.stack([np.bincount(owner, column, count) for column in values.T], axis=1)


def profile_of(light: ReferenceLight, rays: Rays) -> Profile | None:
    """Return the profile of a light along rays; None for one that is isotropic in its cone."""
    if not light.is_soft:
        return None
    return lambda x, ray: falloff(
        np.arctan2(x - rays.foot[ray, None], rays.height[ray, None]), rays[ray], light
    )


def cosine_profile(rays: Rays, normal: Array) -> Profile:
    """Return the cosine at samples of a light with unit normals, (rays, 3), along rays in
    their planes with these.
    """
    # n . (o + x w - y) of the derivation is linear in x.
    start = np.sum(normal * (rays.origin - rays.position), axis=1)
    rise = np.sum(normal * rays.direction, axis=1)

    def cosine(x: Array, ray: Index) -> Array:
        r = np.hypot(rays.height[ray, None], x - rays.foot[ray, None])
        return np.maximum(start[ray, None] + rise[ray, None] * x, 0.0) / np.maximum(
            r, np.finfo(float).tiny
        )

    return cosine


class Integrand(Protocol):
    """The integrand of a medium along pieces: exp(-tau) p, to be multiplied by albedo sigma_t."""

    @property
    def pieces(self) -> Pieces:
        """Between the corners of the medium."""

    @property
    def factor(self) -> Array:
        """The factor of the values, such as albedo sigma_t where that is
        constant, (pieces, 3) [1/m].
        """

    @property
    def extinction(self) -> Array:
        """The largest, by which pieces under directions are parted, (pieces,) [1/m]."""

    @property
    def densest(self) -> float:
        """The largest extinction of bodies that paths may cross, 0 where there are none [1/m]."""

    @property
    def same(self) -> Index:
        """Which column of the values each channel has, (3,)."""

    def __call__(
        self, rows: Index, x: Array, inside: Array, r: Array, scatter: Array
    ) -> tuple[Array, Array]:
        """Return values and optical depths of nodes, (m, nodes, columns) each.

        `rows`: the pieces, (m,); `x`, `inside`: distances from the camera, and from where the
        pieces begin, (m, nodes) [m]; `r`: distances to the lights, infinite for directions, (m,
        nodes) [m]; `scatter`: cosines of the scattering angle, (m, nodes).
        """


#: lit stretches -> the integrand along their pieces; None where nothing scatters
Source = Callable[[Stretches], Integrand | None]


def sum_stretches(
    rays: Rays, stretches: Stretches, source: Source, terms: Terms, *, rtol: float, step: int
) -> tuple[Array, Array]:
    """Integrate what a medium scatters on lit stretches, for lights of strength 1.

    Parameters
    ----------
    rays, stretches, terms
        See `reference.quadrature.fields.Field.sums`.
    source
        Returns the integrand along the pieces of lit stretches, None where nothing scatters.
    rtol
        Relative tolerance of the sum of a ray and a light [1], where `terms` has none.
    step
        Rays at once.

    Returns
    -------
    tuple
        The airlight of each ray, and its error, (rays, 3) each, [1/m^2] for places and [1] for
        directions; infinite where a ray meets a light in a medium that scatters.
    """
    ray, x0, x1 = stretches
    count, rtol = len(rays.foot), terms.rtol or rtol
    value, error = np.zeros((2, count, 3))
    for first in range(0, count, step):
        block = slice(first, min(first + step, count))
        # Cutting needs intervals of a positive length.
        chosen = (ray >= block.start) & (ray < block.stop) & (x1 > x0)
        integrand = source((ray[chosen], x0[chosen], x1[chosen])) if chosen.any() else None
        if integrand is not None:
            value[block], error[block] = _sum_block(rays, integrand, block, terms, rtol)
    # Phase functions have the mean 1; 1/(4 pi) makes densities over the sphere of them.
    return value / (4 * np.pi), error / (4 * np.pi)


def _sum_block(
    rays: Rays, integrand: Integrand, block: slice, terms: Terms, rtol: float
) -> tuple[Array, Array]:
    """Return the sums of the rays of a block, and their errors: infinite where a ray meets a light
    in a medium that scatters.
    """
    work, pieces = _Sum(rays, integrand, terms), integrand.pieces
    edge = np.broadcast_to(terms.edge, len(rays.foot))
    rounding = np.zeros(len(rays.foot)) if terms.rounding is None else terms.rounding
    owner, count = pieces.ray - block.start, len(rays.foot[block])
    # The tolerance is relative to the sum of a ray and a light.
    value, error = adapted(work.first_panels(), work.evaluate, owner, count, rtol)
    error = error + sums_of(owner, work.edge_error(edge, rounding), count)
    # A ray through the light: the integral of 1/r^2 diverges, unless nothing scatters there.
    meets = sums_of(owner, work.meets_light()[:, None] * integrand.factor, count) > 0
    return np.where(meets, np.inf, value), np.where(meets, np.inf, error)


def _graded(panels: tuple[Index, Array, Array], levels: Array) -> tuple[Index, Array, Array]:
    """Cut the first and the last panel of pieces towards the ends of these, by halves.

    `panels`: owner, start and width, two of each piece that has levels at least; `levels`: how
    often the panel at an end is halved, by piece.
    """
    owner, start, width = panels
    change = owner[1:] != owner[:-1]
    is_first, is_last = np.r_[True, change], np.r_[change, True]
    kept = (levels[owner] == 0) | ~(is_first | is_last)
    parts = [(owner[kept], start[kept], width[kept])]
    for level in np.unique(levels[levels > 0]):
        towards = np.r_[0.0, 0.5 ** np.arange(int(level), -1, -1)]
        for chosen, ends in ((is_first, towards), (is_last, 1 - towards[::-1])):
            rows = chosen & (levels[owner] == level)
            begin = start[rows, None] + width[rows, None] * ends[:-1]
            wide = width[rows, None] * np.diff(ends)
            parts.append((np.repeat(owner[rows], len(ends) - 1), begin.ravel(), wide.ravel()))
    owners, starts, widths = zip(*parts, strict=True)
    return np.concatenate(owners), np.concatenate(starts), np.concatenate(widths)


@dataclass
class _Sum:
    """The sums of one block of rays, in v = asinh((x - foot)/height) for places
    and in x for directions.
    """

    rays: Rays
    integrand: Integrand
    terms: Terms
    own: Rays = field(init=False)  # the ray of each piece
    height: Array = field(init=False)
    start: Array = field(init=False)  # where each piece begins, in v or x
    width: Array = field(init=False)

    def __post_init__(self):
        pieces = self.integrand.pieces
        self.own = self.rays[pieces.ray]
        if self.rays.w:
            # Short pieces far from the foot keep the digits of their width.
            height = np.maximum(self.own.height, AT_LIGHT)
            self.start, _, self.width, self.height = log_distance(
                self.own.foot, height, pieces.x0, pieces.x1
            )
        else:
            self.height, self.start, self.width = self.own.height, pieces.x0, pieces.x1 - pieces.x0

    def first_panels(self) -> tuple[Index, Array, Array]:
        # First panels are 2.4 wide in v, as in `analytic.panels`; under directions a piece is one.
        count = np.maximum(np.ceil(self.width / (2.4 if self.rays.w else np.inf)), 1)
        # Light enters a dense body through a skin, and shines past its edges into a small part of a
        # piece: no node of a wide panel sees that, and where the rest of the ray is lit both rules
        # agree on nothing. Such pieces are cut down to a 16th of a mean free path at both ends.
        pieces = self.integrand.pieces
        depth = self.integrand.densest * (pieces.x1 - pieces.x0)
        levels = np.where(depth > _DEEP, np.ceil(np.log2(np.maximum(depth, 1.0))) + 4, 0.0)
        count = np.where(levels > 0, np.maximum(count, 2), count)
        panels = equal_panels(np.arange(len(count)), self.start, self.width, count)
        return _graded(panels, levels) if levels.any() else panels

    def meets_light(self) -> NDArray[np.bool_]:
        near = (self.own.height < AT_LIGHT) & bool(self.rays.w)
        return (
            near
            & (self.integrand.pieces.x0 <= self.own.foot)
            & (self.own.foot <= self.integrand.pieces.x1)
        )

    def evaluate(self, piece: Index, start: Array, width: Array) -> Panels:
        """Integrate panels by both rules, a block at a time so that the
        arrays stay in the cache.
        """
        integrals, noise = np.empty((2, len(piece), 3)), np.empty((len(piece), 3))
        # The rule of a panel follows from its width in v. A panel in x over an optical depth of 0.2
        # counts as 0.1 wide, the most for the narrow rule.
        size = width if self.rays.w else width * self.integrand.extinction[piece] / 2.0
        for pair, block in blocks_by_rule(size, 8192):
            integrals[:, block], noise[block] = self.evaluate_block(
                pair, piece[block], start[block], width[block]
            )
        return Panels(piece, start, width, integrals[0], np.abs(integrals[0] - integrals[1]), noise)

    def evaluate_block(
        self, pair: Pair, rows: Index, start: Array, width: Array
    ) -> tuple[Array, Array]:
        """Return the integrals of panels by both rules, (2, m, 3), and the rounding
        errors of the first, (m, 3).
        """
        half, same = 0.5 * width, self.integrand.same
        f, depth = self.at(rows, start[:, None] + half[:, None] * (1 + pair.nodes))
        scale = half[:, None] * self.integrand.factor[rows]
        # Nodes are summed by both rules at once, and channels with the same extinction share a
        # column.
        integrals = np.moveaxis(np.tensordot(f, pair.weights, (1, 0)), 2, 0)[..., same] * scale
        # The exponential of a depth tau has tau roundings; 16 are for all other operations. The
        # depth at the middle node stands for the panel.
        return integrals, _EPS * (16 + depth[:, len(pair.nodes) // 2, same]) * np.abs(integrals[0])

    def at(self, rows: Index, v: Array) -> tuple[Array, Array]:
        """Return the integrand, times dx/r^2 or dx by dv and the profile,
        and tau, at v, (m, nodes).
        """
        own, begin = self.own, self.integrand.pieces.x0[rows, None]
        if self.rays.w:
            height, foot = self.height[rows, None], own.foot[rows, None]
            # With s = height sinh(v): cosine = 1/cosh(v), r = height cosh(v), the scattering angle
            # has the cosine -tanh(v), and dx/r^2 = dv/(height cosh(v)). One exponential is all.
            up = np.exp(v)
            down = 1 / up
            cosine = 2 / (up + down)
            half = 0.5 * (up - down)
            s, r, scatter, rate = height * half, height / cosine, -half * cosine, cosine / height
            x, inside = foot + s, np.maximum(s + (foot - begin), 0.0)
        else:
            x, inside, r = v, v - begin, np.full_like(v, np.inf)
            # Under a directional light `foot` is the cosine of the scattering angle, one along the
            # ray; rounding may put it beyond 1.
            scatter, rate = (
                np.broadcast_to(np.clip(own.foot[rows, None], -1, 1), v.shape),
                np.ones_like(v),
            )
        f, depth = self.integrand(rows, x, inside, r, scatter)
        if self.terms.profile is not None:
            rate = rate * self.terms.profile(x, self.integrand.pieces.ray[rows])
        if self.terms.law is not None and self.rays.w:
            rate = rate * self.terms.law(r)
        return f * rate[:, :, None], depth

    def edge_error(self, edge: Array, rounding: Array) -> Array:
        """Return the effect of uncertain places of shadow edges and kinks:
        integrand times uncertainty.
        """
        pieces, every = self.integrand.pieces, np.arange(len(self.width))
        ends = np.stack([self.start, self.start + self.width], axis=1)
        # The integrand at both ends of each piece, per unit of v (of x under directions). An
        # uncertain end moves the sum by integrand times uncertainty, where the piece begins or ends
        # at an edge of a shadow.
        f = self.at(every, ends)[0][..., self.integrand.same] * self.integrand.factor[:, None]
        total = np.zeros((len(every), 3))
        for end, chosen in enumerate((pieces.first, pieces.last)):
            total += (chosen * edge[pieces.ray])[:, None] * f[:, end]
        # A kink between two pieces of one medium at an uncertain place counts only by the jump of
        # the integrand there.
        same = (pieces.ray[1:] == pieces.ray[:-1]) & (pieces.x0[1:] == pieces.x1[:-1])
        same &= pieces.medium[1:] == pieces.medium[:-1]
        total[1:] += (16 * same * rounding[pieces.ray[1:]])[:, None] * np.abs(f[1:, 0] - f[:-1, 1])
        return total
