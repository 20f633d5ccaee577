# SPDX-License-Identifier: BSD-3-Clause
"""The study of Biri's polynomials beside the kernel that they approximate."""

from functools import partial
from typing import Any

from reports.api.inputs import with_kernels
from reports.studies.result import Study
from reports.tables.table import table_of

_RAYS = 100_000  # quasi-random, of which the fractions are counted
_THICKNESSES = (0.1, 0.5, 2.0)
_BIRI = ("isotropic", "rayleigh", "hazy", "murky")
_CURVES = ("exact", "taylor", "taylor-printed")


@with_kernels
def polynomials() -> Study:
    """Compare Biri's polynomials with the airlight kernel over the angle.

    For each phase function of Biri 2006 and some a = sigma_t height:

        f(theta) = exp(-a (tan(theta/2 + pi/4) - 1)) p(-sin theta),

    exact, by the derived Taylor polynomial of degree 4 and by the one printed in the annex; and the fractions of rays
    that the three kernels integrate to within 1 % and 10 %.
    """
    import numpy as np

    from validation.columns import plain
    from validation.papers.formulas import WithinError, printed_against_derived

    theta = np.linspace(-1.5, 1.5, 301)
    rows = []
    for phase in _BIRI:
        for a in _THICKNESSES:
            curves = _curves(phase, a, theta)
            for values in zip(theta.tolist(), *(curves[name].tolist() for name in _CURVES)):
                rows.append({"phase": phase, "a": a, **dict(zip(("theta", *_CURVES), values))})
    within = list(printed_against_derived(_RAYS))
    percent = {key: {"percent": True} for key in ("within_1_percent", "within_10_percent")}
    drawn = table_of("Fractions of rays that a kernel integrates within an error", WithinError, within, how=percent)
    data = {"rays": _RAYS, "within": plain(within), "curves": rows}
    return Study(
        name="polynomials", data=data, tables=(drawn,), rows=tuple(rows), draw=partial(_draw_polynomials, rows)
    )


def _curves(phase: str, a: float, theta: Any) -> dict[str, Any]:
    import numpy as np

    from analytic.phase import PhaseFunction
    from analytic.series import taylor_coefficients
    from realtime.kernels.taylor import printed_coefficients

    function = PhaseFunction(phase)
    exact = np.exp(-a * (np.tan(0.5 * theta + 0.25 * np.pi) - 1)) * function(-np.sin(theta))
    derived = np.ravel(taylor_coefficients(a, function))
    # The annex prints c0 to c2 and, for the isotropic case, c3 and c4; the others come from the derivation.
    printed = [float(c) for c in printed_coefficients(a, phase)]
    printed += list(derived[len(printed) :])
    polynomials = {name: np.polyval(c[::-1], theta) for name, c in (("taylor", derived), ("taylor-printed", printed))}
    return {"exact": exact, **polynomials}


def _draw_polynomials(rows: list[dict[str, Any]], column: str) -> Any:
    from reports.plotting.figure import new_figure
    from reports.plotting.style import WIDTHS, kernel_style, reference_style

    styles = {
        "exact": reference_style(),
        "taylor": {"color": kernel_style("taylor")["color"], "linestyle": "--"},
        "taylor-printed": {"color": kernel_style("taylor-printed")["color"], "linestyle": ":"},
    }
    width = WIDTHS[column]
    figure = new_figure(width, 0.95 * width if column == "double" else 1.15 * width)
    panels = figure.subplots(len(_BIRI), len(_THICKNESSES), sharex=True, squeeze=False)
    for line, phase in zip(panels, _BIRI):
        for panel, a in zip(line, _THICKNESSES):
            own = [row for row in rows if (row["phase"], row["a"]) == (phase, a)]
            largest = max(row["exact"] for row in own)
            for name, style in styles.items():
                panel.plot([row["theta"] for row in own], [row[name] for row in own], label=name, **style)
            panel.set_ylim(-0.25 * largest, 1.25 * largest)
            panel.set_title(f"{phase}, a = {a:g}")
    for panel in panels[-1]:
        panel.set_xlabel("theta [rad]")
    for line in panels:
        line[0].set_ylabel("f(theta) [1]")
    handles, labels = panels[0][0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3)
    return figure
