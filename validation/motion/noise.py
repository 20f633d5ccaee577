# SPDX-License-Identifier: BSD-3-Clause
"""Independent renders of one frame against its reference: how much of the error is
bias, and how much is noise.

The reference is the same for all runs: every random part is the renderer's. With e_i the error of
run i of N, all relative to the mean of the reference, and G_ij the mean of e_i e_j over values,

- the variance is V = (sum of G_ii - sum of G_ij / N)/(N - 1), the mean over values
  of the variance over runs;
- the squared bias is b^2 = the mean of G_ij over pairs i != j. The naive mean of the squared mean
  error is b^2 + V/N. By chance b^2 may be negative: it is printed as it is, and its root only from
  two errors on;
- the relative bias B is the mean of the B_i = sum of e_i over sum of the reference, with Student's
  interval. A bias that changes its sign over the image shows in b^2 alone.

An error of the reference is in B and in b^2 too, however many runs there are. By as much as the
mean of the reference may be off, the interval of B is wider to both sides; and a root of b^2 is
reported where b^2 is beyond the mean square of what the values of the reference may be off
(`validation.estimates.quadrature.off_by`).

Errors of V and b^2 come from leaving out one run at a time. N runs averaged have
the error sqrt(b^2 + V/N).

**Whether the runs are independent.** Runs of one seed are the same, bit by bit: each image counts
once. Runs that share a part of their random numbers, or of their history, have noise that is
correlated. The mean over runs is taken away, so that independent noise of variances v_i, with sum
s, leaves S_ii = v_i (1 - 2/N) + s/N^2 and S_ij = s/N^2 - (v_i + v_j)/N: the S_ii tell all v_i, and
the covariance of two runs is what S_ij has more. Where it is more than a tenth of the noise of
both, by four errors from blocks of pixels, the pair is no pair of independent runs: no bias and no
average is reported then. The largest such pair counts as one run for all others, which its share of
the mean would make alike. Three runs or fewer tell nothing, as their v_i make any S. Noise that all
runs share alike is bias.

**Whether the interval holds.** With noise of a heavy tail the brightest values come so rarely that
a few runs may have none: their mean is then too dark and their spread too small. For a sum of
independent deviations x with skewness g = sum of x^3 over (sum of x^2)^(3/2), an interval of 95 %
lies below the mean in 2.5 % + 0.084 g of all cases, by the first term of Edgeworth's series. |g| is
at most the root of the largest fraction of a value in the sum of squares. From a fraction of 1 %
on, where g may be 0.1 (where channels agree, 0.17), neither a bias against the largest deviation
nor its absence is reported. A bias towards the largest deviation is reported, as there the interval
is too wide. Where the variance exists the fraction falls with the runs.

**Noise between pixels.** With n_i = (e_i - mean of e) sqrt(N/(N - 1)) the error spectrum is the
periodogram of n_i over its mean square, in rings of the frequency: white noise is 1 everywhere,
however unequal the pixels are (Celarek, Jakob, Wimmer and Lehtinen 2019). The low fraction is its
mean below 1/8 cycle a pixel: below 0.3 the noise is blue, above 1.5 it is filtered. The blur gain
is the root mean square of n after a Gaussian of deviation s over the value before, times 2 sqrt(pi)
s: 1 for white noise.
"""

import glob
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from scipy.ndimage import gaussian_filter
from scipy.optimize import brentq
from scipy.stats import nct

from airlight.errors import InputError
from airlight.validation.arrays import Array, Progress
from airlight.validation.engine.images import image_times
from airlight.validation.engine.judge import fitting_kind, references
from airlight.validation.engine.observation import (
    expected_layer,
    model_notes,
    pixel_kinds,
    scene_of_size,
    whole_layer,
)
from airlight.validation.estimates.quadrature import known_to, known_words, off_by
from airlight.validation.motion.blocks import estimates, parts_of_error, products
from airlight.validation.motion.lag import SURE
from airlight.validation.scenes.changes import UNCHANGED, Changes
from airlight.validation.statistics.comparison import check_margin
from airlight.validation.statistics.estimate import UNKNOWN, Answer, Estimate, fact
from airlight.validation.statistics.samples import (
    first_equal,
    mean_of_runs,
    student,
    student_quantile,
)

BLURS = (1.0, 2.0, 4.0)  #: deviations of Gaussians [pixels]
_NO_NOISE = fact(0.0)
_NAMED = 5  # files that a sentence names
_ALIKE = "runs: all are the same; expected renders with different seeds"


@dataclass(frozen=True, kw_only=True)
class Noise:
    """The noise of independent renders of a frame; all is relative to the mean of the reference."""

    runs: int  #: of different images
    bias: Estimate
    bias_ci: tuple[float, float]  #: 95 %, wider by the error of the reference
    detectable_bias: float = 0.0  #: that would be found nine times of ten
    squared_bias: Estimate
    variance: Estimate = _NO_NOISE
    relative_rmse: float  #: of one run, root of the mean over runs
    largest_deviation: float = 0.0  #: of a single value from its mean over the runs
    largest_fraction: float = 0.0  #: of that in the sum of squared deviations
    spectrum: tuple[float, ...] = ()  #: by ring
    low_fraction: float = math.nan
    blurred_rmse: tuple[float, ...]  #: after each of `BLURS`
    blur_gain: tuple[float, ...] = ()
    seconds: float | None = None  #: of a run [s]
    #: the root of the squared bias, where that is above the reference's own by two errors
    root_bias: float | None = None
    #: 1/(V T), which stays where samples and time are both doubled [1/s]
    efficiency: float | None = None
    #: by error, see `time_to`
    seconds_to: Mapping[float, float | None] = field(default_factory=dict)
    correlated: tuple[tuple[int, int], ...] = ()  #: pairs of runs whose noise is
    verdict: str = ""  #: on bias and noise, in words

    @property
    def deviation(self) -> Estimate:
        """The standard deviation of a run, over its pixels."""
        variance, error = self.variance.value, self.variance.error
        if variance is None or variance <= 0:
            return fact(0.0) if variance == 0 else UNKNOWN
        root = math.sqrt(variance)
        return Estimate(root, None if error is None else error / (2 * root), self.variance.kind)

    @property
    def lacks_values(self) -> bool:
        """Whether rare values may be missing, so that the interval of the bias may not hold."""
        # A value of more than 1 % of the sum of squares: see the module. A bias towards that value
        # stands nevertheless.
        low, high = self.bias_ci
        towards = min(low * self.largest_deviation, high * self.largest_deviation) > 0
        return self.largest_fraction > 0.01 and not towards

    def words(self) -> str:
        """Return the verdict on bias and noise."""
        low, high = (100 * end for end in self.bias_ci)
        is_right = low <= 0 <= high and self.root_bias is None
        if math.isinf(high):
            return "whether there is a bias cannot be told: the error of the reference is unknown"
        if self.runs == 1 and is_right:
            return "no random numbers: no error beyond that of the reference"
        if self.runs == 1:
            return f"no random numbers: all of its error is bias, {(low + high) / 2:+.3g} % in the mean"
        if self.correlated:
            return (
                "whether there is a bias cannot be told: runs are not independent, and averages of "
                "them have another "
                "error; expected renders with different seeds and no history"
            )
        if self.lacks_values:
            kind = "brighter" if self.largest_deviation > 0 else "darker"
            return (
                "whether there is a bias cannot be told: one value has "
                f"{100 * self.largest_fraction:.2g} % of the "
                f"variance of {self.runs} runs, so still {kind} ones may be missing; add runs"
            )
        # The mean may be right while parts of the image are too bright and parts too dark: the
        # squared bias sees that.
        if is_right:
            return (
                f"no bias in {self.runs} runs; one of {100 * self.detectable_bias:.2g} % would "
                "have been found"
            )
        if low <= 0 <= high and self.root_bias is not None:
            return f"a bias that changes its sign over the image: {100 * self.root_bias:.3g} %"
        return f"a bias of {(low + high) / 2:+.3g} %, 95 % interval {low:+.3g} to {high:+.3g} %"

    def time_to(self, error: float) -> float | None:
        """Return the time until averaged runs have an error [s]; infinite
        where the bias is larger. N runs have the error sqrt(b^2 + V/N).
        """
        if self.seconds is None or self.variance.value is None or self.correlated:
            return None
        if self.runs == 1:  # nothing to average
            return self.seconds if self.relative_rmse <= error else math.inf
        bias = 0.0 if self.root_bias is None else self.root_bias**2
        return (
            self.variance.value * self.seconds / (error**2 - bias) if error**2 > bias else math.inf
        )

    def after(self, runs: float) -> float:
        """Return the error of so many averaged runs; NaN where they are not independent."""
        bias, variance = self.squared_bias.value, self.variance.value
        if bias is None or variance is None or self.correlated:
            return math.nan
        # The estimate of a squared bias may be below zero; the square is not, and noise stays.
        return math.sqrt(max(bias, 0.0) + max(variance, 0.0) / runs)


def measure_noise(
    reference: Array,
    runs: Sequence[Array],
    seconds: float | None = None,
    off: tuple[float, float] = (0.0, 0.0),
) -> Noise:
    """Return the noise of renders of a frame; all of the error of a single one is bias.

    `reference`: (height, width, channels), finite; `runs`: independent renders of that shape,
    finite; one of a renderer without random numbers; `seconds`: what one takes; `off`: by how much
    the mean and the values of the reference may be off, see `off_by`. Several runs that are the
    same count once. Raises InputError for a dark reference, and where all runs are the same.
    """
    # Images that are the same bit by bit are one run, of one seed.
    given, runs = runs, [runs[number] for number in sorted(set(first_equal(runs)))]
    if len(runs) == 1 < len(given):
        raise InputError(_ALIKE)
    count, mean = len(runs), float(reference.mean())
    if not mean > 0:
        raise InputError("runs: the reference is dark: nothing is relative to it")
    errors = np.array([(run - reference) / mean for run in runs])
    blurred = [_blurred(errors, blur) for blur in BLURS]
    bias, square = float(errors.mean()), float(np.mean(errors**2))
    # A single image has no random numbers: its whole error is bias, and a fact.
    noise = Noise(
        runs=count,
        bias=fact(bias),
        bias_ci=(bias - off[0], bias + off[0]),
        squared_bias=fact(square),
        relative_rmse=math.sqrt(square),
        blurred_rmse=tuple(math.sqrt(float(np.mean(values**2))) for values in blurred),
        seconds=seconds,
    )
    noise = noise if count == 1 else _with_spread(noise, errors, blurred, off[0])

    # The estimate of the squared bias may be negative by chance, and holds the square of the
    # reference's own error: a root is taken only of one that is above that by two errors.
    squared_bias, variance = noise.squared_bias, noise.variance.value
    root_bias = None
    if squared_bias.value is not None and squared_bias.exceeds(off[1] ** 2) is Answer.YES:
        root_bias = math.sqrt(squared_bias.value)
    noise = replace(
        noise,
        root_bias=root_bias,
        efficiency=1 / (variance * seconds) if variance and seconds else None,
    )
    # The times and the verdict are read from the finished numbers.
    goals = (0.05, 0.01, 0.002)  # relative errors
    return replace(
        noise, seconds_to={goal: noise.time_to(goal) for goal in goals}, verdict=noise.words()
    )


def _with_spread(single: Noise, errors: Array, blurred: Sequence[Array], off: float) -> Noise:
    """Return the noise of one run with all numbers that need several runs, from their relative
    errors, (runs, height, width, 3), the same blurred, and the error of the reference's mean.
    """
    count = len(errors)
    # G_ij of the module, the mean products of the errors of two runs.
    flat = errors.reshape(count, -1)
    squared_bias, variance = parts_of_error(flat @ flat.T / flat.shape[1])
    biases = flat.mean(axis=1)
    bias, half = student(biases)
    deviation = float(biases.std(ddof=1))
    # n_i of the module: the factor makes up for the mean over the runs, which is taken away.
    noise = (errors - errors.mean(axis=0)) * math.sqrt(count / (count - 1))
    square = float(np.mean(noise**2))
    # They differ by the sign of a zero, or by less than the rounding of their mean.
    if square <= 1e-24 * single.relative_rmse**2:
        raise InputError(_ALIKE)
    largest = float(noise.flat[np.argmax(np.abs(noise))])
    spectrum, low = _spectrum(noise)
    # A Gaussian of deviation s divides the root mean square of white noise by 2 sqrt(pi) s.
    gains = []
    for blur, values in zip(BLURS, blurred, strict=True):
        apart = (values - values.mean(axis=0)) * math.sqrt(count / (count - 1))
        gains.append(math.sqrt(float(np.mean(apart**2)) / square) * 2 * math.sqrt(math.pi) * blur)
    return replace(
        single,
        bias=mean_of_runs(biases),
        bias_ci=(bias - half - off, bias + half + off),
        detectable_bias=detectable(count) * deviation + off,
        squared_bias=squared_bias,
        variance=variance,
        largest_deviation=largest,
        largest_fraction=largest**2 / (square * noise.size),
        spectrum=spectrum,
        low_fraction=low,
        blur_gain=tuple(gains),
        correlated=correlated_runs(noise),
    )


def correlated_runs(noise: Array) -> tuple[tuple[int, int], ...]:
    """Return the pairs of runs that are not independent, see the module.

    `noise`: deviations from the mean over the runs, (runs, height, width, channels).
    """
    # Products of each pair of runs, by group of blocks of pixels that have noise at all.
    groups = products(noise)
    groups = groups[np.trace(groups, axis1=1, axis2=2) > 0]
    named, found = list(range(len(noise))), list[tuple[int, int]]()
    while len(named) > 3 and len(groups) > 1:
        # The errors come from leaving out a group. The limit is a correlation of a tenth: ten runs
        # that share as much are worth five, as 10/(1 + 9/10) is 5.3.
        total = groups.sum(axis=0)
        shared = _correlations(total)
        told = estimates(shared, _correlations(total - groups))
        sure = [each.exceeds(0.1, SURE) is Answer.YES for each in told]
        if not any(sure):
            break
        largest = int(np.argmax(np.where(sure, shared, -math.inf)))
        i, j = (int(ends[largest]) for ends in np.triu_indices(len(named), 1))
        found.append((named[i], named[j]))
        # The pair is one run from here on, its mean. The mean of fewer runs is taken away.
        merged = np.eye(len(named))
        merged[i, [i, j]] = 0.5
        merged = np.delete(merged, j, axis=0)
        merged -= merged.mean(axis=0)
        groups = merged @ groups @ merged.T
        del named[j]
    return tuple(sorted(found))


def _correlations(sums: Array) -> Array:
    """Return the correlation of each pair of runs, (..., pairs), see the module.

    `sums`: of the products of noise without its mean over runs, (..., runs, runs).
    """
    count = sums.shape[-1]
    own = np.diagonal(sums, axis1=-2, axis2=-1)
    mean = own.sum(axis=-1, keepdims=True) / (count * (count - 1))  # s/N^2
    variance = (own - mean) / (1 - 2 / count)
    # Noise that is less than the rounding of the others' has no correlation.
    variance = np.maximum(variance, 1e-12 * count * mean)
    i, j = np.triu_indices(count, 1)
    more = sums[..., i, j] - mean + (variance[..., i] + variance[..., j]) / count
    return np.asarray(more / np.sqrt(variance[..., i] * variance[..., j]))


def _blurred(errors: Array, deviation: float) -> Array:
    return np.array(
        [gaussian_filter(each, (deviation, deviation, 0), mode="wrap") for each in errors]
    )


def detectable(runs: int) -> float:
    """Return the bias, in deviations of one run, that a test of Student at 5 %
    finds nine times of ten.
    """
    level, power = 0.05, 0.9
    limit = student_quantile(1 - level / 2, runs - 1)
    root = math.sqrt(runs)

    def lacking(bias: float) -> float:
        # The statistic has the non-central law of Student. Only the tail on the side of the bias
        # counts: the other is rarer than 1e-6. A NaN of SciPy is taken for 1.
        detected = float(nct.sf(limit, runs - 1, bias * root))
        return (1.0 if math.isnan(detected) else detected) - power

    return float(brentq(lacking, 0.0, 10 * limit / root))


def _spectrum(noise: Array) -> tuple[tuple[float, ...], float]:
    """Return the error spectrum by ring, and its mean at low frequencies; NaN for
    rings without a frequency.
    """
    # The periodogram, divided so that white noise is 1 at every frequency (Parseval).
    power = np.mean(np.abs(np.fft.fft2(noise, axes=(1, 2))) ** 2, axis=(0, 3)) / (
        noise.shape[1] * noise.shape[2]
    )
    power /= np.mean(noise**2)
    # Eight rings reach from 0 to 1/2 cycle a pixel. The corners of the spectrum, beyond 1/2, and
    # the mean, at 0, are in no ring.
    rings = 8
    rows, columns = (np.fft.fftfreq(side) for side in noise.shape[1:3])
    frequency = np.hypot(rows[:, None], columns)
    ring = np.minimum((frequency * 2 * rings).astype(int), rings)
    ring[0, 0] = rings
    powers = [power[ring == each] for each in range(rings)]
    low = power[(frequency > 0) & (frequency < 1 / 8)]
    return tuple(float(each.mean()) if each.size else math.nan for each in powers), float(
        low.mean()
    ) if low.size else math.nan


@dataclass(frozen=True)
class NoiseComparison:
    """Independent renders of a frame against the reference of its scene."""

    scene: str
    files: str  #: with # for the digits of a number
    size: tuple[int, int]
    layer: str
    expected: str  #: what the layer was compared with: 'airlight', 'surface', or 'total' for both
    pixel: str
    known: Estimate  #: mean of the layer of the reference, and its error [W/(m^2 sr)]
    noise: Noise
    nonfinite: int  #: values that are not finite in some run, left out of all
    device: str  #: empty where no file says it
    notes: tuple[str, ...]
    failures: tuple[str, ...]  #: why the comparison must be called failed

    @property
    def lines(self) -> list[str]:
        """Return the numbers as text, a line for each group."""
        noise, width, height = self.noise, *self.size
        averages = ["unknown: runs are not independent"]
        if not noise.correlated:
            averages = [
                f"{count} runs: {100 * noise.after(count):.3g} %" for count in (4, 16, 64, 256)
            ]
        lines = [
            f"scene            {self.scene}, {width} x {height}, {noise.runs} runs; reference: "
            f"{self.expected}, "
            f"pixel {self.pixel}, {known_words(self.known)}",
            f"bias             {noise.bias.percent()}, squared {noise.squared_bias.words()}",
            f"noise            {noise.deviation.percent()} of a run, variance "
            f"{noise.variance.words()}; relative RMSE "
            f"{100 * noise.relative_rmse:.4g} %",
            f"averaged         {', '.join(averages)}",
            "error spectrum   "
            + " ".join(f"{each:.3g}" for each in noise.spectrum)
            + f"; at low frequencies {noise.low_fraction:.3g}",
            "blurred          "
            + ", ".join(
                f"{blur:g} px: {100 * error:.3g} % (gain {gain:.3g})"
                for blur, error, gain in zip(
                    BLURS, noise.blurred_rmse, noise.blur_gain, strict=True
                )
            ),
        ]
        if noise.seconds is not None:
            times = ", ".join(
                f"{100 * goal:g} %: {time_words(seconds)}"
                for goal, seconds in noise.seconds_to.items()
            )
            on = f" on {self.device}" if self.device else ""
            lines.append(
                f"time             {1000 * noise.seconds:.4g} ms a run{on}; to an error of {times}"
            )
        lines += [f"note             {note}" for note in self.notes]
        lines += [f"failed           {reason}" for reason in self.failures]
        return [*lines, f"verdict          {noise.verdict}"]


def compare_runs(
    scene: str,
    pattern: str | os.PathLike[str],
    *,
    layer: str | None = None,
    holds: str | None = None,
    pixel: str | None = None,
    margin: float | None = None,
    changes: Changes = UNCHANGED,
    progress: Progress | None = None,
) -> NoiseComparison:
    """Compare independent renders of a frame with the reference of its scene.

    `pattern`: the EXR files, # for each digit of their numbers; the rest as of
    `validation.engine.judge.compare_scene`. Where files do not say what a pixel is, the kind that
    fits their mean is taken.
    """
    check_margin(margin)
    paths = run_paths(pattern)
    # All files must have the layer of the first: airlight and all light are no runs of one image.
    image, first = whole_layer(paths[0], name=layer, holds=holds)
    rest = (whole_layer(path, name=first.name, holds=first.holds) for path in paths[1:])
    layers = [first, *(each for _, each in rest)]
    for path, each in zip(paths, layers, strict=True):
        if each.size != first.size:
            raise InputError(
                f"{path} has {each.size[0]} x {each.size[1]} pixels, {paths[0]} {first.size[0]} x "
                f"{first.size[1]}"
            )
    # References are computed when a kind of pixel is asked for; runs that do not count go first.
    loaded = scene_of_size(scene, first.size, paths[0], changes)
    reference_of = references(loaded, progress)
    runs, names, notes, failures = _distinct(
        [each.values.astype(np.float64) for each in layers], paths
    )
    # A value that is not finite in some run is left out of all: it is taken for the reference.
    finite = np.isfinite(runs).all(axis=0)

    # The mean over the runs has the least noise: it tells pixel centres from means over areas.
    mean = replace(first, values=np.where(finite, runs, np.nan).mean(axis=0))
    kind, _ = fitting_kind(mean, reference_of, pixel_kinds(image, pixel))
    fitting = reference_of(kind.pixel)
    reference = expected_layer(fitting, first)
    time = image_times(paths[0])
    filled, nonfinite = list(np.where(finite, runs, reference)), int((~finite).sum())
    seconds = None if time is None else time[0].median_ms / 1e3
    noise = measure_noise(
        reference, filled, seconds, off_by(fitting, first.holds, emitted=first.emitted)
    )
    if nonfinite:
        wrong = ", ".join(
            name for name, run in zip(names, runs, strict=True) if not np.isfinite(run).all()
        )
        failures.append(f"{nonfinite} values are NaN or infinite in some run: {wrong}")
    if noise.correlated:
        pairs = ", ".join(f"{names[i]} and {names[j]}" for i, j in noise.correlated[:_NAMED])
        more = (
            ""
            if len(noise.correlated) <= _NAMED
            else f" and {len(noise.correlated) - _NAMED} more pairs"
        )
        notes.append(f"the noise of {pairs}{more} is correlated: they are no independent renders")
    # An interval that may not hold shows nothing.
    doubtful = bool(noise.correlated) or noise.lacks_values
    if margin is not None and (doubtful or max(map(abs, noise.bias_ci)) > margin):
        failures.append(f"the relative bias is not shown to be within +-{margin:.3g}")
    return NoiseComparison(
        scene=loaded.name,
        files=str(pattern),
        size=first.size,
        layer=first.name,
        expected=first.holds,
        pixel=kind.pixel,
        known=known_to(fitting, first.holds, emitted=first.emitted),
        noise=noise,
        nonfinite=nonfinite,
        device="" if time is None else time[1],
        notes=(*model_notes(loaded), *notes),
        failures=tuple(failures),
    )


def _distinct(
    runs: list[Array], paths: Sequence[Path]
) -> tuple[Array, list[str], list[str], list[str]]:
    """Return the runs that count, their files, notes on the others, and failures.

    A run without a finite value, and one that is the same as one before it, do not count.
    """
    notes, failures = list[str](), list[str]()
    # A run of NaN alone is a failure, but the others are judged.
    blank = [path.name for run, path in zip(runs, paths, strict=True) if not np.isfinite(run).any()]
    if blank:
        failures.append(f"no value is finite in {', '.join(blank)}: left out")
    if len(blank) == len(runs):
        raise InputError(f"{paths[0].parent}: no run has a finite value: all are NaN or infinite")
    named = [
        (run, path.name) for run, path in zip(runs, paths, strict=True) if np.isfinite(run).any()
    ]
    # `firsts`: for each run the number of the first that is the same, itself if there is none.
    firsts = first_equal([run for run, _ in named])
    counting = [named[number] for number in sorted(set(firsts))]
    same = [f"{named[n][1]} is {named[first][1]}" for n, first in enumerate(firsts) if first < n]
    if same:
        more = "" if len(same) <= _NAMED else f" and {len(same) - _NAMED} more"
        notes.append(
            "runs are the same, bit by bit, as with one seed used twice: "
            f"{', '.join(same[:_NAMED])}{more}; each image "
            f"counts once: {len(counting)} of {len(named)}"
        )
    if len(counting) < 2:
        words = "all are the same, bit by bit" if same else "one of them alone has finite values"
        raise InputError(
            f"{paths[0].parent}: {words}; expected two or more renders with different seeds"
        )
    return np.array([run for run, _ in counting]), [name for _, name in counting], notes, failures


def run_paths(pattern: str | os.PathLike[str]) -> list[Path]:
    """Return the files of a pattern in which # stands for a digit. Raises
    InputError for fewer than two.
    """
    path = Path(pattern)
    # Other signs that have a meaning in patterns, such as brackets, stand for themselves.
    paths = sorted(path.parent.glob(glob.escape(path.name).replace("#", "[0-9]")))
    if len(paths) < 2:
        raise InputError(
            f"{pattern}: {len(paths)} files have such a name; expected two or more independent "
            "renders, # for each "
            "digit of their numbers, such as runs/####.exr, or --sequence for the frames of a scene "
            "that changes"
        )
    return paths


def time_words(value: float | None) -> str:
    """Return a time in words, 'never' for an infinite one."""
    return "unknown" if value is None else "never" if math.isinf(value) else f"{value:.3g} s"
