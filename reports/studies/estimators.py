# SPDX-License-Identifier: BSD-3-Clause
"""Studies of the Monte Carlo estimators: convergence, standardised errors."""

from functools import partial
from typing import Any

from reports.api.inputs import Progress, SceneLike, one_error, telling
from reports.machine.progress import counted, part_of
from reports.studies.result import Study, with_environment
from reports.tables.table import numbers, table, words

_SAMPLES = 16  # samples a pixel in each batch
_SIZE, _BATCHES = (64, 48), 64
_CONVERGING = ("single-scatter", "volpath")


@one_error
def convergence(scene: SceneLike = "open-fog", *, progress: Progress = None) -> Study:
    """Measure how the Monte Carlo estimators converge.

    The RMSE over all compared pixels of the mean of the first batches, against the quadrature, over the samples a
    pixel; without a bias it falls with the order 1/2. For volpath the quadrature is that of the shadow ray that it
    traces.

    Parameters
    ----------
    scene
        A built-in scene, random:SEED or a Mitsuba XML file.
    progress
        Called with (fraction done, what); True shows a bar.
    """
    from reports.machine.environment import activate

    activate()
    import numpy as np

    from reports.api.scenes import opened
    from validation.estimates.agreement import estimator_truth, layer_mean
    from validation.estimates.monte_carlo import monte_carlo_batches
    from validation.study.maps import fitted_slope

    loaded = opened(scene, _SIZE).scene
    rows: list[dict[str, Any]] = []
    with telling(progress, "convergence") as tell:
        for at, estimator in enumerate(_CONVERGING):
            part = counted(part_of(tell, 0.5 * at, 0.5 + 0.5 * at))
            expected, mask = estimator_truth(loaded, estimator)
            counts, errors = [2**k for k in range(1, _BATCHES.bit_length())], []
            for count in counts:  # every number of batches begins with those before
                how: dict[str, Any] = {"batches": count, "samples": _SAMPLES, "progress": part}
                mean = layer_mean(monte_carlo_batches(loaded, estimator, **how).batches, "airlight", mask)[mask]
                errors.append(float(np.sqrt(np.mean((mean - expected) ** 2)) / expected.mean()))
            samples = [_SAMPLES * count for count in counts]
            order, _ = fitted_slope(samples, errors)
            rows += [
                {"estimator": estimator, "samples": count, "relative_rmse": error, "order": order}
                for count, error in zip(samples, errors)
            ]
    columns = (*words("estimator"), *numbers("samples", relative_rmse="rel. RMSE", order="order"))
    drawn = table(f"{scene}, {_SIZE[0]} x {_SIZE[1]}: convergence, wanted order 0.5", columns, rows)
    data = with_environment(scene=str(scene), size=list(_SIZE), rows=rows)
    return Study(name="convergence", data=data, drawn=(drawn,), rows=tuple(rows), draw=partial(_draw_convergence, rows))


def _draw_convergence(rows: list[dict[str, Any]], column: str) -> Any:
    import numpy as np

    from reports.plotting.figure import name_sizes, new_figure
    from reports.plotting.style import COLOURS, WIDTHS

    width = WIDTHS[column]
    figure = new_figure(width, (0.4 if column == "double" else 0.7) * width)
    panel = figure.subplots()
    for name, colour, marker in zip(_CONVERGING, ("blue", "vermillion"), "os"):
        own = [row for row in rows if row["estimator"] == name]
        samples, errors = (np.array([row[key] for row in own]) for key in ("samples", "relative_rmse"))
        order = own[0]["order"]
        style: dict[str, Any] = {"color": COLOURS[colour], "marker": marker}
        panel.plot(samples, errors, linestyle="none", label=f"{name}: order {order:.3g}, wanted 0.5", **style)
        level = np.exp(np.mean(np.log(errors * samples**order)))
        panel.plot(samples, level * samples**-order, color=COLOURS[colour])
    panel.set(xlabel="samples a pixel [1]", ylabel="relative RMSE of the airlight [1]", xscale="log", yscale="log")
    name_sizes(panel, sorted({row["samples"] for row in rows})[::2])
    panel.legend()
    return figure


#: Samples a pixel in each batch; volpath needs more of them until its batch means are nearly normal.
_STANDARDISED = {"single-scatter": 64, "volpath": 256}
_Z_SIZE = (80, 60)
_EDGE, _BINS = 5.0, 50  # of the histogram; values beyond are counted in the outermost bins


@one_error
def z_distribution(scene: SceneLike = "open-fog", *, progress: Progress = None) -> Study:
    """Measure how the standardised errors of the Monte Carlo estimators are distributed.

    z = (estimate - quadrature) / standard error, one value for each compared pixel, of the first channel that is lit.
    The standard error comes from K batch means, so without a bias z follows Student's law with K - 1 degrees of
    freedom, close to the normal law.

    Parameters
    ----------
    scene
        A built-in scene, random:SEED or a Mitsuba XML file.
    progress
        Called with (fraction done, what); True shows a bar.
    """
    from reports.machine.environment import activate

    activate()
    import numpy as np
    from scipy.stats import t

    from reports.api.scenes import opened

    loaded = opened(scene, _Z_SIZE).scene
    edges = np.linspace(-_EDGE, _EDGE, _BINS + 1)
    outer = edges.copy()
    outer[[0, -1]] = -np.inf, np.inf
    rows: list[dict[str, Any]] = []
    moments = []
    with telling(progress, "z-distribution") as tell:
        for at, (estimator, samples) in enumerate(_STANDARDISED.items()):
            z = _z(loaded, estimator, samples, counted(part_of(tell, 0.5 * at, 0.5 + 0.5 * at)))
            counts = np.histogram(z, outer)[0]
            expected = len(z) * np.diff(t.cdf(outer, _BATCHES - 1))
            moments.append({"estimator": estimator, "pixels": len(z), "mean": float(z.mean()), "std": float(z.std())})
            bins = zip(edges[:-1].tolist(), edges[1:].tolist(), counts.tolist(), expected.tolist())
            keys = ("low", "high", "count", "expected")
            rows += [{"estimator": estimator, **dict(zip(keys, each))} for each in bins]
    columns = (*words("estimator"), *numbers("pixels", mean="mean of z", std="st. deviation of z"))
    drawn = table(f"{scene}, {_Z_SIZE[0]} x {_Z_SIZE[1]}: standardised errors", columns, moments)
    data = with_environment(scene=str(scene), size=list(_Z_SIZE), batches=_BATCHES, estimators=moments, bins=rows)
    return Study(
        name="z-distribution", data=data, drawn=(drawn,), rows=tuple(rows), draw=partial(_draw_z, rows, moments)
    )


def _z(scene: Any, estimator: str, samples: int, progress: Any) -> Any:
    """Return z of the compared pixels that have a standard error, (n,)."""
    import numpy as np

    from validation.estimates.agreement import batch_estimate, estimator_truth
    from validation.estimates.monte_carlo import monte_carlo_batches

    expected, mask = estimator_truth(scene, estimator)
    batches = monte_carlo_batches(scene, estimator, batches=_BATCHES, samples=samples, progress=progress).batches
    estimate = batch_estimate(batches, "airlight", mask)
    error, mean = (np.asarray(layer)[mask] for layer in (estimate.standard_error, estimate.mean))
    channel = int(np.argmax(expected.sum(axis=0) > 0))
    tested = error[:, channel] > 0
    return ((mean - expected)[:, channel] / np.where(tested, error[:, channel], 1.0))[tested]


def _draw_z(rows: list[dict[str, Any]], moments: list[dict[str, Any]], column: str) -> Any:
    import numpy as np

    from reports.plotting.figure import new_figure
    from reports.plotting.style import COLOURS, WIDTHS, reference_style

    width, double = WIDTHS[column], column == "double"
    figure = new_figure(width, 0.4 * width if double else 1.3 * width)
    shape = (1, len(moments)) if double else (len(moments), 1)
    panels = figure.subplots(*shape, squeeze=False).ravel()
    for panel, of in zip(panels, moments):
        own = [row for row in rows if row["estimator"] == of["estimator"]]
        low, high, count, expected = (np.array([row[k] for row in own]) for k in ("low", "high", "count", "expected"))
        middle, spread = 0.5 * (low + high), 2 * np.sqrt(expected)  # counts of pixels follow Poisson's law
        panel.bar(low, count, high - low, align="edge", color=COLOURS["sky"], label="pixels")
        panel.plot(middle, expected, label=f"Student's law, {_BATCHES - 1} degrees", **reference_style())
        band = {"color": "black", "alpha": 0.2, "linewidth": 0, "label": "±2 standard deviations"}
        panel.fill_between(middle, expected - spread, expected + spread, **band)
        mean = f"mean {of['mean']:+.3f} ± {1 / np.sqrt(of['pixels']):.3f}"
        panel.set_title(f"{of['estimator']}: {mean}, spread {of['std']:.3f}")
        panel.set(xlabel="z [1]", ylabel="pixels in a bin [1]")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3 if double else 1)
    return figure
