# SPDX-License-Identifier: BSD-3-Clause
"""The figure of convergence of the Monte Carlo estimators.

The RMSE over all compared pixels of the mean of the first batches, against the quadrature image, over the samples a
pixel; without a bias it falls with the order 1/2. For volpath the image is that of the shadow ray that it traces
(`validation.estimates.agreement`).
"""

from pathlib import Path
from typing import Any

from reference.storage.files import ensure_folder
from reports.figures.files import name_sizes, new_figure, read_data, values, write_data
from reports.machine.progress import Progress, counted, part_of
from reports.plotting.style import COLOURS, WIDTHS

NAME = "convergence"
SUMMARY = "convergence of each Monte Carlo estimator, with its slope"

SCENE = "open-fog"
ESTIMATORS = ("single-scatter", "volpath")
_SAMPLES = 16  # samples a pixel in each batch
_HEADER = ("name", "samples", "error", "measured")
_STYLES: dict[str, dict[str, Any]] = {
    "single-scatter": {"color": COLOURS["blue"], "marker": "o"},
    "volpath": {"color": COLOURS["vermillion"], "marker": "s"},
}


def compute(folder: Path | str, *, quick: bool = False, scene: str = SCENE, progress: Progress | None = None) -> None:
    """Write `convergence.csv` into a folder: errors by estimator and samples, with the slopes.

    Parameters
    ----------
    quick
        A smaller image and fewer samples.
    scene
        Of the estimators: a built-in scene or the path of a Mitsuba XML file.
    """
    target = ensure_folder(folder)
    step = progress or (lambda share, what: None)
    rows: list[tuple] = []
    image, batches = ((32, 24), 16) if quick else ((64, 48), 64)
    for number, estimator in enumerate(ESTIMATORS):
        part = counted(part_of(step, 0.5 * number, 0.5 + 0.5 * number))
        rows += _estimator_rows(scene, image, estimator, batches, part)
    write_data(target, NAME, _HEADER, rows, scene=scene, image=image, batches=batches, samples=_SAMPLES)


def _estimator_rows(scene: str, image: tuple[int, int], estimator: str, batches: int, progress) -> list[tuple]:
    """Return rows of the error over samples of an estimator; every number of batches begins with those before."""
    import numpy as np

    from validation.estimates.agreement import layer_mean
    from validation.estimates.expected_airlight import estimator_truth
    from validation.estimates.monte_carlo import monte_carlo_batches
    from validation.scenes.loading import load_scene
    from validation.study.maps import fitted_slope

    loaded = load_scene(scene, image).scene
    expected, mask = estimator_truth(loaded, estimator)
    counts = [2**k for k in range(1, batches.bit_length())]
    errors = []
    for count in counts:
        traced = monte_carlo_batches(loaded, estimator, batches=count, samples=_SAMPLES, progress=progress).batches
        mean = layer_mean(traced, "airlight", mask)[mask]
        errors.append(float(np.sqrt(np.mean((mean - expected) ** 2)) / expected.mean()))
    samples = [_SAMPLES * count for count in counts]
    order = fitted_slope(samples, errors).order
    return [(estimator, count, error, order) for count, error in zip(samples, errors)]


def draw(folder: Path, column: str):
    """Return the figure, see `reports.figures.files.plot`."""
    import numpy as np

    rows = read_data(folder, NAME)
    width = WIDTHS[column]
    figure = new_figure(width, (0.4 if column == "double" else 0.7) * width)
    panel = figure.subplots()
    for name, style in _STYLES.items():
        own = [row for row in rows if row["name"] == name]
        samples, errors = np.array(values(own, "samples")), np.array(values(own, "error"))
        order = values(own[:1], "measured")[0]
        panel.plot(samples, errors, linestyle="none", label=f"{name}: order {order:.3g}, wanted 0.5", **style)
        level = np.exp(np.mean(np.log(errors * samples**order)))
        panel.plot(samples, level * samples**-order, color=style["color"])
    panel.set(xlabel="samples a pixel [1]", ylabel="relative RMSE of the airlight [1]", xscale="log", yscale="log")
    name_sizes(panel, sorted(set(values(rows, "samples")))[::2])
    panel.legend()
    return figure
