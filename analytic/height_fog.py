# SPDX-License-Identifier: BSD-3-Clause
"""The airlight of media whose density depends on height alone: exponential
layers, as engines have them.

With the height z of a point, layers i and a constant, between a floor and a cap,
beyond which there is nothing,

    sigma_t(z) = sigma_0 + sum_i sigma_i exp(-(z - z_i)/H_i),     clamped: sigma_i exp(-max(z - z_i, 0)/H_i).

**Optical depth.** Along a segment of length l between the heights a <= b the layer's mean density
is closed: with u = (b - a)/H,

    (1/(b - a)) int_a^b exp(-(z - z_i)/H) dz = exp(-(a - z_i)/H) phi(u),      phi(u) = (1 - e^-u)/u,  phi(0) = 1.

The mean is taken from the lower end, where u >= 0: phi lies in (0, 1], its condition number is 1 at
most, and horizontal segments are no special case. From the upper end e^u would overflow where the
value is small. A ray up to infinity, dz > 0 the vertical component of its direction, has in a layer
the optical depth sigma_i H_i exp(-(z - z_i)/H_i)/dz.

**The sun.** Let E(x) = tau(o, x) + tau(x, sun), and mu > 0 the vertical component of the direction
to the sun. tau(x, sun) = (1/mu) int_z^cap sigma_t dz, hence dE/dx = sigma_t (1 - dz/mu) in any
medium of height alone: over an interval (a, b)

    K = int sigma_t p exp(-E) dx = p(cos) exp(-E(a)) tau(a,b) phi(q),     q = (1 - dz/mu) tau(a,b),

and for q < 0, from the other end, p(cos) exp(-E(b)) tau(a,b) phi(-q). With a fraction a of the
depth from the camera and b of that to the sun, dE/dx = sigma_t (a - b dz/mu), and so is q. This is
the result of plane-parallel single scattering (Chandrasekhar 1960). An unbounded interval that goes
down or level has an infinite tau(a,b), for which tau phi(q) is 1/(1 - dz/mu).

**Lights at places.** In w = asinh((x - foot)/h), r = h cosh w,

    K = int sigma_t(z) exp(-tau(o,x) - tau(x,light)) p(-tanh w)/r dw    [1/m^2].

Light and phase function keep their singularities at |Im w| = pi/2 (`analytic.panels`); the density
adds none, but turns the exponent by Im z/H. Panels are therefore 2.4 wide at most, and span a few
scale heights at most. Integrands have kinks where a ray crosses the base of a clamped layer:
intervals are cut there, and at floor and cap.

The radiance is albedo I K/(4 pi) of a light of intensity I, and albedo E K/(4 pi)
of a sun of irradiance E.
"""

from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from airlight.analytic.kronrod import WIDE
from airlight.analytic.panels import (
    Panels,
    Weight,
    adapted,
    cut_at_kinks,
    equal_panels,
    log_distance,
)
from airlight.analytic.phase import PhaseFunction
from airlight.errors import InputError

Array = NDArray[np.float64]
Index = NDArray[np.int64]


@dataclass(frozen=True)
class Layer:
    """A layer of exponential height fog."""

    sigma_t: float  #: extinction at the base [1/m]
    base: float  #: z_i [m]
    scale_height: float  #: H_i, after which the density has fallen to 1/e [m]


@dataclass(frozen=True)
class HeightFog:
    """A density that depends on height alone.

    Parameters
    ----------
    layers
        Exponential layers.
    constant
        Extinction everywhere between floor and cap [1/m].
    clamped
        Whether layers are constant below their base.
    floor, cap
        Heights beyond which there is nothing [m]; may be infinite.

    Raises
    ------
    InputError
        For a negative extinction, a scale height that is not positive, or a cap below the floor.
    """

    layers: tuple[Layer, ...] = ()
    constant: float = 0.0
    clamped: bool = False
    floor: float = -np.inf
    cap: float = np.inf

    def __post_init__(self):
        # A layer of extinction 0 counts for nothing; a scale height is divided by.
        for layer in self.layers:
            if not (np.isfinite(layer.sigma_t) and layer.sigma_t >= 0 and np.isfinite(layer.base)):
                raise InputError(
                    f"height fog: a layer has {layer}; expected finite numbers, an extinction of 0 "
                    "or more"
                )
            if not 0 < layer.scale_height < np.inf:
                raise InputError(
                    f"height fog: a layer has the scale height {layer.scale_height}; expected one "
                    "above 0 m"
                )
        if not 0 <= self.constant < np.inf:
            raise InputError(
                f"height fog: its constant part is {self.constant}; expected an extinction of 0 or "
                "more"
            )
        if not self.floor < self.cap:
            raise InputError(
                f"height fog: its cap is at {self.cap} m and its floor at {self.floor} m; expected "
                "it above"
            )

    @property
    def kinks(self) -> tuple[float, ...]:
        """Heights at which the density is not smooth [m]."""
        bases = [layer.base for layer in self.layers if layer.sigma_t > 0] if self.clamped else []
        return tuple(z for z in (self.floor, self.cap, *bases) if np.isfinite(z))

    def log_density(self, z: ArrayLike) -> Array:
        """Return the logarithm of the extinction [1/m] at heights [m], -inf where there is none.

        The density itself may overflow where the light is long gone.
        """
        z = np.asarray(z, dtype=np.float64)
        total = np.full(z.shape, np.log(self.constant) if self.constant > 0 else -np.inf)
        for layer in self.layers:
            if layer.sigma_t > 0:
                above = z - layer.base
                # The logarithm of a sum of exponentials, each of which may overflow below its base.
                total = np.logaddexp(
                    total,
                    np.log(layer.sigma_t)
                    - (np.maximum(above, 0) if self.clamped else above) / layer.scale_height,
                )
        return np.where((z >= self.floor) & (z <= self.cap), total, -np.inf)

    def density(self, z: ArrayLike) -> Array:
        """Return the extinction [1/m] at heights [m]."""
        with np.errstate(over="ignore"):
            return np.exp(self.log_density(z))

    def optical_depth(self, start: ArrayLike, end: ArrayLike, length: ArrayLike) -> Array:
        """Return the optical depth of segments between two heights, of a length,
        arrays that broadcast [m].
        """
        start, end, length = np.broadcast_arrays(
            *(np.asarray(v, dtype=np.float64) for v in (start, end, length))
        )
        # The mean density is taken from the lower end, whichever way the segment goes.
        low, high = np.minimum(start, end), np.maximum(start, end)
        a, b = np.clip(low, self.floor, self.cap), np.clip(high, self.floor, self.cap)
        with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
            # A level segment is in the fog as a whole or not at all; the fog holds the part of any
            # other segment between floor and cap.
            inside = np.where(
                high > low, (b - a) / (high - low), (low >= self.floor) & (low <= self.cap)
            )
            # Segments that nothing cuts keep their length to the last digit.
            within = np.where((a == low) & (b == high), length, length * inside)
            tau = self._mean(a, b) * within
        # Where a segment has no length in the fog, the mean density there may be infinite.
        return np.where(within > 0, tau, 0.0)

    def column(self, z: ArrayLike) -> Array:
        """Return the optical depth straight up from heights [m]; infinite for a
        constant part without a cap.
        """
        z = np.clip(np.asarray(z, dtype=np.float64), self.floor, self.cap)
        with np.errstate(over="ignore", invalid="ignore"):
            # Infinite without a cap: the column of the constant part has no end.
            total = self.constant * (self.cap - z) if self.constant > 0 else np.zeros_like(z)
            for layer in self.layers:
                if layer.sigma_t == 0:
                    continue
                # A clamped layer is constant over the length `below` and exponential from `from_z`
                # on.
                from_z, below = z, np.zeros_like(z)
                if self.clamped:
                    below = np.minimum(np.maximum(layer.base - z, 0.0), self.cap - z)
                    from_z = np.maximum(z, min(layer.base, self.cap))
                # int_{from_z}^{cap} exp(-(z - z_i)/H) dz = H exp(up) (1 - exp(-(cap - from_z)/H)).
                up = (layer.base - from_z) / layer.scale_height
                # A clamped layer is at most as dense as at its base, which may lie above the cap.
                up = np.minimum(up, 0) if self.clamped else up
                shallow = -np.expm1((from_z - self.cap) / layer.scale_height)
                total = total + layer.sigma_t * (below + layer.scale_height * np.exp(up) * shallow)
        return np.asarray(total)

    def along(self, start: ArrayLike, end: ArrayLike, length: ArrayLike, rise: ArrayLike) -> Array:
        """Return the optical depth of segments that may have no end; `rise`: vertical
        components of unit directions.
        """
        start, end, length, rise = np.broadcast_arrays(
            *(np.asarray(v, dtype=np.float64) for v in (start, end, length, rise))
        )
        # Segments without end are computed as segments of no length, and then replaced.
        unbounded = np.isinf(length)
        finite = self.optical_depth(
            start, np.where(unbounded, start, end), np.where(unbounded, 0.0, length)
        )
        return np.where(unbounded, self.unbounded(start, rise), finite)

    def unbounded(self, z: ArrayLike, rise: ArrayLike) -> Array:
        """Return the optical depth of rays without end from heights [m]; `rise`:
        vertical, of unit directions.
        """
        z, rise = np.broadcast_arrays(
            np.asarray(z, dtype=np.float64), np.asarray(rise, dtype=np.float64)
        )
        with np.errstate(divide="ignore", invalid="ignore"):
            # The column of a slanted ray is longer by the inverse of its vertical component.
            sloped = np.where(rise > 0, self.column(z), self._below(z)) / np.abs(rise)
        # A level ray never leaves its height.
        return np.where(rise == 0, np.where(self.log_density(z) > -np.inf, np.inf, 0.0), sloped)

    def _below(self, z: Array) -> Array:
        """Return the optical depth straight down from heights [m]; infinite without a floor."""
        # Every layer goes on downwards: the column is infinite where there is any density.
        if np.isinf(self.floor):
            return np.full(
                z.shape,
                np.inf if self.constant or any(layer.sigma_t for layer in self.layers) else 0.0,
            )
        within = np.clip(z, self.floor, self.cap)
        return self.optical_depth(self.floor, within, within - self.floor)

    def _mean(self, low: Array, high: Array) -> Array:
        """Return the mean density between two heights, low <= high, within floor and cap [1/m]."""
        rise = high - low
        total = np.full(np.shape(low), self.constant)
        for layer in self.layers:
            if layer.sigma_t == 0:
                continue
            scale = layer.scale_height
            # The closed mean of the module docstring, from the lower end.
            if not self.clamped:
                total += layer.sigma_t * np.exp((layer.base - low) / scale) * phi(rise / scale)
                continue
            # The fraction of the rise that lies below the base, where a clamped layer has its full
            # extinction: for level segments all or nothing, for a base at infinity all.
            below = np.clip(layer.base - low, 0.0, rise)
            part = np.where(rise > 0, below / np.where(rise > 0, rise, 1.0), low < layer.base)
            part = np.where(np.isinf(below), 1.0, part)
            # The exponential part begins at the base, or at the lower end if that is higher.
            start = np.maximum(low, layer.base)
            above = np.exp((layer.base - start) / scale) * phi(
                np.maximum(high - start, 0.0) / scale
            )
            total += layer.sigma_t * (part + (1 - part) * above)
        return total


def phi(u: ArrayLike) -> Array:
    """Return (1 - e^-u)/u [1], 1 at u = 0, for u >= 0, to 2 ulp."""
    u = np.asarray(u, dtype=np.float64)
    # expm1 loses nothing for small u; 0/0 is the limit 1.
    safe = np.where(u == 0, 1.0, u)
    return np.where(u == 0, 1.0, -np.expm1(-safe) / safe)


@dataclass(frozen=True)
class HeightRays:
    """Rays over a light: arrays of shape (n,), or numbers that all share."""

    origin: Array  #: height of the origin [m]
    rise: Array  #: vertical component of the unit direction
    foot: Array  #: distance along the ray of the foot of the perpendicular from the light [m]
    height: Array  #: distance of the light from the ray [m]
    light: Array  #: height of the light [m]


def height_fog_sun(
    fog: HeightFog,
    origin: ArrayLike,
    rise: ArrayLike,
    x0: ArrayLike,
    x1: ArrayLike,
    *,
    sun: float,
    phase: ArrayLike,
    camera: ArrayLike = 1.0,
    light: float = 1.0,
) -> Array:
    """Return K of intervals of rays that the sun lights, in closed form [1].

    `fog`: the medium; `origin`, `rise`: height of the origin of each ray [m], and vertical
    component of its unit direction, (n,); `x0`, `x1`: ends of the intervals along the rays [m],
    x0 <= x1; x1 may be infinite; `sun`: vertical component of the unit direction towards the sun,
    above 0, or below 0 where the fog has a floor: the same holds with the column below; `phase`:
    value of the phase function along each ray, (n,); `camera`, `light`: the fractions of the depths
    from the camera, (n,), and to the sun that attenuate. Raises InputError, where the way to the sun
    attenuates, for a sun at the horizon, one below it without a floor, and a constant part without
    a cap: every light path is infinitely deep.
    """
    if light and (not -1 <= sun <= 1 or sun == 0 or (sun < 0 and np.isinf(fog.floor))):
        raise InputError(
            f"the sun's direction has the vertical component {sun:g}: at or below the horizon each "
            "of its light paths "
            "through fog without a floor is infinitely deep; expected a sun above the horizon"
        )
    if light and fog.constant > 0 and sun > 0 and np.isinf(fog.cap):
        raise InputError(
            "height fog with a constant part has no cap: each light path of the sun is infinitely "
            "deep; expected a "
            "cap, or no constant part"
        )
    origin, rise, x0, x1, p, camera = np.broadcast_arrays(
        *(np.asarray(v, dtype=np.float64) for v in (origin, rise, x0, x1, phase, camera))
    )
    # Infinite ends and level rays divide by 0 in lanes that are not selected.
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        to_floor, to_cap = (fog.floor - origin) / rise, (fog.cap - origin) / rise
        # The distances at which a ray enters the layer between floor and cap and leaves it; a level
        # ray is in it everywhere or nowhere.
        level = rise == 0
        outside = level & ((origin < fog.floor) | (origin > fog.cap))
        enter = np.where(level, -np.inf, np.minimum(to_floor, to_cap))
        leave = np.where(level, np.inf, np.maximum(to_floor, to_cap))
        # The part (a, b) of the interval in the fog. Where nothing is in it, both ends are one,
        # also at infinity.
        a = np.maximum(x0, enter)
        b = np.maximum(np.where(outside, a, np.minimum(x1, leave)), a)
        b = np.where(np.isinf(a), a, b)
        # The heights of both ends; a level ray keeps the height of its origin, as 0 times infinity
        # is none.
        za, zb = (origin + np.where(level, 0.0, rise * x) for x in (a, b))
        tau = np.where(b > a, fog.along(za, zb, b - a, rise), 0.0)
        # E(a) and E(b). A ray that goes up without end has nothing above it at b.
        depth_at_a = camera * fog.optical_depth(origin, za, a)
        depth_at_b = camera * fog.along(origin, zb, b, rise)
        # dE/dx = bend sigma_t, and q of the derivation.
        bend = camera
        if light:
            depth_at_a = depth_at_a + light * fog.unbounded(za, sun)
            above = np.where(np.isinf(zb) & (rise > 0), 0.0, fog.unbounded(zb, sun))
            depth_at_b = depth_at_b + light * above
            bend = bend - light * (rise / sun)
        q = bend * tau
        # From the end where E is smaller, so that phi has an argument of at least 0. An infinite
        # tau has the limit 1/bend.
        from_a = np.exp(-depth_at_a) * np.where(
            np.isinf(tau), 1 / bend, tau * phi(np.where(np.isinf(q), 0.0, np.abs(q)))
        )
        from_b = np.exp(-depth_at_b) * tau * phi(np.abs(q))
        value = np.where(q >= 0, from_a, from_b)
    return np.where((b > a) & (tau > 0), p * value, 0.0)


def height_fog_segments(
    fog: HeightFog,
    rays: HeightRays,
    x0: ArrayLike,
    x1: ArrayLike,
    phase: PhaseFunction,
    *,
    shadow_scale: float = 1.0,
    weight: Weight | None = None,
    rtol: float = 1e-10,
    camera: ArrayLike = 1.0,
    light: float = 1.0,
    length: float = 0.0,
) -> tuple[Array, Array]:
    """Integrate the airlight of lights at places over N intervals of rays.

    `fog`, `rays`: the medium and the rays, each over a light; `x0`, `x1`: ends of the intervals
    along the rays [m], x0 <= x1; x1 may be infinite; `phase`, `shadow_scale`, `weight`, `rtol`: as
    in `analytic.panels.airlight_segments`; `shadow_scale` shortens the light path at the light;
    `camera`, `light`: the fractions of the depths from the camera, (N,), and from the light that
    attenuate; `length`: of a further path with the extinction at the point [m].
    Returns `value`, `error`: K [1/m^2] and an estimate of its absolute error, of shape (N,); both
    infinite where the light is on an interval.
    """
    # Columns 0 to 4 are the fields of `HeightRays`, 5 and 6 the ends of the intervals, 7 the
    # fraction of the depth from the camera.
    columns = np.broadcast_arrays(
        *(
            np.asarray(v, dtype=np.float64)
            for v in (rays.origin, rays.rise, rays.foot, rays.height, rays.light, x0, x1, camera)
        )
    )
    columns = tuple(np.atleast_1d(column) for column in columns)
    count = len(columns[0])
    # The integral diverges where the light lies on the interval, and in fog; 1/height would
    # overflow below this height [m].
    through = (
        (columns[3] < 1e-290)
        & (columns[5] <= columns[2])
        & (columns[2] <= columns[6])
        & (columns[5] < columns[6])
    )
    through &= np.isfinite(fog.log_density(columns[4]))
    # Parts on which the density is smooth; an interval has several, or none where it misses the
    # fog.
    owner, low, high = _smooth_parts(fog, columns[0], columns[1], columns[5], columns[6])
    mask = ~through[owner]
    owner, low, high = owner[mask], low[mask], high[mask]
    # Each part has the ray of its interval.
    rows = HeightRays(*(column[owner] for column in columns[:5]))
    start, _, width, height = log_distance(rows.foot, rows.height, low, high)
    # 60 beyond the foot in w, 1/cosh w has fallen to 1e-26: unbounded parts end there.
    unbounded = np.maximum(-start, 0.0) + 60.0
    paths = _Paths(shadow_scale, columns[7][owner], light, length)
    parts = _Parts(fog, rows, owner, start, np.minimum(width, unbounded), height, paths)
    evaluate = partial(_evaluate, parts, phase, weight)
    # Panels belong to parts, and parts to intervals, whose sums meet the tolerance.
    value, error = adapted(_first_panels(parts, phase.kinks), evaluate, owner, count, rtol)
    value[through] = error[through] = np.inf
    return value, error


@dataclass(frozen=True)
class _Paths:
    """The parts of the paths that attenuate: see `height_fog_segments`."""

    shadow_scale: float
    camera: Array  # of each part
    light: float
    length: float


@dataclass(frozen=True)
class _Parts:
    """Smooth parts of intervals, in w, arrays of shape (m,)."""

    fog: HeightFog
    rays: HeightRays
    owner: Index  #: number of the interval
    start: Array  #: w0
    width: Array  #: w1 - w0
    height: Array  #: of the light over the ray, above 0 [m]
    paths: _Paths

    def heights(self, part: Index, w: Array) -> tuple[Array, Array]:
        """Return distances from the foot and heights at places in w of
        parts, (k, nodes) each [m].
        """
        with np.errstate(over="ignore"):
            s = self.height[part, None] * np.sinh(w)
        x = self.rays.foot[part, None] + s
        return s, self.rays.origin[part, None] + self.rays.rise[part, None] * x


def _smooth_parts(
    fog: HeightFog, origin: Array, rise: Array, x0: Array, x1: Array
) -> tuple[Index, Array, Array]:
    """Cut intervals where rays cross heights at which the density has kinks; leave out what
    is beyond floor and cap.
    """
    owner, low, high = np.arange(len(x0)), x0, x1
    # Each height cuts every part in two, so that parts double; those without length are dropped.
    for z in fog.kinks:
        # A level ray never crosses the height: 0/0 and infinities go to an end, where they cut
        # nothing.
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            cut = np.nan_to_num((z - origin) / rise, nan=-np.inf, posinf=np.inf, neginf=-np.inf)
        cut = np.clip(cut[owner], low, high)
        owner, low, high = (
            np.tile(owner, 2),
            np.concatenate([low, cut]),
            np.concatenate([cut, high]),
        )
        mask = low < high
        owner, low, high = owner[mask], low[mask], high[mask]
    # A part lies between floor and cap as a whole or not at all: one point decides, on unbounded
    # parts a point somewhat beyond the start.
    middle = np.where(np.isinf(high), low + 1.0 + np.abs(low), 0.5 * (low + high))
    inside = np.isfinite(fog.log_density(origin[owner] + rise[owner] * middle)) & (low < high)
    return owner[inside], low[inside], high[inside]


def _first_panels(parts: _Parts, kinks: Array) -> tuple[Index, Array, Array]:
    """Cut parts at the kinks of the phase function, and into panels that are narrow
    enough in w and in height.
    """
    # Light and phase function have the singularities of `analytic.panels`, and need its width.
    widest = 2.4
    part, start, width = cut_at_kinks(parts.start, parts.width, kinks)
    part, start, width = equal_panels(part, start, width, np.maximum(np.ceil(width / widest), 1))
    # Heights at both ends of every panel.
    span = np.stack([start, start + width], axis=1) + parts.start[part, None]
    _, z = parts.heights(part, span)
    least = min(
        (layer.scale_height for layer in parts.fog.layers if layer.sigma_t > 0), default=np.inf
    )
    # The density turns the exponent by Im z/H, so that a panel spans four scale heights at most.
    # Intervals that would need more panels than `most` leave the rest to the halving of `adapted`.
    scale_heights, most = 4.0, 4096
    count = np.ceil(np.abs(z[:, 1] - z[:, 0]) / (scale_heights * least))
    return equal_panels(part, start, width, np.clip(np.nan_to_num(count, posinf=most), 1, most))


def _evaluate(
    parts: _Parts,
    phase: PhaseFunction,
    weight: Weight | None,
    part: Index,
    start: Array,
    width: Array,
) -> Panels:
    """Integrate panels of parts by both rules."""
    chunk = 4096  # panels evaluated at once
    integrals, noise = np.empty((len(part), 2)), np.empty(len(part))
    for first in range(0, len(part), chunk):
        block = slice(first, first + chunk)
        integrals[block], noise[block] = _evaluate_block(
            parts, phase, weight, part[block], start[block], width[block]
        )
    return Panels(
        part,
        start,
        width,
        integrals[:, 0],
        np.abs(integrals[:, 0] - integrals[:, 1]),
        noise * np.abs(integrals[:, 0]),
    )


def _evaluate_block(
    parts: _Parts,
    phase: PhaseFunction,
    weight: Weight | None,
    part: Index,
    start: Array,
    width: Array,
) -> tuple[Array, Array]:
    fog, rays = (
        parts.fog,
        HeightRays(*(getattr(parts.rays, name)[part, None] for name in HeightRays.__annotations__)),
    )
    # The nodes in w, and for each the distance s from the foot, the height z and the distance x
    # along the ray, which rounding may leave below 0 at the camera.
    half = 0.5 * width[:, None]
    w = (parts.start[part] + start)[:, None] + half + half * WIDE.nodes
    s, z = parts.heights(part, w)
    x = np.maximum(rays.foot + s, 0.0)
    # r = h cosh w, from e^|w|, which the phase function needs as well.
    growth = np.exp(np.abs(w))
    cosh = 0.5 * (growth + 1 / growth)
    r = parts.height[part, None] * cosh
    # The light path counts over the fraction `shadow_scale` of its length, next to the point.
    paths = parts.paths
    near = z + paths.shadow_scale * (rays.light - z)
    # sigma_t exp(-depth)/r by the sum of logarithms: both factors may leave the range of numbers
    # where their product does not. Infinite depths leave no light.
    with np.errstate(invalid="ignore", over="ignore"):
        depth = paths.camera[part, None] * fog.optical_depth(rays.origin, z, x)
        if paths.light:
            depth += paths.light * fog.optical_depth(z, near, paths.shadow_scale * r)
        if paths.length:
            depth += paths.length * fog.density(z)
        f = np.exp(np.nan_to_num(fog.log_density(z) - depth, nan=-np.inf, neginf=-np.inf)) / r
    if not phase.is_constant:
        # cos = -tanh w: (1 + |cos|)/2 = e^|w|/(2 cosh w) and (1 - |cos|)/2 = e^-|w|/(2 cosh w).
        # Beyond the foot, w > 0, light is scattered backwards.
        behind, ahead = growth / (2 * cosh), 1 / (2 * cosh * growth)
        f *= phase.from_half(np.where(w > 0, behind, ahead), np.where(w > 0, ahead, behind))
    if weight is not None:
        f *= weight(x, parts.owner[part])
    middle = WIDE.nodes.size // 2
    # The rounding error in units of epsilon, at the middle node. The exponent counts with its size.
    # A height is exact to epsilon of its size; in scale heights that is a relative error of the
    # density, and of the depth as often as the depth counts.
    size = 16 + 4 * np.minimum(depth[:, middle], 745.0) + np.abs(w[:, middle])
    for layer in fog.layers:
        if layer.sigma_t > 0:
            reach = np.maximum(np.abs(z[:, middle]), abs(layer.base)) / layer.scale_height
            size += np.minimum(reach, 1e6) * (1 + np.minimum(depth[:, middle], 745.0))
    return (f @ WIDE.weights) * half, np.finfo(np.float64).eps * size
