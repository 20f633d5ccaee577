# SPDX-License-Identifier: BSD-3-Clause
"""What `airlight compare` prints, a line for each group of numbers."""

from validation.metrics.colour import ColourDifference
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
        f"{s.zero_reference_error:.3g} of the mean",
        f"z                mean {s.z_mean:.3f}, standard deviation {s.z_std:.3f}, {s.tested} values; "
        f"{s.zero_variance} without variance differ by up to {s.zero_variance_error:.3g} of the mean",
        f"rejected         {s.rejected} pixels, {s.expected_rejections:.2g} expected (Sidak level {s.family_level:g}); "
        f"{s.rejected_blocks} of {s.blocks} blocks",
        f"exceeding        {s.exceeding} values, {s.expected_exceeding:.0f} expected (level {s.plain_level:g}), "
        f"p = {s.exceeding_p:.3g}; p-values uniform: p = {s.uniformity_p:.3g}",
    ]


def errors_lines(e: PublishedErrors) -> list[str]:
    """Return the errors of other tools as text."""
    return [
        f"unit {e.unit:<12.4g}mse {e.mse:.4g}, mae {e.mae:.4g}, psnr {e.psnr:.4g} dB, smape {e.smape:.4g}, "
        f"mape {e.mape:.4g}",
        f"  by tool        rse_tev {e.rse_tev:.4g}, rae_tev {e.rae_tev:.4g}, mrse_pbrt {e.mrse_pbrt:.4g}, "
        f"relmse {e.relmse:.4g} (trimmed {e.relmse_trim:.4g}), mrse_jeri {e.mrse_jeri:.4g}",
        f"  without floor  relative {e.relative:.4g}, largest {e.relative_max:.4g}; {e.dark} dark values wrong "
        f"by up to {e.dark_max:.3g} of the mean",
    ]


def colour_lines(c: ColourDifference) -> list[str]:
    """Return the colour differences as text."""
    return [
        f"CIEDE2000        mean {c.ciede2000_mean:.4g}, p99 {c.ciede2000_p99:.4g}, max {c.ciede2000_max:.4g} at "
        f"{c.exposure:+.2f} stops; {c.clipped} pixels clipped",
        f"Delta E ITP      mean {c.itp_mean:.4g}, p99 {c.itp_p99:.4g}, max {c.itp_max:.4g}, white "
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
    return f"{100 * value:.4g} %"
