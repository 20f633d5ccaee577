# SPDX-License-Identifier: BSD-3-Clause
"""What `airlight compare` prints, a line for each group of numbers."""

import math

from validation.metrics.colour import ColourDifference
from validation.metrics.errors import Metrics
from validation.metrics.flip import Flip
from validation.metrics.other_tools import PublishedErrors
from validation.statistics.comparison import Statistics


def statistics_lines(s: Statistics) -> list[str]:
    """Return the statistics as text."""
    low, high = s.relative_bias_ci
    lines = [
        f"relative bias    95 % interval {percent(low)} to {percent(high)}; {percent(s.detectable_bias)} would have "
        "been found (90 % power, 5 % level)",
    ]
    if s.relative_bias_ci_batches is not None:
        low, high = s.relative_bias_ci_batches
        lines.append(f"  by batches     95 % interval {percent(low)} to {percent(high)}")
    if s.equivalent is not None and s.margin is not None:
        lines.append(f"margin           +-{percent(s.margin)}: {'inside' if s.equivalent else 'NOT inside'}")
    return [
        *lines,
        f"variance         {percent(s.reference_variance_share)} of it the reference's; one pixel has up to "
        f"{percent(s.largest_share)}",
        f"zero reference   {s.zero_reference} values, the test image there up to "
        f"{shown(s.zero_reference_error, 3)} of the mean",
        f"z                mean {_fixed(s.z_mean)}, standard deviation {_fixed(s.z_std)}, {s.tested} values; "
        f"{s.zero_variance} without variance differ by up to {shown(s.zero_variance_error, 3)} of the mean",
        f"rejected         {s.rejected} pixels, {s.expected_rejections:.2g} expected (Sidak level {s.family_level:g}); "
        f"{s.rejected_blocks} of {s.blocks} blocks",
        f"exceeding        {s.exceeding} values, {s.expected_exceeding:.0f} expected (level {s.plain_level:g}), "
        f"p = {shown(s.exceeding_p, 3)}; p-values uniform: p = {shown(s.uniformity_p, 3)}",
    ]


def order_line(layer: str, m: Metrics, s: Statistics | None) -> str:
    """Return the comparison of light of some orders of scattering as a line of text."""
    interval = ""
    if s is not None:
        low, high = s.relative_bias_ci_batches or s.relative_bias_ci
        interval = f" (95 % interval {percent(low)} to {percent(high)})"
    return f"{layer:<17}relative bias {percent(m.relative_bias)}{interval}, relative rmse {percent(m.relative_rmse)}"


def errors_lines(e: PublishedErrors) -> list[str]:
    """Return the errors of other tools as text."""
    return [
        f"unit {e.unit:<12.4g}mse {shown(e.mse)}, mae {shown(e.mae)}, psnr {shown(e.psnr)} dB, smape {shown(e.smape)}, "
        f"mape {shown(e.mape)}",
        f"  by tool        rse_tev {shown(e.rse_tev)}, rae_tev {shown(e.rae_tev)}, mrse_pbrt {shown(e.mrse_pbrt)}, "
        f"relmse {shown(e.relmse)} (trimmed {shown(e.relmse_trim)}), mrse_jeri {shown(e.mrse_jeri)}",
        f"  without floor  relative {shown(e.relative)}, largest {shown(e.relative_max)}; {e.dark} dark values wrong "
        f"by up to {shown(e.dark_max, 3)} of the mean",
    ]


def colour_lines(c: ColourDifference) -> list[str]:
    """Return the colour differences as text."""
    return [
        f"CIEDE2000        mean {shown(c.ciede2000_mean)}, p99 {shown(c.ciede2000_p99)}, max "
        f"{shown(c.ciede2000_max)} at {c.exposure:+.2f} stops; {c.clipped} pixels clipped",
        f"Delta E ITP      mean {shown(c.itp_mean)}, p99 {shown(c.itp_p99)}, max {shown(c.itp_max)}, white "
        f"{c.white_luminance:g}, peak {c.peak_luminance:g} cd/m^2; {c.clipped_itp} pixels clipped",
    ]


def flip_line(f: Flip) -> str:
    """Return FLIP as text, or why there is none."""
    if f.value is None:
        return f"HDR-FLIP         none: {f.note}"
    return (
        f"HDR-FLIP         {f.value:.4f} from {f.start_exposure:+.2f} to {f.stop_exposure:+.2f} stops, "
        f"{f.exposures} exposures, {f.pixels_per_degree:g} pixels per degree"
    )


def percent(value: float) -> str:
    """Return a share, `value` [1], as text in percent: '0.12 %' for 0.0012."""
    return f"{shown(100 * value)} %" if math.isfinite(value) else shown(value)


def shown(value: float, digits: int = 4) -> str:
    """Return a number, or a word for what is none."""
    if math.isnan(value):
        return "undefined"
    return "unlimited" if math.isinf(value) else f"{value:.{digits}g}"


def _fixed(value: float) -> str:
    return f"{value:.3f}" if math.isfinite(value) else shown(value)
