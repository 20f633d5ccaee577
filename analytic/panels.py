# SPDX-License-Identifier: BSD-3-Clause
"""The airlight integral of millions of segments in float64, each to a tolerance that its
error estimate meets.

The integral is taken in w = asinh((x - foot)/height) (DESIGN section 2), with E = e^w = q/h, where
every quantity is free of cancellation and of overflow:

    J = (1/h) int_{w0}^{w1} exp(-sigma_t (foot + h E)) p(cos) 2E/(1 + E^2) dw
    (1 + cos)/2 = 1/(1 + E^2),      (1 - cos)/2 = E^2/(1 + E^2).

A light path that counts only s times in the exponent (`shadow_scale`) turns x + r into x + s r,
that is

    foot + h (E - 1/E)/2 + s h (E + 1/E)/2  =  foot + h ((1 + s)/2 E - (1 - s)/2 1/E).

Why w and why panels of one width do for all parameters: the integrand is analytic in the strip |Im
w| < pi/2. Its poles E = +-i lie on the edge, as do those of Henyey-Greenstein, E^2 = -((1 -+ g)/(1
+- g))^2, and exp(-a E) is bounded there since Re E > 0. The optical thickness and the sharpness of
a lobe only shift the places where the integrand changes and do not bring the singularities closer.
Gauss rules with n nodes on a panel of half width H hence converge as rho^(-2n), rho = H' + sqrt(1 +
H'^2), H' = pi/(2H) (Trefethen 2013, Approximation Theory and Approximation Practice, theorem 19.3).

Each panel is integrated by the 21 nodes of Kronrod, its error estimated by the difference from the
10 of Gauss among them: the estimate is the error of the worse rule, for smooth integrands an upper
bound by many digits. Panels of segments that miss the tolerance are halved until they meet it.

A table of a phase function cuts a segment at each of its entries. These narrow panels, of 0.1 at
most, have a rho of 63 or more, and Gauss's three nodes are right to rho^(-6) = 2e-11: Kronrod's
seven suffice for a third of the work.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from airlight.analytic.kronrod import NARROW, WIDE, Pair
from airlight.analytic.phase import PhaseFunction, Tabulated
from airlight.errors import InputError

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Weight = Callable[[Array, Index], Array]

_CHUNK = 8192  # panels evaluated at once: 1.4 MB an array


@dataclass(frozen=True)
class _Segments:
    """Segments of one chunk in the variables of the integral, arrays of shape (n,)."""

    index: Index  # row numbers in the caller's input
    foot: Array
    height: Array  # > 0
    sigma_t: Array
    start: Array  # w0
    scale: Array  # E at w0
    width: Array  # w1 - w0 > 0


@dataclass(frozen=True)
class _Integrand:
    """The parameters that all segments share."""

    phase: PhaseFunction
    shadow_scale: float
    weight: Weight | None


def airlight_segments(
    foot: ArrayLike,
    height: ArrayLike,
    x0: ArrayLike,
    x1: ArrayLike,
    sigma_t: ArrayLike,
    phase: PhaseFunction,
    *,
    shadow_scale: float = 1.0,
    weight: Weight | None = None,
    rtol: float = 1e-10,
) -> tuple[Array, Array]:
    """Integrate the airlight of N segments of rays.

    `foot`, `height`: signed distance of the foot point and distance between light and ray [m];
    numbers or shape (N,). `x0`, `x1`: ends of the segments along the ray [m], x0 <= x1; x1 may be
    infinite. `sigma_t`: extinction coefficient [1/m], >= 0. `phase`: phase function, the same for
    all segments. `shadow_scale`: s in [0, 1]: the light's segment counts s times in the exponent,
    exp(-sigma_t (x + s r)), as in a renderer that attenuates over shortened shadow rays (DESIGN
    section 6.1). `weight`: relative intensity of the light: called as weight(x, index) with
    distances x of shape (m, 7) or (m, 21) [m] and the row numbers of their segments, shape (m,);
    returns an array of the shape of x. Where it has kinks, cut the segments there, otherwise the
    panels around them are halved many times. `rtol`: relative tolerance, in [1e-13, 0.1]. Returns
    `value`, `error`: J [1/m] and an estimate of its absolute error, mostly many digits too large,
    of shape (N,). Raises InputError for numbers out of their ranges, NaN, or arrays that do not
    broadcast.

    Valid for all finite inputs: x0 = x1 gives 0, the light on the segment +inf (error inf), the
    light on the ray beside the segment the finite limit. A segment that cannot meet `rtol` comes
    back with an error estimate that says so.
    """
    columns = _checked(foot, height, x0, x1, sigma_t)
    if not 0 <= shadow_scale <= 1:
        raise InputError(
            f"shadow_scale is {shadow_scale}; expected a number from 0 to 1 (1 is the physical "
            "value)"
        )
    if not 1e-13 <= rtol <= 0.1:
        raise InputError(f"rtol is {rtol}; expected a relative tolerance from 1e-13 to 0.1")
    integrand = _Integrand(phase, float(shadow_scale), weight)
    n = len(columns[0])
    value, error = np.zeros(n), np.zeros(n)
    # One chunk after another bounds the memory; a table cuts each segment into many panels, so that
    # fewer segments make a chunk.
    step = max(64, _CHUNK // (1 + len(phase.kinks)))
    for first in range(0, n, step):
        rows = np.arange(first, min(first + step, n))
        part = slice(first, first + len(rows))
        value[part], error[part] = _integrate_chunk(
            [c[part] for c in columns], rows, integrand, rtol
        )
    return value, error


def _integrate_chunk(
    columns: list[Array], rows: Index, integrand: _Integrand, rtol: float
) -> tuple[Array, Array]:
    """Integrate the segments of one chunk; `rows` are their numbers in the caller's input."""
    value, error = np.zeros(len(rows)), np.zeros(len(rows))
    foot, height, x0, x1, _ = columns
    # The integral diverges where the light lies on the segment; below this height [m] 1/height
    # would overflow.
    at_light = 1e-290
    through_light = (height < at_light) & (x0 <= foot) & (foot <= x1) & (x0 < x1)
    value[through_light] = error[through_light] = np.inf
    # Segments without length stay 0.
    regular = np.flatnonzero((x0 < x1) & ~through_light)
    if len(regular):
        segments = _segments([c[regular] for c in columns], rows[regular], integrand)
        evaluate = partial(_evaluate, segments, integrand)
        count = len(regular)
        first = _first_panels(segments, integrand.phase.kinks)
        value[regular], error[regular] = adapted(first, evaluate, np.arange(count), count, rtol)
    return value, error


def log_distance(
    foot: Array, height: Array, x0: Array, x1: Array
) -> tuple[Array, Array, Array, Array]:
    """Return segments in w, without cancellation.

    With A and B the values of w at the ends, sinh(A - B) = sinh A cosh B - cosh A sinh B = (s1 r0 -
    s0 r1)/h^2. Since (s1 r0)^2 - (s0 r1)^2 = h^2 (s1^2 - s0^2), the width of a segment that does
    not hold the foot is

        w1 - w0 = asinh( (x1 - x0) (s0 + s1) / (s1 r0 + s0 r1) ),

    all sums being of one sign. The width of a segment that holds the foot is the
    sum of two positive terms.

    `foot`, `height`, `x0`, `x1`: as in `airlight_segments`, arrays of one shape [m]. Returns
    `start`, `scale`, `width`, `height`: w0, E at w0, w1 - w0, which may be infinite [1], and the
    height, above 0 [m].
    """
    s0, s1 = x0 - foot, x1 - foot
    # A light on the ray has the height 0, for which w is not defined. Where the segment does not
    # hold the foot, the light may as well be at this height, a fraction of the distance between
    # foot and segment.
    near_zero = 1e-15
    gap = np.where(s0 > 0, s0, np.where(s1 < 0, -s1, 0.0))
    height = np.maximum(height, near_zero * gap)
    start = np.arcsinh(s0 / height)
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        # The closed form above, for segments that do not hold the foot; the others are a difference
        # of two values of opposite sign. Both are computed for all, and lanes that overflow are not
        # selected.
        r0, r1 = np.hypot(height, s0), np.hypot(height, s1)
        one_sided = np.arcsinh((x1 - x0) * (s0 + s1) / (s1 * r0 + s0 * r1))
        width = np.where(s0 * s1 > 0, one_sided, np.arcsinh(s1 / height) - start)
        width = np.where(np.isinf(x1), np.inf, width)
        # E = q/h, by the branch of q in which nothing cancels (`analytic.geometry`).
        scale = np.where(s0 > 0, (s0 + r0) / height, height / (r0 - s0))
    return start, scale, width, height


def _segments(columns: list[Array], rows: Index, integrand: _Integrand) -> _Segments:
    """Change variables to w, and cut segments off where the exponential or 1/cosh w has made the
    rest negligible.
    """
    foot, height, x0, x1, sigma_t = columns
    start, scale, width, height = log_distance(foot, height, x0, x1)
    folds = _folds(integrand)
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        # The exponent grows by (1 + s)/2 sigma_t h E0 (e^(w - w0) - 1), and more for s < 1: this is
        # where it has grown by the e-folds.
        thickness = 0.5 * (1 + integrand.shadow_scale) * sigma_t * height * scale
        width = np.minimum(width, np.log1p(folds / thickness))
    # Behind the foot, w > 0, the factor 1/cosh w falls by an e-fold for each unit of w.
    width = np.minimum(width, np.maximum(-start, 0.0) + min(folds, 120.0))
    return _Segments(rows, foot, height, sigma_t, start, scale, width)


def _folds(integrand: _Integrand) -> float:
    """Return after how many e-folds of decay to stop: more where the
    lobe can outweigh the decay.
    """
    phase = integrand.phase
    if isinstance(phase, Tabulated) or integrand.weight is not None:
        # The integrand may be 0 where the decay is least, so that no decay makes the rest
        # negligible: only what underflows, exp(-745), is left out, which costs one panel more.
        return 745.0
    ends = phase(np.array([-1.0, 0.0, 1.0]))
    if ends.min() == 0:
        return 745.0
    # After 44 e-folds the rest of a segment is below 1e-19 of it. A lobe can weigh the far end more
    # than the near one, by the ratio of its largest value to its smallest: so many e-folds more.
    negligible = 44.0
    return float(negligible + np.log(ends.max() / ends.min()))


@dataclass(frozen=True)
class Panels:
    """Panels with their integrals by two rules, arrays of shape (m,); the last three may be
    (m, columns).
    """

    owner: Index  #: row of the segment, in its chunk
    #: in the variable of the integral; here the distance in w from the start of the segment
    start: Array
    width: Array
    value: Array  #: the integral by Kronrod's rule
    error: Array  #: by how much Gauss's rule differs from it
    noise: Array  #: rounding error of the value


def adapted(
    first: tuple[Index, Array, Array],
    evaluate: Callable[[Index, Array, Array], Panels],
    row: Index,
    count: int,
    rtol: float,
) -> tuple[Array, Array]:
    """Halve the panels of all sums that miss the tolerance until none does,
    or only rounding is left.

    `first`: segment, start and width of the first panels; `evaluate`: integrates such panels;
    `row`: to which of `count` sums each segment belongs; `count`: number of sums; `rtol`: relative
    tolerance of each [1]. Returns `value`, `error`: the sums and estimates of their errors,
    (count,), or (count, columns): all columns share panels.
    """
    # A sum that still misses its tolerance after so many halvings, or with so many panels, says so
    # by its error. A kink needs two panels a halving; thousands chase rounding of the integrand.
    halvings, most = 40, 4096
    panels = evaluate(*first)
    for _ in range(halvings):
        owner = row[panels.owner]
        # A sum is right when the errors of its panels together are within its tolerance.
        allowed = rtol * np.abs(_summed(owner, panels.value, count))
        missed = _summed(owner, panels.error, count) > allowed
        if not missed.any():
            break
        # Otherwise each panel may take an equal part of the tolerance. Those that exceed it are
        # halved, unless their error is rounding, which no halving removes.
        panel_count = np.bincount(owner, minlength=count)
        fraction = (allowed.T / np.maximum(panel_count, 1)).T
        misses = missed[owner] & (panels.error > fraction[owner]) & (panels.error > panels.noise)
        # Columns share their panels: a panel that one column needs halved is halved for all.
        halve = np.any(misses.reshape(len(misses), -1), axis=1) & (panel_count[owner] < most)
        if not halve.any():
            break
        # Both halves of every such panel are evaluated in one call.
        width = 0.5 * panels.width[halve]
        starts = np.concatenate([panels.start[halve], panels.start[halve] + width])
        halves = evaluate(np.tile(panels.owner[halve], 2), starts, np.tile(width, 2))
        panels = _joined(panels, ~halve, halves)
    owner = row[panels.owner]
    return _summed(owner, panels.value, count), _summed(owner, panels.error + panels.noise, count)


def _summed(owner: Index, values: Array, n: int) -> Array:
    if values.ndim > 1:
        return np.stack([_summed(owner, column, n) for column in values.T], axis=1)
    return np.bincount(owner, values, n).astype(np.float64, copy=False)


def _first_panels(segments: _Segments, kinks: Array) -> tuple[Index, Array, Array]:
    """Cut the segments at the kinks of the phase function and into
    panels that are narrow enough for smooth integrands.
    """
    # rho = 2.97 for this width, so that Gauss's ten nodes are right to about 1e-9 to 1e-11.
    widest = 2.4
    owner, start, width = cut_at_kinks(segments.start, segments.width, kinks)
    return equal_panels(owner, start, width, np.maximum(np.ceil(width / widest), 1))


def cut_at_kinks(begin: Array, width: Array, kinks: Array) -> tuple[Index, Array, Array]:
    """Cut intervals of w at the kinks of a phase function; return their numbers, starts
    from `begin` on, and widths.
    """
    owner: Index = np.arange(len(begin), dtype=np.int64)
    if not len(kinks):
        return owner, np.zeros(len(begin)), width
    # cos = -tanh w: w increases where the cosine falls, so that the kinks come in reverse.
    places = np.clip(np.arctanh(-kinks[::-1]) - begin[:, None], 0.0, width[:, None])
    ends = np.concatenate([np.zeros((len(begin), 1)), places, width[:, None]], axis=1)
    pieces = np.diff(ends, axis=1)
    # A kink beyond an interval was clipped to its end and leaves a piece without width.
    owner, piece = np.nonzero(pieces > 0)
    return owner, ends[owner, piece], pieces[owner, piece]


def equal_panels(
    owner: Index, start: Array, width: Array, count: Array
) -> tuple[Index, Array, Array]:
    """Cut intervals into equal panels, `count` of each; return their owners, starts and widths."""
    times = count.astype(np.int64)
    # 0, 1, .. within each interval: the running number less the number of its first panel.
    number = np.arange(times.sum()) - np.repeat(np.cumsum(times) - times, times)
    width = np.repeat(width / times, times)
    return np.repeat(owner, times), np.repeat(start, times) + number * width, width


def _evaluate(
    segments: _Segments, integrand: _Integrand, owner: Index, start: Array, width: Array
) -> Panels:
    """Integrate panels by both rules, a block at a time so that the arrays stay in the cache."""
    integrals = np.empty((len(owner), 2))
    noise = np.empty(len(owner))
    for pair, block in blocks_by_rule(width, _CHUNK):
        panels = owner[block], start[block], width[block]
        integrals[block], noise[block] = _evaluate_block(segments, integrand, pair, *panels)
    return Panels(
        owner,
        start,
        width,
        integrals[:, 0],
        np.abs(integrals[:, 0] - integrals[:, 1]),
        noise * np.abs(integrals[:, 0]),
    )


def blocks_by_rule(width: Array, most: int) -> Iterator[tuple[Pair, Index]]:
    """Yield pairs of rules with the numbers of panels that each is to integrate at once.

    `width`: of the panels, in w, (panels,) [1]; `most`: how many panels at once.
    """
    # Up to this width in w seven nodes of Kronrod suffice (module docstring, last paragraph).
    narrow = width <= 0.1
    for pair, chosen in ((NARROW, narrow), (WIDE, ~narrow)):
        panels = np.flatnonzero(chosen)
        for first in range(0, len(panels), most):
            yield pair, panels[first : first + most]


def _evaluate_block(
    segments: _Segments, integrand: _Integrand, pair: Pair, owner: Index, start: Array, width: Array
) -> tuple[Array, Array]:
    """Return the integrals of the panels by both rules, (m, 2), and the relative
    rounding error of the integrand.
    """
    foot, height, sigma_t = segments.foot[owner], segments.height[owner], segments.sigma_t[owner]
    middle, half = start + 0.5 * width, 0.5 * width
    # E = e^w at the nodes: e^(w - w0) times E at the start of the segment, which `log_distance` has
    # without cancellation.
    e = np.exp(middle[:, None] + half[:, None] * pair.nodes)
    e *= segments.scale[owner, None]
    inverse = 1 / e
    # 2E/(1 + E^2) = 1/cosh w.
    kernel = 2 / (e + inverse)
    s = integrand.shadow_scale
    # The exponent sigma_t (foot + h ((1 + s)/2 E - (1 - s)/2 1/E)), whose last term is 0 for a
    # physical light path. Arrays are reused, so that a block stays in the cache.
    up_rate = 0.5 * (1 + s) * sigma_t * height
    exponent = up_rate[:, None] * e
    exponent += (sigma_t * foot)[:, None]
    if s != 1:
        exponent -= (0.5 * (1 - s) * sigma_t * height)[:, None] * inverse
    f = np.exp(np.negative(exponent, out=exponent), out=exponent)
    f *= kernel
    if not integrand.phase.is_constant:
        # sin^2 and cos^2 of half the scattering angle: E^2/(1 + E^2) and 1/(1 + E^2).
        kernel *= 0.5
        f *= integrand.phase.from_half(e * kernel, inverse * kernel)
    if integrand.weight is not None:
        # x = foot + h sinh w.
        x = foot[:, None] + 0.5 * height[:, None] * (e - inverse)
        f *= integrand.weight(x, segments.index[owner])
    # From the interval [-1, 1] of the rules to the width of the panel, and the factor 1/h of J.
    scale = half / height
    with np.errstate(over="ignore"):
        # The rounding error in units of epsilon: of the factors, of the exponent's constant part,
        # and of its part with E, whose relative error grows with the distance in w from the start.
        size = (
            16 + np.abs(sigma_t * foot) + (1 + up_rate * e[:, len(pair.nodes) // 2]) * (1 + middle)
        )
    return (f @ pair.weights) * scale[:, None], np.finfo(float).eps * size


def _joined(panels: Panels, keep: NDArray[np.bool_], more: Panels) -> Panels:
    """Return the panels under a mask, followed by more."""
    fields = ("owner", "start", "width", "value", "error", "noise")
    return Panels(*(np.concatenate([getattr(panels, f)[keep], getattr(more, f)]) for f in fields))


def _checked(
    foot: ArrayLike, height: ArrayLike, x0: ArrayLike, x1: ArrayLike, sigma_t: ArrayLike
) -> tuple[Array, ...]:
    """Return the inputs as float64 arrays of one shape (N,), or refuse them."""
    names = ("foot", "height", "x0", "x1", "sigma_t")
    try:
        columns = [np.asarray(c, dtype=np.float64) for c in (foot, height, x0, x1, sigma_t)]
        # Numbers are rows of one entry.
        columns = [np.atleast_1d(c) for c in np.broadcast_arrays(*columns)]
    except (TypeError, ValueError) as reason:
        raise InputError(
            f"foot, height, x0, x1 and sigma_t do not fit together: {reason}"
        ) from None
    if columns[0].ndim != 1:
        raise InputError(
            f"foot, height, x0, x1 and sigma_t have the shape {columns[0].shape}; expected one "
            "column each"
        )
    for name, column in zip(names, columns):
        # Only x1 may be infinite.
        valid = np.isfinite(column) if name != "x1" else ~np.isnan(column)
        if name in ("height", "sigma_t"):
            valid &= column >= 0
        # The third column is x0.
        if name == "x1":
            valid &= column >= columns[2]
        if not valid.all():
            row = int(np.argmin(valid))
            expected = {
                "height": "a number >= 0",
                "sigma_t": "a number >= 0",
                "x1": "a number >= x0, or inf",
            }
            raise InputError(
                f"{name} of row {row} is {column[row]}; expected "
                f"{expected.get(name, 'a finite number')}"
            )
    return tuple(columns)
