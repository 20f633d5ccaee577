# SPDX-License-Identifier: BSD-3-Clause
"""The figure of the polynomials: the airlight kernel over the angle at the light, and Biri's
polynomials for it.

`compute` writes the data, `plot` only reads them. For each phase function of Biri 2006 and some a = sigma_t height:

    f(theta) = exp(-a (tan(theta/2 + pi/4) - 1)) p(-sin theta),

exact, by the derived Taylor polynomial of degree 4 and by the one printed in the annex; and the shares of rays that the
three kernels integrate to within 1 % and 10 % (`validation.kernels.biri_misprints`).
"""

from pathlib import Path

from reference.storage.files import ensure_folder
from reports.figures.files import new_figure, read_data, values, write_csv, write_data
from reports.plotting.style import WIDTHS, kernel_style, truth_style

NAME = "polynomials"
SUMMARY = "the airlight kernel over theta, beside Biri's polynomials, derived and as printed"
THICKNESSES = (0.1, 0.5, 2.0)
_PHASES = ("isotropic", "rayleigh", "hazy", "murky")
_CURVES = ("exact", "taylor", "taylor-printed")


def compute(folder: Path | str, *, rays: int = 100_000) -> None:
    """Write `polynomials.csv` (the curves) and `polynomials-shares.csv` (the shares of rays) into a folder.

    Parameters
    ----------
    rays
        Quasi-random rays of which the shares are counted.
    """
    import numpy as np

    from validation.kernels.biri_misprints import printed_against_derived

    target = ensure_folder(folder)
    theta = np.linspace(-1.5, 1.5, 301)
    rows = []
    for phase in _PHASES:
        for a in THICKNESSES:
            curves = _curves(phase, a, theta)
            rows += [(phase, a, *values) for values in zip(theta, *(curves[name] for name in _CURVES))]
    shares = [
        (share.phase, share.region, share.kernel, share.rays, share.within_1_percent, share.within_10_percent)
        for share in printed_against_derived(rays)
    ]
    header = ("phase", "region", "kernel", "rays", "within_1_percent", "within_10_percent")
    write_csv(target / f"{NAME}-shares.csv", header, shares)
    write_data(target, NAME, ("phase", "a", "theta", *_CURVES), rows, rays=rays)


def _curves(phase: str, a: float, theta):
    import numpy as np

    from analytic.phase import PhaseFunction
    from analytic.series import taylor_coefficients
    from realtime.kernels.taylor_printed import printed_coefficients

    function = PhaseFunction(phase)
    exact = np.exp(-a * (np.tan(0.5 * theta + 0.25 * np.pi) - 1)) * function(-np.sin(theta))
    derived = np.ravel(taylor_coefficients(a, function))
    # The annex prints c0 to c2 and, for the isotropic case, c3 and c4; the others come from the derivation.
    printed = [float(c) for c in printed_coefficients(a, phase)]
    printed += list(derived[len(printed) :])
    polynomials = {name: np.polyval(c[::-1], theta) for name, c in (("taylor", derived), ("taylor-printed", printed))}
    return {"exact": exact, **polynomials}


def draw(folder: Path, column: str):
    """Return the figure, see `reports.figures.files.plot`."""
    import numpy as np

    rows = read_data(folder, NAME)
    styles = {
        "exact": truth_style(),
        "taylor": {"color": kernel_style("taylor")["color"], "linestyle": "--"},
        "taylor-printed": {"color": kernel_style("taylor-printed")["color"], "linestyle": ":"},
    }
    width = WIDTHS[column]
    figure = new_figure(width, 0.95 * width if column == "double" else 1.15 * width)
    panels = figure.subplots(len(_PHASES), len(THICKNESSES), sharex=True, squeeze=False)
    for line, phase in zip(panels, _PHASES):
        for panel, a in zip(line, THICKNESSES):
            chosen = [row for row in rows if row["phase"] == phase and float(row["a"]) == a]
            exact = np.array(values(chosen, "exact"))
            for name, style in styles.items():
                panel.plot(values(chosen, "theta"), values(chosen, name), label=name, **style)
            panel.set_ylim(-0.25 * exact.max(), 1.25 * exact.max())
            panel.set_title(f"{phase}, a = {a:g}")
    for panel in panels[-1]:
        panel.set_xlabel("theta [rad]")
    for line in panels:
        line[0].set_ylabel("f(theta) [1]")
    handles, labels = panels[0][0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3)
    return figure
