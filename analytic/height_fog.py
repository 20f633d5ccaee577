# SPDX-License-Identifier: BSD-3-Clause
"""The airlight of media whose density depends on height alone: exponential
layers, as engines have them.

With the height z of a point, layers i and a constant, between a floor and a cap,
beyond which there is nothing,

    sigma_t(z) = sigma_0 + sum_i sigma_i exp(-(z - z_i)/H_i),     clamped: sigma_i exp(-max(z - z_i, 0)/H_i).

**Optical depth.** Along a segment of length l between the heights a <= b the layer's mean density
is closed: with u = (b - a)/H,

    (1/(b - a)) int_a^b exp(-(z - z_i)/H) dz = exp(-(a - z_i)/H) phi(u),      phi(u) = (1 - e^-u)/u,  phi(0) = 1.

From the lower end u >= 0: phi lies in (0, 1], its condition number is 1 at most, and horizontal
segments are no special case. From the upper end e^u would overflow where the value is small. Up to
infinity, dz > 0 the vertical component of a direction, a layer gives sigma_i H_i exp(-(z -
z_i)/H_i)/dz.

**The sun.** Let E(x) = tau(o, x) + tau(x, sun), mu > 0 the height of the sun (the vertical
component of the direction to it). Since tau(x, sun) = (1/mu) int_z^cap sigma_t dz, dE/dx = sigma_t
(1 - dz/mu) in any medium of height alone: over an interval (a, b)

    K = int sigma_t p exp(-E) dx = p(cos) exp(-E(a)) tau(a,b) phi(q),     q = (1 - dz/mu) tau(a,b),

and from the other end, exp(-E(b)) tau(a,b) phi(-q), for q < 0. This is the result of plane-parallel
single scattering (Chandrasekhar 1960). For an interval without end that goes down or level,
tau(a,b) is infinite and tau phi(q) is 1/(1 - dz/mu).

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

_WIDEST = 2.4  # of the first panels, in w
_SCALE_HEIGHTS = 4.0  # that a first panel spans at most
_MOST = 4096  # first panels of an interval
_CHUNK = 4096  # panels evaluated at once
_UNBOUNDED = 60.0  # beyond the foot in w: 1/cosh w has fallen to 1e-26


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
        low, high = np.minimum(start, end), np.maximum(start, end)
        a, b = np.clip(low, self.floor, self.cap), np.clip(high, self.floor, self.cap)
        with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
            # A level segment is in the fog or it is not; of others the part
            # between floor and cap is.
            inside = np.where(
                high > low, (b - a) / (high - low), (low >= self.floor) & (low <= self.cap)
            )
            within = np.where((a == low) & (b == high), length, length * inside)
            tau = self._mean(a, b) * within
        return np.where(within > 0, tau, 0.0)

    def column(self, z: ArrayLike) -> Array:
        """Return the optical depth straight up from heights [m]; infinite for a
        constant part without a cap.
        """
        z = np.clip(np.asarray(z, dtype=np.float64), self.floor, self.cap)
        with np.errstate(over="ignore", invalid="ignore"):
            total = self.constant * (self.cap - z) if self.constant > 0 else np.zeros_like(z)
            for layer in self.layers:
                if layer.sigma_t == 0:
                    continue
                from_z, below = z, np.zeros_like(z)
                if self.clamped:
                    below = np.minimum(np.maximum(layer.base - z, 0.0), self.cap - z)
                    from_z = np.maximum(z, min(layer.base, self.cap))
                up = (layer.base - from_z) / layer.scale_height
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
            sloped = np.where(rise > 0, self.column(z), self._below(z)) / np.abs(rise)
        return np.where(rise == 0, np.where(self.log_density(z) > -np.inf, np.inf, 0.0), sloped)

    def _below(self, z: Array) -> Array:
        """Return the optical depth straight down from heights [m]; infinite without a floor."""
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
            if not self.clamped:
                total += layer.sigma_t * np.exp((layer.base - low) / scale) * phi(rise / scale)
                continue
            below = np.clip(layer.base - low, 0.0, rise)
            part = np.where(rise > 0, below / np.where(rise > 0, rise, 1.0), low < layer.base)
            part = np.where(np.isinf(below), 1.0, part)
            start = np.maximum(low, layer.base)
            above = np.exp((layer.base - start) / scale) * phi(
                np.maximum(high - start, 0.0) / scale
            )
            total += layer.sigma_t * (part + (1 - part) * above)
        return total


def phi(u: ArrayLike) -> Array:
    """Return (1 - e^-u)/u [1], 1 at u = 0, for u >= 0, to 2 ulp."""
    u = np.asarray(u, dtype=np.float64)
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
) -> Array:
    """Return K of intervals of rays that the sun lights, in closed form [1].

    `fog`: the medium; `origin`, `rise`: height of the origin of each ray [m], and vertical
    component of its unit direction, (n,); `x0`, `x1`: ends of the intervals along the rays [m],
    x0 <= x1; x1 may be infinite; `sun`: vertical component of the unit direction towards the sun,
    above 0, or below 0 where the fog has a floor: the same holds with the column below; `phase`:
    value of the phase function along each ray, (n,). Raises InputError for a sun at the horizon,
    one below it without a floor, and a constant part without a cap: every light path is infinitely
    deep.
    """
    if not -1 <= sun <= 1 or sun == 0 or (sun < 0 and np.isinf(fog.floor)):
        raise InputError(
            f"the sun's direction has the vertical component {sun:g}: at or below the horizon each "
            "of its light paths "
            "through fog without a floor is infinitely deep; expected a sun above the horizon"
        )
    if fog.constant > 0 and sun > 0 and np.isinf(fog.cap):
        raise InputError(
            "height fog with a constant part has no cap: each light path of the sun is infinitely "
            "deep; expected a "
            "cap, or no constant part"
        )
    origin, rise, x0, x1, p = np.broadcast_arrays(
        *(np.asarray(v, dtype=np.float64) for v in (origin, rise, x0, x1, phase))
    )
    # Where floor and cap leave nothing of an interval, both ends are one.
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        to_floor, to_cap = (fog.floor - origin) / rise, (fog.cap - origin) / rise
        level = rise == 0
        outside = level & ((origin < fog.floor) | (origin > fog.cap))
        enter = np.where(level, -np.inf, np.minimum(to_floor, to_cap))
        leave = np.where(level, np.inf, np.maximum(to_floor, to_cap))
        a = np.maximum(x0, enter)
        b = np.maximum(np.where(outside, a, np.minimum(x1, leave)), a)
        b = np.where(np.isinf(a), a, b)
        za, zb = (origin + np.where(level, 0.0, rise * x) for x in (a, b))
        tau = np.where(b > a, fog.along(za, zb, b - a, rise), 0.0)
        first = fog.optical_depth(origin, za, a) + fog.unbounded(za, sun)
        last = fog.along(origin, zb, b, rise) + np.where(
            np.isinf(zb) & (rise > 0), 0.0, fog.unbounded(zb, sun)
        )
        bend = 1 - rise / sun
        q = bend * tau
        from_first = np.exp(-first) * np.where(
            np.isinf(tau), 1 / bend, tau * phi(np.where(np.isinf(q), 0.0, np.abs(q)))
        )
        from_last = np.exp(-last) * tau * phi(np.abs(q))
        value = np.where(q >= 0, from_first, from_last)
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
) -> tuple[Array, Array]:
    """Integrate the airlight of lights at places over N intervals of rays.

    `fog`, `rays`: the medium and the rays, each over a light; `x0`, `x1`: ends of the intervals
    along the rays [m], x0 <= x1; x1 may be infinite; `phase`, `shadow_scale`, `weight`, `rtol`: as
    in `analytic.panels.airlight_segments`; `shadow_scale` shortens the light path at the light.
    Returns `value`, `error`: K [1/m^2] and an estimate of its absolute error, of shape (N,); both
    infinite where the light is on an interval.
    """
    columns = np.broadcast_arrays(
        *(
            np.asarray(v, dtype=np.float64)
            for v in (rays.origin, rays.rise, rays.foot, rays.height, rays.light, x0, x1)
        )
    )
    columns = tuple(np.atleast_1d(column) for column in columns)
    count = len(columns[0])
    through = (
        (columns[3] < 1e-290)
        & (columns[5] <= columns[2])
        & (columns[2] <= columns[6])
        & (columns[5] < columns[6])
    )
    through &= np.isfinite(fog.log_density(columns[4]))
    owner, low, high = _smooth_parts(fog, columns[0], columns[1], columns[5], columns[6])
    keep = ~through[owner]
    owner, low, high = owner[keep], low[keep], high[keep]
    rows = HeightRays(*(column[owner] for column in columns[:5]))
    start, _, width, height = log_distance(rows.foot, rows.height, low, high)
    unbounded = np.maximum(-start, 0.0) + _UNBOUNDED
    parts = _Parts(fog, rows, owner, start, np.minimum(width, unbounded), height)
    evaluate = partial(_evaluate, parts, phase, shadow_scale, weight)
    value, error = adapted(_first_panels(parts, phase.kinks), evaluate, owner, count, rtol)
    value[through] = error[through] = np.inf
    return value, error


@dataclass(frozen=True)
class _Parts:
    """Smooth parts of intervals, in w, arrays of shape (m,)."""

    fog: HeightFog
    rays: HeightRays
    owner: Index  #: number of the interval
    start: Array  #: w0
    width: Array  #: w1 - w0
    height: Array  #: of the light over the ray, above 0 [m]

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
    for z in fog.kinks:
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            cut = np.nan_to_num((z - origin) / rise, nan=-np.inf, posinf=np.inf, neginf=-np.inf)
        cut = np.clip(cut[owner], low, high)
        owner, low, high = (
            np.tile(owner, 2),
            np.concatenate([low, cut]),
            np.concatenate([cut, high]),
        )
        keep = low < high
        owner, low, high = owner[keep], low[keep], high[keep]
    middle = np.where(np.isinf(high), low + 1.0 + np.abs(low), 0.5 * (low + high))
    inside = np.isfinite(fog.log_density(origin[owner] + rise[owner] * middle)) & (low < high)
    return owner[inside], low[inside], high[inside]


def _first_panels(parts: _Parts, kinks: Array) -> tuple[Index, Array, Array]:
    """Cut parts at the kinks of the phase function, and into panels that are narrow
    enough in w and in height.
    """
    part, start, width = cut_at_kinks(parts.start, parts.width, kinks)
    part, start, width = equal_panels(part, start, width, np.maximum(np.ceil(width / _WIDEST), 1))
    span = np.stack([start, start + width], axis=1) + parts.start[part, None]
    _, z = parts.heights(part, span)
    least = min(
        (layer.scale_height for layer in parts.fog.layers if layer.sigma_t > 0), default=np.inf
    )
    count = np.ceil(np.abs(z[:, 1] - z[:, 0]) / (_SCALE_HEIGHTS * least))
    return equal_panels(part, start, width, np.clip(np.nan_to_num(count, posinf=_MOST), 1, _MOST))


def _evaluate(
    parts: _Parts,
    phase: PhaseFunction,
    shadow_scale: float,
    weight: Weight | None,
    part: Index,
    start: Array,
    width: Array,
) -> Panels:
    """Integrate panels of parts by both rules."""
    both, noise = np.empty((len(part), 2)), np.empty(len(part))
    for first in range(0, len(part), _CHUNK):
        block = slice(first, first + _CHUNK)
        both[block], noise[block] = _evaluate_block(
            parts, phase, shadow_scale, weight, part[block], start[block], width[block]
        )
    return Panels(
        part, start, width, both[:, 0], np.abs(both[:, 0] - both[:, 1]), noise * np.abs(both[:, 0])
    )


def _evaluate_block(
    parts: _Parts,
    phase: PhaseFunction,
    shadow_scale: float,
    weight: Weight | None,
    part: Index,
    start: Array,
    width: Array,
) -> tuple[Array, Array]:
    fog, rays = (
        parts.fog,
        HeightRays(*(getattr(parts.rays, name)[part, None] for name in HeightRays.__annotations__)),
    )
    half = 0.5 * width[:, None]
    w = (parts.start[part] + start)[:, None] + half + half * WIDE.nodes
    s, z = parts.heights(part, w)
    x = np.maximum(rays.foot + s, 0.0)
    growth = np.exp(np.abs(w))
    cosh = 0.5 * (growth + 1 / growth)
    r = parts.height[part, None] * cosh
    near = z + shadow_scale * (rays.light - z)
    # depths beyond the largest number leave nothing
    with np.errstate(invalid="ignore", over="ignore"):
        depth = fog.optical_depth(rays.origin, z, x) + fog.optical_depth(z, near, shadow_scale * r)
        f = np.exp(np.nan_to_num(fog.log_density(z) - depth, nan=-np.inf, neginf=-np.inf)) / r
    if not phase.is_constant:
        # e^|w|/(2 cosh w) and e^-|w|/(2 cosh w)
        behind, ahead = growth / (2 * cosh), 1 / (2 * cosh * growth)
        f *= phase.from_half(np.where(w > 0, behind, ahead), np.where(w > 0, ahead, behind))
    if weight is not None:
        f *= weight(x, parts.owner[part])
    middle = WIDE.nodes.size // 2
    # The exponent's rounding: its own size, and that of heights in scale heights.
    size = 16 + 4 * np.minimum(depth[:, middle], 745.0) + np.abs(w[:, middle])
    for layer in fog.layers:
        if layer.sigma_t > 0:
            reach = np.maximum(np.abs(z[:, middle]), abs(layer.base)) / layer.scale_height
            size += np.minimum(reach, 1e6) * (1 + np.minimum(depth[:, middle], 745.0))
    return (f @ WIDE.weights) * half, np.finfo(np.float64).eps * size
