# SPDX-License-Identifier: BSD-3-Clause
"""The figure of the kernels' errors: the relative error of J over the optical depth and the angle of a ray.

A ray is described by the distance d from the camera to the light, as optical depth sigma_t d, and by the angle between
the ray and the direction to the light. Its segment goes from the camera to 2 d, beyond the light where the angle is
small. Kernels run in float32 with their default sizes; isotropic fog. The truth is `analytic`'s, to about 1e-12.
"""

from pathlib import Path

from reference.storage.files import ensure_folder
from reports.figures.files import new_figure, read_data, write_data
from reports.machine.progress import Progress
from reports.plotting.style import WIDTHS

NAME = "kernel-errors"
SUMMARY = "relative error of each kernel over the optical depth and the angle of a ray"

_DEPTHS = (1e-3, 30.0)  # optical depth of the distance to the light
_ANGLES = (0.5, 179.5)  # [degrees]
_REACH = 2.0  # length of the segment over the distance to the light
_FLOOR, _CEILING = 1e-7, 1.0  # ends of the colour scale: the rounding of float32, and no correct digit


def compute(folder: Path | str, *, quick: bool = False, progress: Progress | None = None) -> None:
    """Write `kernel-errors.csv` into a folder: kernel, optical depth, angle, relative error.

    Parameters
    ----------
    quick
        Fewer rays.
    """
    import numpy as np

    from realtime.kernels.registry import KERNELS
    from validation.kernels.errors import relative_error
    from validation.kernels.values import evaluate_cases
    from validation.study.configuration import find_kernel

    target = ensure_folder(folder)
    cases, depth, angle = _rays(*((24, 18) if quick else (48, 37)))
    rows: list[tuple] = []
    for number, name in enumerate(KERNELS):
        if progress is not None:
            progress(number / len(KERNELS), name)
        evaluated = evaluate_cases(cases, find_kernel(name), "single")
        if not evaluated.accepted.any():
            continue
        error = relative_error(evaluated.J, np.asarray(cases.value), "single")
        rows += [(name, *row) for row in zip(depth.tolist(), angle.tolist(), error.tolist())]
    made_by = {"rays": len(depth), "phase": "isotropic", "precision": "single", "reach": _REACH}
    write_data(target, NAME, ("kernel", "optical_depth", "angle_degrees", "relative_error"), rows, **made_by)


def _rays(columns: int, lines: int):
    """Return rays on a grid, with the true J, and the optical depth and angle [degrees] of each."""
    import numpy as np

    from validation.kernels.rays import table, with_truth

    grid = np.meshgrid(np.geomspace(*_DEPTHS, columns), np.linspace(*_ANGLES, lines), indexing="ij")
    depth, angle = (values.ravel() for values in grid)
    foot, height = (
        (depth * part).astype(np.float32).astype(np.float64)
        for part in (np.cos(np.radians(angle)), np.sin(np.radians(angle)))
    )
    end = (_REACH * depth).astype(np.float32).astype(np.float64)
    zero, ones = np.zeros_like(depth), np.ones_like(depth)
    names, tags = np.full(len(depth), "isotropic"), np.full(len(depth), "grid")
    cases = table(names, zero, foot=foot, height=height, x0=zero, x1=end, sigma_t=ones, tags=tags)
    return with_truth(cases), depth, angle


def draw(folder: Path, column: str):
    """Return the figure, see `reports.figures.files.plot`."""
    import numpy as np
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import LogNorm

    rows = read_data(folder, NAME)
    kernels = list(dict.fromkeys(row["kernel"] for row in rows))
    across = 4 if column == "double" else 3
    down = -(-len(kernels) // across)
    width = WIDTHS[column]
    figure = new_figure(width, down * width / across * 0.85 + 0.35)
    panels = figure.subplots(down, across, sharex=True, sharey=True, squeeze=False)
    norm = LogNorm(_FLOOR, _CEILING, clip=True)
    for panel, kernel in zip(panels.flat, kernels):
        depth, angle, error = _grid([row for row in rows if row["kernel"] == kernel])
        panel.set_facecolor("#ff00ff")  # shows where a kernel's value is not finite
        panel.pcolormesh(depth, angle, np.maximum(error, _FLOOR), norm=norm, cmap="cividis", rasterized=True)
        panel.set_xscale("log")
        panel.set_yticks([0, 45, 90, 135, 180])
        panel.set_title(kernel)
        panel.grid(False)
    for panel in panels.flat[len(kernels) :]:
        panel.set_axis_off()
    figure.supxlabel("optical depth of the distance to the light [1]", fontsize="medium")
    figure.supylabel("angle from the light [degrees]", fontsize="medium")
    figure.colorbar(
        ScalarMappable(norm, "cividis"),
        ax=panels,
        label="relative error of J [1]",
        aspect=40,
        extend="both",
        shrink=0.8,
    )
    return figure


def _grid(rows: list[dict[str, str]]):
    """Return optical depths, angles [degrees] and errors, (angles, depths), NaN where there is none."""
    import numpy as np

    depth = np.array([float(row["optical_depth"]) for row in rows])
    angle = np.array([float(row["angle_degrees"]) for row in rows])
    error = np.array([float(row["relative_error"] or "nan") for row in rows])
    depths, angles = np.unique(depth), np.unique(angle)
    grid = np.full((len(angles), len(depths)), np.nan)
    grid[np.searchsorted(angles, angle), np.searchsorted(depths, depth)] = error
    return depths, angles, np.ma.masked_invalid(grid)
