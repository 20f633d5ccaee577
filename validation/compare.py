# SPDX-License-Identifier: BSD-3-Clause
"""Comparison of two image files: how large the error is, and whether it is more than noise."""

import os
from dataclasses import dataclass
from typing import Any

from numpy.typing import ArrayLike

from analytic.errors import InputError
from reference.exr import Image, read_exr
from reference.exr import layer as image_layer
from validation.metrics import Metrics, error_metrics
from validation.statistics import Estimate, Statistics, compare_statistics

BATCHES = "airlight:batches"  #: header attribute: how many batch means gave the standard errors


@dataclass(frozen=True)
class Comparison:
    """What `airlight compare` prints."""

    layer: str
    metrics: Metrics
    statistics: Statistics | None  #: None where neither image has standard errors

    @property
    def failures(self) -> tuple[str, ...]:
        """Why the comparison must be called failed; empty if it is not."""
        reasons = []
        if self.metrics.nonfinite:
            reasons.append(f"{self.metrics.nonfinite} pixels are NaN or infinite")
        if self.metrics.negative:
            reasons.append(f"{self.metrics.negative} pixels of the test image are negative")
        if self.statistics is not None and self.statistics.equivalent is False:
            reasons.append(f"the relative bias is not shown to be within +-{self.statistics.margin:.3g}")
        return tuple(reasons)

    def to_json(self) -> dict[str, Any]:
        """Return every number by name, those of the metrics first; what is not finite is None.

        `relative_bias` is the same in the metrics and in the statistics, sum(test - ref) / sum(ref).
        """
        statistics = {} if self.statistics is None else self.statistics.to_json()
        return {"layer": self.layer, **statistics, **self.metrics.to_json(), "failures": list(self.failures)}

    def summary(self) -> str:
        """Return the numbers as text, a line for each group."""
        m = self.metrics
        lines = [
            f"layer            {self.layer}, {m.pixels} pixels, {m.nonfinite} not finite, {m.negative} negative",
            f"bias             {m.bias:.4g} W/(m^2 sr), relative {_percent(m.relative_bias)}",
            f"rmse             {m.rmse:.4g} W/(m^2 sr), relative {_percent(m.relative_rmse)}",
            f"relative error   p50 {m.p50:.3g}, p99 {m.p99:.3g}, max {m.max:.3g}",
        ]
        if self.statistics is not None:
            lines += _statistics_lines(self.statistics)
        return "\n".join(lines + [f"failed           {reason}" for reason in self.failures])


def compare_images(
    reference: Image,
    test: Image,
    *,
    layer: str = "airlight",
    mask: ArrayLike | None = None,
    margin: float | None = None,
) -> Comparison:
    """Compare a layer of two images.

    Statistics need the standard errors in the layer `<layer>_se` of either image; with both, both count. The header
    attribute `airlight:batches` says from how many batch means they come.

    Parameters
    ----------
    reference, test
        The images; their errors must be independent.
    layer
        The layer, `total` for the plain channels.
    mask
        Pixels to compare, (height, width) of truth values; all by default.
    margin
        Largest relative bias that counts as agreement, such as 0.005; wants standard errors.

    Raises
    ------
    InputError
        If a layer is not there, the sizes differ, or a standard error is negative or not finite.
    """
    return _compare(("the reference", reference), ("the test image", test), name=layer, mask=mask, margin=margin)


def compare_files(
    reference: str | os.PathLike[str],
    test: str | os.PathLike[str],
    layer: str = "airlight",
    *,
    margin: float | None = None,
) -> Comparison:
    """Compare a layer of two EXR files (see `compare_images`); messages name the file.

    Raises
    ------
    InputError
        Also if a file is missing, broken or of a kind that is not read.
    """
    one, two = read_exr(reference), read_exr(test)
    return _compare((str(reference), one), (str(test), two), name=layer, mask=None, margin=margin)


def _compare(
    one: tuple[str, Image], two: tuple[str, Image], *, name: str, mask: ArrayLike | None, margin: float | None
) -> Comparison:
    """Compare a layer of two images that have names."""
    reference, test = (_estimate(path, image, name) for path, image in (one, two))
    metrics = error_metrics(reference.mean, test.mean, mask=mask)
    statistics = None
    if reference.standard_error is not None or test.standard_error is not None:
        statistics = compare_statistics(reference, test, mask=mask, margin=margin)
    elif margin is not None:
        raise InputError(
            f"a margin wants standard errors, and neither {one[0]} nor {two[0]} has a layer '{name}_se'; "
            "leave the margin out, or make the reference by Monte Carlo"
        )
    return Comparison(name, metrics, statistics)


def _estimate(path: str, image: Image, name: str) -> Estimate:
    """Take a layer with its standard error out of an image."""
    error = image.layers.get(f"{name}_se")
    batches = image.attributes.get(BATCHES) if error is not None else None
    if batches is not None and not isinstance(batches, int):
        raise InputError(f"{path} has the attribute {BATCHES} {batches!r}; wanted an integer; correct it or remove it")
    return Estimate(image_layer(image, name, path), error, batches)


def _statistics_lines(s: Statistics) -> list[str]:
    """Return the statistics as text."""
    low, high = s.relative_bias_ci
    lines = [
        f"relative bias    95 % interval {_percent(low)} to {_percent(high)}; {_percent(s.detectable_bias)} would have "
        "been found (90 % power, 5 % level)",
    ]
    if s.relative_bias_ci_batches is not None:
        low, high = s.relative_bias_ci_batches
        lines.append(f"  by batches     95 % interval {_percent(low)} to {_percent(high)}")
    if s.equivalent is not None and s.margin is not None:
        lines.append(f"margin           +-{_percent(s.margin)}: {'inside' if s.equivalent else 'NOT inside'}")
    return [
        *lines,
        f"z                mean {s.z_mean:.3f}, standard deviation {s.z_std:.3f}, {s.tested} values; "
        f"{s.zero_variance} without variance differ by up to {s.zero_variance_error:.3g} of the mean",
        f"rejected         {s.rejected} pixels, {s.expected_rejections:.2g} expected (Sidak level {s.family_level:g}); "
        f"{s.rejected_blocks} of {s.blocks} blocks",
        f"exceeding        {s.exceeding} values, {s.expected_exceeding:.0f} expected (level {s.plain_level:g}), "
        f"p = {s.exceeding_p:.3g}; p-values uniform: p = {s.uniformity_p:.3g}",
    ]


def _percent(value: float) -> str:
    return f"{100 * value:.4g} %"
