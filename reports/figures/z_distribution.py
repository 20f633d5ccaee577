# SPDX-License-Identifier: BSD-3-Clause
"""The figure of z: how the standardised errors of the Monte Carlo estimators are distributed, beside their law.

z = (estimate - quadrature) / standard error, one value for each channel of each compared pixel. The standard error
comes from K batch means, so without a bias z follows Student's law with K - 1 degrees of freedom, close to the normal
law. Channels of one pixel share their paths; one channel is shown, the first that is lit.
"""

from pathlib import Path

from reference.storage.files import ensure_folder
from reports.figures.files import new_figure, read_data, values, write_data
from reports.machine.progress import Progress, counted, part_of
from reports.plotting.style import COLOURS, WIDTHS, truth_style

NAME = "z-distribution"
SUMMARY = "distribution of z of single-scatter and volpath against the quadrature truth"

SCENE = "open-fog"
#: Samples a pixel in each batch; volpath needs more of them until its batch means are nearly normal.
ESTIMATORS = {"single-scatter": 64, "volpath": 256}
_BATCHES = 64
_EDGE, _BINS = 5.0, 50  # of the histogram; values beyond are counted in the outermost bins
_HEADER = ("estimator", "low", "high", "count", "expected", "normal", "tested", "batches", "z_mean", "z_std")


def compute(folder: Path | str, *, quick: bool = False, scene: str = SCENE, progress: Progress | None = None) -> None:
    """Write `z-distribution.csv` into a folder: how many values of z fall into each bin, and how many should.

    Parameters
    ----------
    quick
        A smaller image.
    scene
        A built-in scene or the path of a Mitsuba XML file.
    """
    import numpy as np
    from scipy.stats import norm, t

    from validation.scenes.loading import load_scene

    target = ensure_folder(folder)
    image = (32, 24) if quick else (80, 60)
    loaded = load_scene(scene, image).scene
    edges = np.linspace(-_EDGE, _EDGE, _BINS + 1)
    outer = edges.copy()
    outer[[0, -1]] = -np.inf, np.inf
    rows: list[tuple] = []
    for number, (estimator, samples) in enumerate(ESTIMATORS.items()):
        step = counted(part_of(progress, number / len(ESTIMATORS), (number + 1) / len(ESTIMATORS)))
        z = _z(loaded, estimator, samples, step)
        counts = np.histogram(z, outer)[0]
        laws = (len(z) * np.diff(law) for law in (t.cdf(outer, _BATCHES - 1), norm.cdf(outer)))
        shared = (len(z), _BATCHES, float(z.mean()), float(z.std()))
        bins = zip(edges[:-1].tolist(), edges[1:].tolist(), counts.tolist(), *(law.tolist() for law in laws))
        rows += [(estimator, *counted_bin, *shared) for counted_bin in bins]
    write_data(target, NAME, _HEADER, rows, scene=scene, image=image, batches=_BATCHES, samples=ESTIMATORS)


def _z(scene, estimator: str, samples: int, progress):
    """Return z of the compared pixels that have a standard error, (n,)."""
    import numpy as np

    from validation.estimates.agreement import batch_estimate
    from validation.estimates.expected_airlight import estimator_truth
    from validation.estimates.monte_carlo import monte_carlo_batches

    expected, mask = estimator_truth(scene, estimator)
    batches = monte_carlo_batches(scene, estimator, batches=_BATCHES, samples=samples, progress=progress).batches
    estimate = batch_estimate(batches, "airlight", mask)
    error, mean = (np.asarray(layer)[mask] for layer in (estimate.standard_error, estimate.mean))
    channel = int(np.argmax(expected.sum(axis=0) > 0))
    tested = error[:, channel] > 0
    return ((mean - expected)[:, channel] / np.where(tested, error[:, channel], 1.0))[tested]


def draw(folder: Path, column: str):
    """Return the figure, see `reports.figures.files.plot`."""
    import numpy as np

    rows = read_data(folder, NAME)
    width = WIDTHS[column]
    double = column == "double"
    names = list(dict.fromkeys(row["estimator"] for row in rows))
    figure = new_figure(width, 0.4 * width if double else 1.3 * width)
    panels = figure.subplots(*((1, len(names)) if double else (len(names), 1)), squeeze=False).ravel()
    for panel, name in zip(panels, names):
        chosen = [row for row in rows if row["estimator"] == name]
        low, high, count, expected = (np.array(values(chosen, key)) for key in ("low", "high", "count", "expected"))
        middle = 0.5 * (low + high)
        panel.bar(low, count, high - low, align="edge", color=COLOURS["sky"], label="pixels")
        panel.plot(middle, expected, label=f"Student's law, {int(chosen[0]['batches']) - 1} degrees", **truth_style())
        # Counts of independent pixels follow Poisson's law.
        panel.fill_between(
            middle,
            expected - 2 * np.sqrt(expected),
            expected + 2 * np.sqrt(expected),
            color="black",
            alpha=0.2,
            linewidth=0,
            label="±2 standard deviations",
        )
        mean, spread, tested = (values(chosen[:1], key)[0] for key in ("z_mean", "z_std", "tested"))
        panel.set_title(f"{name}: mean {mean:+.3f} ± {1 / np.sqrt(tested):.3f}, spread {spread:.3f}")
        panel.set(xlabel="z [1]", ylabel="pixels in a bin [1]")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3 if double else 1)
    return figure
