# SPDX-License-Identifier: BSD-3-Clause
"""Height fog: its airlight is `analytic.height_fog` in the rays' planes.

Under a sun it has a closed form. A weight along the ray, such as the fade of a model, and light
paths of one length have none: their integrand is summed by panels that span four scale heights at
most.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from airlight.analytic.height_fog import (
    HeightFog,
    HeightRays,
    Layer,
    height_fog_segments,
    height_fog_sun,
)
from airlight.analytic.panels import Weight
from airlight.reference.quadrature.integrate import (
    TERMS,
    ErrorKind,
    Paths,
    Terms,
    strongest,
    sum_stretches,
    sums_of,
)
from airlight.reference.quadrature.intervals import Pieces, Stretches, cut, whole
from airlight.reference.scene.varying import HeightMedium
from airlight.reference.visibility.planes import Rays

Array = NDArray[np.float64]
Index = NDArray[np.int64]


def fog_of(medium: HeightMedium) -> HeightFog:
    """Return the density of height fog."""
    layers = tuple(Layer(*layer) for layer in medium.layers)
    return HeightFog(layers, medium.constant, medium.clamped, medium.floor, medium.cap)


@dataclass(frozen=True)
class HeightField:
    """Height fog without sides; a field (`reference.quadrature.fields`)."""

    medium: HeightMedium

    @property
    def error_kind(self) -> ErrorKind:
        """The kind of the errors: the integrand is analytic on a piece, and the worse
        rule bounds the better one.
        """
        return "proven"

    @property
    def strongest(self) -> Array:
        """The most that a metre of a ray scatters, (3,) [1/m]."""
        return strongest(self.medium)

    def optical_depth(self, origin: Array, direction: Array, low: Array, high: Array) -> Array:
        """Return the optical depth of parts of straight lines, (n, 3) [1]."""
        start, rise = np.asarray(origin) @ self.medium.up, direction @ self.medium.up
        length = np.maximum(high - low, 0.0)
        depth = fog_of(self.medium).optical_depth(
            start + low * rise, start + low * rise + length * rise, length
        )
        return np.repeat(depth[:, None], 3, axis=1)

    def leave(self, origin: Array, direction: Array) -> Array:
        """Return the distance at which rays leave the fog for good, (n,) [m]:
        infinite on a level in it.
        """
        start, rise = origin @ self.medium.up, direction @ self.medium.up
        with np.errstate(divide="ignore", invalid="ignore"):
            ends = np.stack([(z - start) / rise for z in (self.medium.floor, self.medium.cap)])
        # A level ray stays in the fog for ever, or is never in it.
        level = np.where((start >= self.medium.floor) & (start <= self.medium.cap), np.inf, 0.0)
        return np.where(rise == 0, level, np.maximum(ends.max(axis=0), 0.0))

    def sums(
        self, rays: Rays, stretches: Stretches, distance: Array, terms: Terms = TERMS
    ) -> tuple[Array, Array]:
        """Return the airlight of each ray from its lit stretches, and a bound of
        its error, (rays, 3) each.
        """
        if not rays.w and (terms.profile is not None or terms.paths.length):
            return sum_stretches(
                rays,
                stretches,
                lambda lit: _SunIntegrand.of(self.medium, rays, lit, terms.paths),
                terms,
                rtol=1e-10,
                step=4096,
            )
        if rays.w:
            value, error = _of_places(self.medium, rays, stretches, terms)
        else:
            value, error = _of_suns(self.medium, rays, stretches, terms)
        factor, ray = self.medium.albedo / (4 * np.pi), stretches[0]
        value, error = (
            sums_of(ray, part[:, None] * factor, len(rays.foot)) for part in (value, error)
        )
        return value, error


def _of_places(
    medium: HeightMedium, rays: Rays, stretches: Stretches, terms: Terms
) -> tuple[Array, Array]:
    """Return sigma_t J of lit stretches and its error, (stretches,) [1/m^2]."""
    ray, x0, x1 = stretches
    fog = fog_of(medium)
    of_light = np.broadcast_to(rays.position, rays.direction.shape)[ray] @ medium.up
    # Fog depends on the height alone: the closed form needs the heights of origin and light, the
    # rise of the ray, and the place of the light about the ray.
    heights = HeightRays(
        np.broadcast_to(rays.origin @ medium.up, len(ray)),
        rays.direction[ray] @ medium.up,
        rays.foot[ray],
        rays.height[ray],
        of_light,
    )
    profile, law, paths = terms.profile, terms.law, terms.paths
    weight = None if profile is None else lambda x, row: profile(x, ray[row])
    if law is not None:
        weight = _with_law(weight, law, heights)
    # The relative tolerance of the integral of each stretch.
    value, error = height_fog_segments(
        fog,
        heights,
        x0,
        np.maximum(x0, x1),
        medium.phase,
        shadow_scale=terms.shadow_scale,
        weight=weight,
        rtol=terms.rtol or 1e-10,
        camera=paths.of_camera(ray),
        light=paths.light,
        length=paths.length,
    )
    # The uncertainty of an end is relative to its distance r from the light: the strip there is r
    # edge long, and r times the integrand, which has 1/r^2, gives 1/r.
    for x in (x0, x1):
        s = np.where(np.isfinite(x), x, rays.foot[ray]) - rays.foot[ray]
        r = np.maximum(np.hypot(rays.height[ray], s), np.finfo(np.float64).tiny)
        z = heights.origin + heights.rise * (heights.foot + s)
        depth = paths.of_camera(ray) * fog.optical_depth(heights.origin, z, heights.foot + s)
        if paths.light:
            depth = depth + paths.light * fog.optical_depth(z, of_light, r)
        if paths.length:
            depth = depth + paths.length * fog.density(z)
        with np.errstate(over="ignore"):
            strip = np.exp(fog.log_density(z) - depth) * medium.phase(-s / r) / r
        if weight is not None:  # of a spot, a fade or a law; a fade is above 1 before it begins
            strip = strip * weight((rays.foot[ray] + s)[:, None], np.arange(len(ray)))[:, 0]
        error = error + terms.edge * np.where(np.isfinite(x), strip, 0.0)
    return value, error


def _with_law(weight: Weight | None, law: Callable[[Array], Array], rays: HeightRays) -> Weight:
    """Return a weight of places along rays times a law of the distance from the light."""

    def weighted(x: Array, row: NDArray[np.int64]) -> Array:
        r = np.hypot(rays.height[row, None], x - rays.foot[row, None])
        return law(r) if weight is None else law(r) * weight(x, row)

    return weighted


def _of_suns(
    medium: HeightMedium, rays: Rays, stretches: Stretches, terms: Terms
) -> tuple[Array, Array]:
    """Return the light of lit stretches under suns of irradiance 1, in closed form, and its
    error, (stretches,) [1].
    """
    ray, x0, x1 = stretches
    fog = fog_of(medium)
    origin, rise = float(rays.origin @ medium.up), rays.direction[ray] @ medium.up
    # The rise of the way to the sun, one for all rays.
    mu = (
        float(np.broadcast_to(rays.position, rays.direction.shape)[0] @ medium.up)
        if len(rays.direction)
        else 1.0
    )
    phase, edge = medium.phase(rays.foot[ray]), np.broadcast_to(terms.edge, len(rays.foot))
    camera, light = terms.paths.of_camera(ray), terms.paths.light
    value = height_fog_sun(
        fog, origin, rise, x0, x1, sun=mu, phase=phase, camera=camera, light=light
    )
    error = np.zeros_like(value)
    for x in (x0, x1):
        # The strip at an end that is uncertain by `edge` [m]; at infinity there is no light.
        at = np.where(np.isfinite(x), x, 0.0)
        z = origin + rise * at
        depth = camera * fog.optical_depth(origin, z, at)
        if light:
            depth = depth + light * fog.unbounded(z, mu)
        with np.errstate(over="ignore"):
            f = np.exp(fog.log_density(z) - depth) * phase
        error += edge[ray] * np.where(np.isfinite(x), f, 0.0)
        # The exponent carries the rounding of its own size and of heights in scale heights: 64
        # roundings of a sum of optical depths, for a depth of 1. Beyond a depth of 745 the light
        # is zero in float64.
        rounding = 64 * np.finfo(np.float64).eps
        error += (
            rounding * value * (1 + np.where(np.isfinite(depth), np.minimum(depth, 745.0), 0.0))
        )
    return value, error


@dataclass(frozen=True)
class _SunIntegrand:
    """sigma_t exp(-tau) p along pieces under a sun; an `Integrand` of `integrate`."""

    medium: HeightMedium
    rays: Rays
    pieces: Pieces
    paths: Paths
    factor: Array  # the albedo, (pieces, 3)
    extinction: Array
    same: Index = field(default_factory=lambda: np.zeros(3, np.int64))
    densest: float = 0.0  #: such fog holds no bodies

    @staticmethod
    def of(
        medium: HeightMedium, rays: Rays, lit: Stretches, paths: Paths
    ) -> "_SunIntegrand | None":
        """Cut lit stretches at heights where the density has kinks, and every four scale heights;
        return None where no light arrives from them.
        """
        fog = fog_of(medium)
        lit = _until_dark(fog, medium, rays, lit, paths)
        if not len(lit[0]):
            return None
        # Beyond 64 scale heights on either side a layer is as good as nothing, or all is dark.
        steps = 4.0 * np.arange(-16, 17)
        layers = [layer.base + layer.scale_height * steps for layer in fog.layers]
        heights = np.concatenate([np.array(fog.kinks), *layers])
        ray = np.unique(lit[0])
        start, rise = float(rays.origin @ medium.up), rays.direction[ray] @ medium.up
        with np.errstate(divide="ignore", invalid="ignore"):
            places = (heights - start) / rise[:, None]  # a level ray crosses none
        row, column = np.nonzero(np.isfinite(places))
        pieces = cut(whole(lit), (ray[row], places[row, column]))
        count = len(pieces.ray)
        largest = np.full(count, float(np.max(medium.largest)))
        return _SunIntegrand(
            medium, rays, pieces, paths, np.ones((count, 3)) * medium.albedo, largest
        )

    def __call__(
        self, rows: Index, x: Array, inside: Array, r: Array, scatter: Array
    ) -> tuple[Array, Array]:
        medium, fog, ray = self.medium, fog_of(self.medium), self.pieces.ray[rows]
        start, mu = float(self.rays.origin @ medium.up), float(self.rays.position[0] @ medium.up)
        z = start + (self.rays.direction[ray] @ medium.up)[:, None] * x
        depth = self.paths.of_camera(ray)[:, None] * fog.optical_depth(start, z, x)
        if self.paths.light:
            depth = depth + self.paths.light * fog.unbounded(z, mu)
        if self.paths.length:
            depth = depth + self.paths.length * fog.density(z)
        value = np.exp(np.nan_to_num(fog.log_density(z) - depth, nan=-np.inf, neginf=-np.inf))
        return (value * medium.phase(scatter))[:, :, None], np.minimum(depth, 745.0)[:, :, None]


def _until_dark(
    fog: HeightFog, medium: HeightMedium, rays: Rays, lit: Stretches, paths: Paths
) -> Stretches:
    """Return stretches up to where the depth to the camera leaves no light in float64, or the ray
    has left all layers: a panel that is much longer would miss what is lit.
    """
    ray, x0, x1 = lit
    start, rise = float(rays.origin @ medium.up), rays.direction[ray] @ medium.up
    camera, powers = paths.of_camera(ray), np.array([[-14.0], [14.0]]) * np.ones(len(ray))
    # Halves of 28 decades of metres: 2^-24 of them is far finer than a panel.
    for _ in range(24):
        middle = powers.mean(axis=0)
        x = 10.0**middle
        is_dark = camera * fog.optical_depth(start, start + rise * x, x) > 745.0
        powers = np.where([~is_dark, is_dark], middle, powers)
    end = np.minimum(x1, 10.0 ** powers[1])
    if not fog.constant:
        top = max(layer.base + 64.0 * layer.scale_height for layer in fog.layers)
        with np.errstate(divide="ignore", invalid="ignore"):
            end = np.where(rise > 0, np.minimum(end, np.maximum((top - start) / rise, 0.0)), end)
    left = end > x0
    return ray[left], x0[left], end[left]
