# SPDX-License-Identifier: BSD-3-Clause
"""The reference against Monte Carlo, as a table, and the light that
single scattering leaves out.
"""

from collections.abc import Iterable, Sequence

from airlight.reports.data.records import Scene
from airlight.reports.tables.table import (
    Column,
    Interval,
    Name,
    Row,
    Table,
    Value,
    Verdict,
    fields_of,
    numbers,
    table,
    words,
)
from airlight.validation.statistics.records import Agreement, Ends, Statistics

_PERCENT = {"percent": True, "sign": True}
#: Columns of what estimators say of the reference.
COLUMNS = (
    *words(name="layer"),
    *numbers(agrees="agree"),
    *fields_of(Statistics, "margin", percent=True),
    *fields_of(Statistics, "relative_bias", **_PERCENT),
    *fields_of(Statistics, "relative_bias_ci", places=3, **_PERCENT),
    *fields_of(Statistics, "detectable_bias", percent=True, digits=2),
    *fields_of(Agreement, "epsilon"),
    *fields_of(Agreement, "uncorrected_bias", **_PERCENT),
    *fields_of(Statistics, "z_mean", "z_std", "rejected"),
    *fields_of(Statistics, "expected_rejections", digits=2),
    *fields_of(Agreement, "masked"),
    *words("effort"),
)


def verdict(compared: Agreement) -> bool | None:
    """Return whether a comparison confirms the reference; None where it ran out of
    time before it could tell.

    Out of time is what stopped before the intervals were as narrow as wanted. It can still speak
    against the reference: by an interval that lies outside the margin as a whole.
    """
    # Equivalent means that the interval of the bias lies inside the margin.
    statistics = compared.statistics
    if statistics.equivalent:
        return True
    if compared.finished:
        return False
    # The run stopped early: without an interval nothing is decided; an interval that overlaps the
    # margin is undecided, and only intervals that lie outside are against the reference.
    intervals, margin = _intervals(statistics), statistics.margin
    if not intervals or margin is None:
        return None
    return None if any(low <= margin and high >= -margin for low, high in intervals) else False


def _intervals(statistics: Statistics) -> list[tuple[float, float]]:
    """Return the 95 % intervals of the relative bias that are known, from the errors of pixels and
    from batch means: agreement asks for both inside the margin.
    """
    both = (statistics.relative_bias_ci, statistics.relative_bias_ci_batches or (None, None))
    return [(low, high) for low, high in both if low is not None and high is not None]


def shown_interval(statistics: Statistics) -> Ends:
    """Return that of these intervals which reaches farther from zero; two None where none is
    known.
    """
    return max(_intervals(statistics), key=lambda ends: max(map(abs, ends)), default=(None, None))


def worst_interval(compared: Iterable[Agreement]) -> tuple[Agreement, float]:
    """Return the comparison whose 95 % interval of the relative bias fills most of its own
    margin, and the fraction.

    One whose interval is not known fills more than any other.
    """

    def reach(comparison: Agreement) -> float:
        # The end that is farther from zero, in margins.
        (low, high), margin = shown_interval(comparison.statistics), comparison.statistics.margin
        return (
            float("inf")
            if low is None or high is None or not margin
            else max(abs(low), abs(high)) / margin
        )

    worst = max(compared, key=reach)
    return worst, reach(worst)


def margin_words(statistics: Statistics) -> str:
    """Return the margin of a comparison in words."""
    return "no margin" if statistics.margin is None else f"±{100 * statistics.margin:g} %"


def trust_table(scenes: Sequence[Scene]) -> Table:
    """Return how far the reference of each scene can be trusted: its own errors, its checks,
    the estimators' intervals.

    An estimator has the interval that fills most of its margin, over the layers of a scene.
    """
    # Two columns for each estimator of the report: its interval, and whether it agrees.
    estimators = list(
        dict.fromkeys(entry.estimator for scene in scenes for entry in scene.agreement.values())
    )
    columns = (
        *words("scene"),
        *numbers(error="its error", how={"fraction": True, "digits": 2}),
        *words(kind="which is"),
        *numbers(surface_error="error of surfaces", how={"fraction": True, "digits": 2}),
        *words(surface_kind="and its kind"),
        *numbers(left="unresolved shadow rays", how={"alarm": True}),
        *(
            Column(name, f"95 % interval by {name}", percent=True, sign=True, digits=2)
            for name in estimators
        ),
        *(Column(f"{name} agrees", "inside its margin") for name in estimators),
    )
    order = [
        "scene",
        "error",
        "kind",
        "surface_error",
        "surface_kind",
        "left",
        *(key for name in estimators for key in (name, f"{name} agrees")),
    ]
    return table(
        "The reference of each scene",
        columns,
        (_trust(scene, estimators) for scene in scenes),
        explanation=(
            "The reference is a quadrature in double precision, with its error as a fraction of "
            "the mean airlight: "
            "proven, estimated in density grids, or three standard errors of samples of area "
            "lights and skies. The error of surfaces is estimated, as Mitsuba computes them in "
            "single precision, or the standard error of samples. Two "
            "Monte Carlo estimators, which share no derivation with it, check it: the 95 % "
            "interval of their relative "
            "bias must lie inside a margin. Among several layers the interval that fills most of "
            "its "
            "margin is shown; each scene below has them all."
        ),
    ).only(*order)


def _trust(scene: Scene, estimators: Iterable[str]) -> Row:
    values: dict[str, Value] = {"scene": scene.name, "error": scene.reference.relative_error}
    values |= {"kind": scene.reference.kind, "left": scene.reference.left}
    values |= {
        "surface_error": scene.reference.surface_error,
        "surface_kind": scene.reference.surface_kind,
    }
    for name in estimators:
        # An estimator that did not check this scene leaves its cells empty. A disagreement in one
        # layer decides over all layers, then an undecided one.
        compared = [entry for entry in scene.agreement.values() if entry.estimator == name]
        if not compared:
            continue
        verdicts = [verdict(entry) for entry in compared]
        good = False if False in verdicts else None if None in verdicts else True
        worst = worst_interval(compared)[0].statistics
        values[name] = Interval.of(shown_interval(worst))
        values[f"{name} agrees"] = Verdict(good, margin_words(worst))
    return Row(values)


def agreement_table(scene: Scene) -> Table:
    """Return the comparisons of the reference of a scene with the estimators."""
    return table(
        f"Monte Carlo estimators against the quadrature in {scene.name}",
        COLUMNS,
        [_values(name, comparison) for name, comparison in scene.agreement.items()],
        explanation="Our own integrator, and Mitsuba's volpath against the same integral with the shadow ray shortened "
        "by the measured epsilon.",
    )


def _values(name: str, comparison: Agreement) -> dict[str, Value]:
    return {
        **vars(comparison.statistics),
        **vars(comparison),
        "name": name,
        "relative_bias_ci": Interval.of(shown_interval(comparison.statistics)),
        "effort": "{width} x {height} pixels, {batches} x {samples} spp".format(**vars(comparison)),
        "agrees": Verdict(verdict(comparison)),
    }


# Multiple scattering


def left_out_table(scenes: Iterable[Scene], *, code: bool = False) -> Table:
    """Return for every scene of a report the fractions of light that
    single scattering leaves out.
    """
    percent = {"percent": True}
    columns = (
        *words("scene"),
        *numbers(medium="of the airlight", medium_interval="95 % interval", how=percent),
        *numbers(everything="of all light", everything_interval="95 % interval", how=percent),
        *numbers(max_depth="max. edges"),
    )
    explanation = (
        "Fractions of all light that paths of up to max. edges bring, with 95 % intervals; the "
        "second adds surfaces "
        "that light one another."
    )
    rows = (_left_out(scene, Name(scene.name) if code else scene.name) for scene in scenes)
    return table("Multiple scattering", columns, rows, explanation=explanation)


def _left_out(scene: Scene, name: Value) -> Row:
    multiple = scene.multiple
    values: dict[str, Value] = {"scene": name, "max_depth": multiple.max_depth}
    for key, found in (("medium", multiple.medium), ("everything", multiple.everything)):
        values |= {key: found.value, f"{key}_interval": Interval.of(found.interval)}
    return Row(values)
