# SPDX-License-Identifier: BSD-3-Clause
"""The figure of the kernels' speed: nanoseconds a ray against the error, a line for each kernel over its sizes."""

from pathlib import Path

from reference.storage.files import ensure_folder
from reports.figures.files import new_figure, read_data, value, write_data
from reports.machine.progress import Progress, counted
from reports.plotting.style import WIDTHS, kernel_style

NAME = "kernel-speed"
SUMMARY = "nanoseconds a ray against the error of each kernel, over its sizes"

_HEADER = ("kernel", "family", "size", "phase", "rays", "ns", "ns_low", "ns_high", "median", "p99", "max", "nonfinite")
_STATISTICS = {"median": "half of the rays", "p99": "99 % of the rays", "max": "worst ray"}
_SHOWN = (1e-7, 10.0)  # errors; those outside are drawn at the edge


def compute(
    folder: Path | str,
    *,
    quick: bool = False,
    names: list[str] | None = None,
    progress: Progress | None = None,
) -> None:
    """Write `kernel-speed.csv` into a folder: time and errors of every kernel and size, isotropic, in float32.

    Parameters
    ----------
    quick
        Fewer rays and shorter timings.
    names
        Kernels; all of them by default.
    """
    from validation.kernels.benchmark import PHASES, RAYS, bench_kernels

    target = ensure_folder(folder)
    rays, seconds = (RAYS // 16, 0.02) if quick else (RAYS // 2, 0.1)
    measured = bench_kernels(names, phases=PHASES[:1], rays=rays, seconds=seconds, progress=counted(progress))
    rows = []
    for cost in measured.costs:
        time = cost.device or cost.wall
        if cost.refused or time is None:
            continue
        spread = (time.median, time.low, time.high)
        errors = (cost.median, cost.p99, cost.max, cost.nonfinite)
        rows.append((cost.kernel, cost.family, cost.size, cost.phase, cost.rays, *spread, *errors))
    made_by = {"rays": rays, "seconds": seconds, "phase": PHASES[0][0], "precision": "single", "quick": quick}
    write_data(target, NAME, _HEADER, rows, **made_by)


def draw(folder: Path, column: str):
    """Return the figure, see `reports.figures.files.plot`."""
    rows = read_data(folder, NAME)
    width = WIDTHS[column]
    double = column == "double"
    figure = new_figure(width, 0.42 * width if double else 1.9 * width)
    panels = figure.subplots(*((1, 3) if double else (3, 1)), sharex=True, sharey=True)
    for panel, (statistic, words) in zip(panels, _STATISTICS.items()):
        for family in dict.fromkeys(row["family"] for row in rows):
            _line(panel, [row for row in rows if row["family"] == family], family, statistic)
        panel.set(xscale="log", yscale="log", xlabel="time of a ray [ns]", title=words)
        panel.set_ylim(0.6 * _SHOWN[0], 1.6 * _SHOWN[1])
    for panel in panels if not double else panels[:1]:
        panel.set_ylabel("relative error of J [1]")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=6 if double else 3)
    return figure


def _line(panel, rows: list[dict[str, str]], family: str, statistic: str) -> None:
    """Draw a kernel over its sizes."""
    style = kernel_style(family)
    shown = [(value(row, "ns"), value(row, statistic)) for row in rows]
    points = sorted((ns, error) for ns, error in shown if ns and error is not None)
    if not points:
        return
    times, errors = [point[0] for point in points], [min(max(point[1], _SHOWN[0]), _SHOWN[1]) for point in points]
    panel.plot(times, errors, label=family, linestyle="-", clip_on=False, zorder=3, **style)
