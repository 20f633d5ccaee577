# SPDX-License-Identifier: BSD-3-Clause
"""The Python API for studies: integrals by kernels, speed against error, claims of papers."""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

from analytic.errors import InputError
from reports.api.inputs import Progress, SceneLike, Size, kernel_name, one_error, opened, telling

if TYPE_CHECKING:
    from analytic.cases import Cases
    from reports.api.tables import BenchTable, Integrals, PaperClaims
    from validation.study.configuration import Configuration
    from validation.study.row import Row

#: A name, 'module:function', a function, or a method with its kernel and parameters.
MethodLike: TypeAlias = "str | Callable[..., Any] | Configuration"


@one_error
def integrate(
    cases: "Mapping[str, Any] | Cases | str | os.PathLike[str]",
    kernel: str | Callable[..., Any] = "exact",
    *,
    precision: Literal["single", "double"] = "single",
    certify: bool = False,
) -> "Integrals":
    """Evaluate the airlight integral J of some cases by a kernel.

    Parameters
    ----------
    cases
        Columns by name, of any shapes that broadcast together: `phase` ('isotropic', 'rayleigh', 'hg' ..), `g` for
        'hg', `x0`, `x1` [m] (may be infinite), `sigma_t` [1/m], and either `foot` and `height` [m] or `origin`,
        `direction` and `light`, (..., 3); a data frame with such columns; or the path of a CSV file, see
        `analytic.cases`.
    kernel
        A name (`airlight.KERNELS`), such a name with '-N', 'module:function', or such a function itself.
    precision
        Of all that the kernel computes.
    certify
        Also integrate by adaptive quadrature in float64, to 1e-10, and compare with that where no `value` is given.

    Returns
    -------
    Integrals
        `J` [1/m], float64, of the shape of the columns.

    Raises
    ------
    InputError
        For a column that is missing, a number out of its range, an unknown kernel or phase function.

    Examples
    --------
    >>> import airlight, numpy as np
    >>> rays = {"phase": "isotropic", "foot": np.linspace(-2, 2, 5), "height": 0.3, "x0": 0, "x1": np.inf}
    >>> integrals = airlight.integrate(rays | {"sigma_t": 0.2}, "exact", certify=True)
    >>> integrals.J.shape
    (5,)
    >>> bool(abs(integrals.error).max() < 1e-5)
    True
    """
    from analytic.cases import integrate_cases as certified
    from reports.api.tables import Integrals
    from reports.machine.environment import activate
    from validation.kernels.cases import integrate_cases, summary

    activate()
    read, shape = _cases(cases)
    named = kernel_name(kernel) or "exact"
    J = integrate_cases(read, named, precision)
    if certify and read.value is None:
        read = replace(read, value=certified(read)[0])
    return Integrals(
        J=_sealed(J, shape),
        value=None if read.value is None else _sealed(read.value, shape),
        kernel=named,
        precision=precision,
        cases=read,
        summary=summary(read, J),
    )


def _cases(cases: Any) -> tuple["Cases", tuple[int, ...]]:
    from analytic.cases import Cases, cases_from_columns, read_cases

    if isinstance(cases, str | os.PathLike):
        cases = read_cases(Path(cases))
    if isinstance(cases, Cases):
        return cases, (len(cases.x0),)
    if not isinstance(cases, Mapping) and not hasattr(cases, "keys"):
        raise InputError(f"cases: got {type(cases).__name__}, wanted columns by name or the path of a CSV file")
    return cases_from_columns({str(name): cases[name] for name in cases})


def _sealed(values: Any, shape: tuple[int, ...]) -> Any:
    shaped = values.reshape(shape)
    shaped.flags.writeable = False
    return shaped


@one_error
def bench(
    scenes: "SceneLike | Sequence[SceneLike]",
    methods: "MethodLike | Sequence[MethodLike] | None" = None,
    *,
    size: Size | None = None,
    seconds: float = 0.6,
    flip: bool = False,
    progress: Progress = None,
) -> "BenchTable":
    """Measure what methods cost in scenes and how wrong they are, against the quadrature truth.

    Parameters
    ----------
    scenes
        One or several, see `load_scene`.
    methods
        One or several: names, each of which stands for its standard configurations, one's own methods as for `render`,
        and `airlight.configuration(method, kernel, parameters)`. All standard configurations by default.
    size
        Width and height [pixels], or 'WxH'; the scenes' own by default.
    seconds
        Time to spend on each timing, of which every configuration has five.
    flip
        Also compute HDR-FLIP of all light.
    progress
        Called with (share done, what); True shows a bar.

    Raises
    ------
    InputError
        For what is not known; what a method refuses in a scene stands in its row.

    Examples
    --------
    >>> import airlight
    >>> table = airlight.bench("open-fog", ["unshadowed"], size=(32, 24), seconds=0.01)
    >>> [row["label"] for row in table]
    ['unshadowed (taylor)', 'unshadowed (quadrature)', 'unshadowed (exact)']
    >>> table.fastest(1e-3)["relative_rmse"] < 1e-3
    True
    """
    from realtime.scene.read_scene import read_scene
    from reports.api.tables import BenchTable
    from reports.machine.environment import activate, describe_environment
    from validation.estimates.quadrature import truth_image
    from validation.study.reference import of_image
    from validation.study.run import run
    from validation.study.scene import configurations_for
    from validation.study.study import Cell, Measure

    activate()
    chosen = chosen_methods(methods)
    loaded = [opened(named, size) for named in several(scenes)]
    # What cannot be used is refused before the work begins.
    read = [read_scene(each.scene) for each in loaded]
    rows = []
    with telling(progress, "bench") as callback:
        for number, (opened_scene, scene) in enumerate(zip(loaded, read)):
            callback(number / len(loaded), f"{opened_scene.name}: the truth")
            reference = of_image(truth_image(opened_scene.scene))
            size_of, wanted = (scene.camera.width, scene.camera.height), Measure("stages", seconds, flip=flip)
            useful = configurations_for(scene.features, chosen)
            for place, each in enumerate(useful):
                callback((number + place / len(useful)) / len(loaded), f"{opened_scene.name}: {each.label}")
                cell = Cell(opened_scene.name, size_of, (), each, replace(wanted, every_metric=False))
                rows.append(_numbers(run(cell, scene, reference)[0], each))
        callback(1.0, "done")
    return BenchTable(rows=tuple(rows), environment=describe_environment())


def several(things: Any) -> list[Any]:
    """Return one or several as a list."""
    return list(things) if isinstance(things, list | tuple) else [things]


def chosen_methods(methods: Any) -> "tuple[Configuration, ...]":
    """Return what to measure, all standard configurations for None; see `bench`."""
    from validation.study.configuration import STANDARD, Configuration, chosen_configurations, configuration

    if methods is None:
        return STANDARD
    chosen: list[Configuration] = []
    for method in several(methods):
        if isinstance(method, Configuration):
            chosen.append(method)
        else:
            chosen += chosen_configurations([method]) if isinstance(method, str) else [configuration(method)]
    return tuple(chosen)


def _numbers(row: "Row", chosen: "Configuration") -> dict[str, Any]:
    """Return the numbers of a row, see `BenchTable`."""
    from validation.metrics.errors import plain
    from validation.study.frame_times import FrameTimes

    times, error = row.times, row.error
    numbers: dict[str, Any] = {name: getattr(row, name) for name in ("scene", "width", "height", "label", "method")}
    numbers |= {"kernel": row.kernel, "parameters": dict(chosen.parameters)}
    numbers["frame_low_ms"] = times and times.frame.low_ms
    numbers["frame_high_ms"] = times and times.frame.high_ms
    medians = times.medians if times else {}
    numbers |= {f"{each.name}_ms": medians.get(each.name) for each in fields(FrameTimes)}
    for name in ("relative_rmse", "relative_bias", "p50", "p99", "max", "nonfinite", "negative"):
        numbers[name] = error and plain(getattr(error, name))
    numbers["flip"] = row.flip and row.flip.value
    return numbers | {"refused": row.reason, "note": row.note}


@one_error
def paper(
    name: str | None = None, *, quick: bool = False, fresh: bool = False, progress: Progress = None
) -> "PaperClaims":
    """Measure what the claims of papers need, and judge them.

    Parameters
    ----------
    name
        'biri', 'billeter', 'ali' or 'bouthors'; all by default, which takes an hour or so.
    quick
        Only the claims that need no image.
    fresh
        Measure again what was cached by earlier runs.
    progress
        Called with (share done, what); True shows a bar.

    Returns
    -------
    PaperClaims
        A row for each claim, and for each number that a paper prints without one.

    Raises
    ------
    InputError
        For an unknown paper.
    """
    import time

    from analytic.errors import nearest
    from reference.storage.kept import fresh_results
    from reports.api.tables import PaperClaims
    from reports.machine.environment import activate
    from reports.report.others import measure_claims
    from validation.papers.claims import claims, papers

    if name is not None and name not in papers():
        raise InputError(f"paper: got {name!r}, wanted one of {', '.join(papers())}" + nearest(name, papers()))
    chosen = [claim for claim in claims() if name in (None, claim.paper)]
    activate()
    with telling(progress, "paper") as step, fresh_results(time.time() if fresh else None):
        rows = measure_claims(chosen, quick=quick, progress=step)
    return PaperClaims(tuple(rows), left_out=len(chosen) - len(rows))
