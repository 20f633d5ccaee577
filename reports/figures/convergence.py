# SPDX-License-Identifier: BSD-3-Clause
"""The figure of convergence: every family of kernels with its declared order or rate, and the Monte Carlo estimators.

Kernels: the largest relative error in float64 over the rays that show the declared order or rate, over the size
(`validation.kernels.convergence`); the fitted law is drawn through the last error that counts. Estimators: the RMSE
over all compared pixels of the mean of the first batches, against the quadrature image, over the samples a pixel;
without a bias it falls with the order 1/2. For volpath the image is that of the shadow ray that it traces
(`validation.estimates.agreement`).
"""

from pathlib import Path

from reference.storage.files import ensure_folder
from reports.figures.files import name_sizes, new_figure, read_data, values, write_data
from reports.machine.progress import Progress, counted, part_of
from reports.plotting.style import COLOURS, WIDTHS, kernel_style

NAME = "convergence"
SUMMARY = "convergence of each kernel and of each Monte Carlo estimator, with slopes"

SCENE = "open-fog"
ESTIMATORS = ("single-scatter", "volpath")
_SAMPLES = 16  # samples a pixel in each batch
_HEADER = ("panel", "name", "size", "error", "kind", "declared", "measured", "power")
_PANELS = {
    "order": ("size of the kernel [1]", "largest relative error of J [1]"),
    "rate": ("size of the kernel [1]", "largest relative error of J [1]"),
    "estimator": ("samples a pixel [1]", "relative RMSE of the airlight [1]"),
}
_ESTIMATOR_STYLES = {
    "single-scatter": {"color": COLOURS["blue"], "marker": "o"},
    "volpath": {"color": COLOURS["vermillion"], "marker": "s"},
}


def compute(folder: Path | str, *, quick: bool = False, scene: str = SCENE, progress: Progress | None = None) -> None:
    """Write `convergence.csv` into a folder: errors by kernel and size, by estimator and samples, with the slopes.

    Parameters
    ----------
    quick
        A smaller image and fewer samples.
    scene
        Of the estimators: a built-in scene or the path of a Mitsuba XML file.
    """
    from validation.kernels.convergence import convergence, declared

    target = ensure_folder(folder)
    step = progress or (lambda share, what: None)
    promises = declared()
    rows: list[tuple] = []
    for number, (name, promise) in enumerate(promises.items()):
        step(0.4 * number / len(promises), name)
        measured = convergence(name)
        law = (promise.kind, promise.value, measured.measured, promise.power)
        rows += [(promise.kind, name, size, error, *law) for size, error in zip(measured.sizes, measured.errors)]
    image, batches = ((32, 24), 16) if quick else ((64, 48), 64)
    for number, estimator in enumerate(ESTIMATORS):
        part = counted(part_of(step, 0.4 + 0.3 * number, 0.7 + 0.3 * number))
        rows += _estimator_rows(scene, image, estimator, batches, part)
    write_data(target, NAME, _HEADER, rows, scene=scene, image=image, batches=batches, samples=_SAMPLES)


def _estimator_rows(scene: str, image: tuple[int, int], estimator: str, batches: int, progress) -> list[tuple]:
    """Return rows of the error over samples of an estimator; every number of batches begins with those before."""
    import numpy as np

    from validation.estimates.agreement import layer_mean
    from validation.estimates.expected_airlight import estimator_truth
    from validation.estimates.monte_carlo import monte_carlo_batches
    from validation.frames.map_size import fitted_slope
    from validation.scenes.loading import load_scene

    loaded = load_scene(scene, image).scene
    expected, mask = estimator_truth(loaded, estimator)
    counts = [2**k for k in range(1, batches.bit_length())]
    errors = []
    for count in counts:
        traced = monte_carlo_batches(loaded, estimator, batches=count, samples=_SAMPLES, progress=progress).batches
        mean = layer_mean(traced, "airlight", mask)[mask]
        errors.append(float(np.sqrt(np.mean((mean - expected) ** 2)) / expected.mean()))
    samples = [_SAMPLES * count for count in counts]
    law = ("order", 0.5, fitted_slope(samples, errors).order, 0.0)
    return [("estimator", estimator, size, error, *law) for size, error in zip(samples, errors)]


def draw(folder: Path, column: str):
    """Return the figure, see `reports.figures.files.plot`."""
    rows = read_data(folder, NAME)
    width = WIDTHS[column]
    double = column == "double"
    figure = new_figure(width, 0.42 * width if double else 2.5 * width)
    panels = figure.subplots(*((1, 3) if double else (3, 1)))
    for panel, (kind, (across, up)) in zip(panels, _PANELS.items()):
        chosen = [row for row in rows if row["panel"] == kind]
        for name in dict.fromkeys(row["name"] for row in chosen):
            _curve(panel, kind, [row for row in chosen if row["name"] == name], name)
        panel.set(xlabel=across, ylabel=up, yscale="log", xscale="linear" if kind == "rate" else "log")
        if kind != "rate":
            name_sizes(panel, sorted(set(values(chosen, "size")))[:: 1 if kind == "order" else 2])
        panel.legend(loc="upper center", bbox_to_anchor=(0.5, -0.2 if double else -0.18))
    return figure


def _curve(panel, kind: str, rows: list[dict[str, str]], name: str) -> None:
    """Draw errors and the law that was fitted to them."""
    import numpy as np

    style = _ESTIMATOR_STYLES[name] if kind == "estimator" else kernel_style(name)
    sizes, errors = np.array(values(rows, "size")), np.array(values(rows, "error"))
    declared, measured, power = (values(rows[:1], key)[0] for key in ("declared", "measured", "power"))
    word = "rate" if kind == "rate" else "order"
    label = f"{name}: {word} {measured:.3g}, declared {declared:g}"
    panel.plot(sizes, errors, linestyle="none", label=label, **style)
    law = sizes**power * measured**sizes if kind == "rate" else sizes**-measured
    shown = (errors > 3e-12) & ((errors < 0.3) | (kind == "estimator"))  # what `validation.kernels.convergence` fits
    if np.isfinite(measured) and shown.any():
        level = np.exp(np.mean(np.log(errors[shown] / law[shown])))
        panel.plot(sizes[shown], level * law[shown], color=style["color"])
