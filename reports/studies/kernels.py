# SPDX-License-Identifier: BSD-3-Clause
"""Studies of kernels: costs, where they break, integrals of a file."""

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

from airlight.errors import InputError
from airlight.reports.api.inputs import (
    File,
    KernelLike,
    Kernels,
    Progress,
    kernel_name,
    one_error,
    several,
    telling,
    with_kernels,
)
from airlight.reports.machine.progress import counted
from airlight.reports.studies.registry import Study, with_environment
from airlight.reports.tables.costs import kernel_tables, stability_summary
from airlight.reports.tables.table import Column, table

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from airlight.validation.kernels.case_files import Cases
    from airlight.validation.kernels.records import KernelCost, Stability

    CasesLike: TypeAlias = Mapping[str, Any] | Cases | File
else:
    CasesLike = File

# Costs

_STATISTICS = {"median": "half of the rays", "p99": "99 % of the rays", "max": "worst ray"}


@with_kernels
def kernels(*, kernel: Kernels = (), phase: str | None = None, progress: Progress = None) -> Study:
    """Time airlight kernels alone and measure their errors.

    ns/ray: the kernel alone by Dr.Jit's history, median. The figure shows time against error in
    isotropic fog, a line for each kernel over its sizes.

    Parameters
    ----------
    kernel
        A kernel of `airlight list kernels`; may be given several times, all by default.
    phase
        One phase function instead of the usual ones, such as hg-draine:12 or mie:6.
    progress
        Called with (fraction done, what); True shows a bar.
    """
    from airlight.analytic.phase import HenyeyGreenstein, phase_from_words
    from airlight.validation.kernels.benchmark import PHASES, bench_kernels, speed_against_error

    # One phase function if the user names it, else the standard ones.
    phases: tuple[tuple[str, float], ...] = PHASES
    if phase is not None:
        chosen = phase_from_words(phase)
        phases = ((phase, chosen.g if isinstance(chosen, HenyeyGreenstein) else 0.0),)
    named = [kernel_name(each) or "" for each in several(kernel)] or None
    with telling(progress, "kernels") as tell:
        found = bench_kernels(named, phases=phases, progress=counted(tell))
    # Which kernel is the cheapest at each error.
    levels = speed_against_error(found)
    return Study(
        name="kernels",
        data=with_environment(kernels={"costs": found, "levels": levels}),
        tables=tuple(kernel_tables(found, levels)),
        lines=("ns/ray: the kernel alone by Dr.Jit's history, median.",),
        # The figure shows the first phase function only: isotropic fog by default.
        draw=partial(
            _draw_costs, [cost for cost in found if cost.phase == phases[0][0] and cost.time]
        ),
    )


def _draw_costs(costs: "Sequence[KernelCost]", column: str) -> Any:
    """Return nanoseconds a ray against the error."""
    from airlight.reports.plotting.figure import new_figure
    from airlight.reports.plotting.style import WIDTHS, kernel_styles

    # A panel for each statistic of the error, a line for each kernel over its sizes; the axes are
    # shared, so that panels compare.
    width, double = WIDTHS[column], column == "double"
    figure = new_figure(width, 0.42 * width if double else 1.9 * width)
    panels = figure.subplots(*((1, 3) if double else (3, 1)), sharex=True, sharey=True)
    least, most = 1e-7, 10.0  # errors
    styles = kernel_styles(dict.fromkeys(cost.family for cost in costs))
    for panel, (statistic, title) in zip(panels, _STATISTICS.items()):
        for family, style in styles.items():
            # By time; errors outside the range are drawn at its edge, and so are those of all rays
            # of a kernel that gave values that are not finite.
            points = sorted(
                (cost.time.median, most if cost.nonfinite and statistic != "median" else error)
                for cost in costs
                if cost.family == family
                and cost.time
                and (error := getattr(cost, statistic)) is not None
            )
            times = [point[0] for point in points]
            errors = [min(max(point[1], least), most) for point in points]
            panel.plot(times, errors, label=family, linestyle="-", clip_on=False, zorder=3, **style)
        panel.set(xscale="log", yscale="log", xlabel="time of a ray [ns]", title=title)
        panel.set_ylim(0.6 * least, 1.6 * most)
    for panel in panels if not double else panels[:1]:
        panel.set_ylabel("relative error of J [1]")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=6 if double else 3)
    return figure


# Where they break

_TRIED_RAYS = 100_000


@with_kernels
def stability(*, kernel: Kernels = (), progress: Progress = None) -> Study:
    """Look for rays on which kernels break.

    Tries every kernel on certified values and on rays of every magnitude. Prints the ray of each
    largest error in the format of `airlight study integrals`. The exit status is 1 if a kernel that
    claims to be exact exceeds the error that it claims.

    Parameters
    ----------
    kernel
        A kernel, 'name-N' or 'module:function'; may be given several times, all by default.
    progress
        Called with (fraction done, what); True shows a bar.
    """
    from airlight.validation.kernels.stability import BAR, CERTIFIED
    from airlight.validation.kernels.stability import stability as run

    # All kernels by default.
    named = [kernel_name(each) or "" for each in several(kernel)] or None
    with telling(progress, "stability") as tell:
        stabilities = run(named, count=_TRIED_RAYS, progress=counted(tell))
    return Study(
        name="stability",
        data=with_environment(certified=CERTIFIED, bar=BAR, kernels=stabilities),
        tables=(stability_summary(stabilities),),
        lines=tuple(line for one in stabilities for line in _stability_lines(one)),
        broken=tuple(f"{one.kernel}: {each}" for one in stabilities for each in one.broken),
    )


def _stability_lines(found: "Stability") -> Iterator[str]:
    for phase, reason in found.refused.items():
        yield f"{found.kernel} refuses {phase}: {reason}"
    for rays in found.sets:
        worst = [errors["all"].worst for errors in (rays.single, rays.double)]
        if any(worst):
            yield f"worst rays of {found.kernel}, float32 then float64:"
            yield from (rays.columns, *filter(None, worst))
    yield from (f"BROKEN: {found.kernel}, {reason}" for reason in found.broken)


# Integrals of a file


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Integrals(Study):
    """The airlight integral of some cases by a kernel."""

    J: "NDArray[np.float64]"  #: by the kernel [1/m], of the shape of the columns that were given
    #: certified, or as given by the file [1/m], of the same shape
    value: "NDArray[np.float64] | None"
    kernel: str
    precision: str  #: 'single' or 'double'
    cases: "Cases"  #: the cases, one after the other

    @property
    def summary(self) -> Mapping[str, Any]:
        """The number of rows and, with values to compare, the quantiles of the relative error."""
        found: Mapping[str, Any] = self.data
        return found

    @property
    def error(self) -> "NDArray[np.float64] | None":
        """The signed relative error (J - value) / value; None where there is
        nothing to compare with.
        """
        import numpy as np

        if self.value is None:
            return None
        # Equal values have no error, also where both are zero.
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(self.value == self.J, 0.0, (self.J - self.value) / np.abs(self.value))

    def __len__(self) -> int:
        return self.J.size

    def columns(self) -> dict[str, list[Any]]:
        """Return columns by name, a value for each case, as `pandas.DataFrame` takes them."""
        import numpy as np

        # Inputs and results side by side, case by case.
        cases = self.cases
        names = {"phase": cases.phase, "g": cases.g, "foot": cases.foot, "height": cases.height}
        names |= {"x0": cases.x0, "x1": cases.x1, "sigma_t": cases.sigma_t, "J": self.J.reshape(-1)}
        names |= {} if self.value is None else {"value": self.value.reshape(-1)}
        return {name: np.asarray(values).tolist() for name, values in names.items()}

    def save(self, path: Path | str, column: str = "double") -> Path:
        """Write the rows with a column `result` (.csv), or what `Study.save`
        writes; return the path.
        """
        if Path(path).suffix.lower() != ".csv":
            return super().save(path, column)
        from airlight.validation.kernels.cases import write_results

        write_results(self.cases, self.J.reshape(-1), Path(path))
        return Path(path)

    @property
    def title(self) -> str:
        """How many, by what, and how wrong."""
        found, said = self.summary, ""
        if found["compared"]:
            errors = ", ".join(f"{name} {found[name]:.3g}" for name in ("p50", "p99", "max"))
            said = f"; relative error of {found['compared']}: {errors}; worst in row {found['worst_row']}"
        return f"{len(self)} integrals by {self.kernel} in {self.precision} precision{said}"


@one_error
def integrals(
    cases: CasesLike,
    kernel: KernelLike = "exact",
    *,
    precision: Literal["single", "double"] = "single",
    certify: bool = False,
) -> Integrals:
    """Integrate the airlight of each row of a CSV file by a kernel.

    Rows that have a value are compared with it. Results that are not finite are
    refused, with the first row.

    Parameters
    ----------
    cases
        A CSV file with the columns `foot`, `height`, `x0`, `x1` [m] and `sigma_t` [1/m]; x1 may be
        inf. The column `phase` may name isotropic (the default), rayleigh, hazy, murky, hg (with
        its mean cosine in a column `g`), hg-draine:DIAMETER, mie:RADIUS:GAMMA:WAVELENGTH or
        mie-modified; `value` is what to compare with. From Python also columns by name, of any
        shapes that broadcast together, or a data frame; `origin`, `direction` and `light`, (...,
        3), may stand for `foot` and `height`.
    kernel
        Airlight kernel, see `airlight list kernels`.
    precision
        Whether the kernel computes in float32 (single) or float64 (double).
    certify
        Also integrate by adaptive quadrature in float64, to 1e-10, and compare with that
        where no value is given.

    Examples
    --------
    >>> import airlight, numpy as np
    >>> rays = {"phase": "isotropic", "foot": np.linspace(-2, 2, 5), "height": 0.3, "x0": 0, "x1": np.inf}
    >>> found = airlight.study("integrals", rays | {"sigma_t": 0.2}, "exact", certify=True)
    >>> found.J.shape
    (5,)
    >>> bool(abs(found.error).max() < 1e-5)
    True
    """
    from airlight.reports.machine.environment import activate
    from airlight.validation.kernels.case_files import integrate_cases as certified

    # Files and columns are checked before Mitsuba starts.
    read, shape = _cases(cases)
    activate()
    from airlight.validation.kernels.cases import check_results, integrate_cases, summary

    named = kernel_name(kernel) or "exact"
    J = integrate_cases(read, named, precision)
    # Rows of a file whose results are not finite are refused; arrays from Python may hold one.
    if isinstance(cases, str | os.PathLike):
        check_results(read, J, named)
    # Values of the file have precedence over a new integration.
    if certify and read.value is None:
        read = replace(read, value=certified(read)[0])
    found = Integrals(
        name="integrals",
        data=summary(read, J, precision),
        J=_sealed(J, shape),
        value=None if read.value is None else _sealed(read.value, shape),
        kernel=named,
        precision=precision,
        cases=read,
    )
    # A notebook shows the first rows with their numbers.
    data = {"": list(range(len(found)))} | found.columns()
    count = 12
    more = f"and {len(found) - count} more" if len(found) > count else ""
    shown = [Column(name, name, digits=9) for name in data]
    first = table("", shown, list(zip(*data.values()))[:count], explanation=more)
    return replace(found, tables=(first,), lines=(found.title,))


def _cases(cases: Any) -> "tuple[Cases, tuple[int, ...]]":
    from airlight.validation.kernels.case_files import Cases, cases_from_columns, read_cases

    if isinstance(cases, str | os.PathLike):
        cases = read_cases(Path(cases))
    # Columns may have any common shape, files have one row a case.
    if isinstance(cases, Cases):
        return cases, (len(cases.x0),)
    if not isinstance(cases, Mapping) and not hasattr(cases, "keys"):
        raise InputError(
            f"cases: got {type(cases).__name__}, expected columns by name or the path of a CSV file"
        )
    return cases_from_columns({str(name): cases[name] for name in cases})


def _sealed(values: Any, shape: tuple[int, ...]) -> Any:
    shaped = values.reshape(shape)
    shaped.flags.writeable = False
    return shaped
