# SPDX-License-Identifier: BSD-3-Clause
"""All that a sweep says, worked out once: for the page, the tables and `--json`."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from airlight.reports.data.records import Claim as Headline
from airlight.reports.sweep.claims import (
    TARGETS,
    Claim,
    Correlation,
    best_claims,
    claims,
    correlations,
    percent,
    property_words,
    strongest,
    written,
)
from airlight.reports.sweep.faults import (
    Check,
    Fault,
    Reason,
    Worst,
    checks,
    faults,
    reasons,
    worst,
)
from airlight.reports.sweep.samples import (
    FAULTS,
    Fastest,
    Sample,
    Sweep,
    drawn_at_random,
    fastest_within,
    samples,
)
from airlight.validation.statistics.samples import LEVEL, binomial_interval

SCHEMA = "airlight-sweep/1"

#: Columns of the software and hardware that made the rows.
_VERSIONS = (
    "airlight",
    "commit",
    "source",
    "mitsuba",
    "drjit",
    "python",
    "variant",
    "host",
    "device",
)


@dataclass(frozen=True)
class Summary:
    """The results of a sweep."""

    sweep: Sweep
    rows: int
    drawn: bool  #: whether claims are about scenes that were drawn at random
    samples: tuple[Sample, ...]
    claims: tuple[Claim, ...]
    correlations: tuple[Correlation, ...]
    strongest: Mapping[str, tuple[Correlation, ...]]  #: by label
    worst: Mapping[str, tuple[Worst, ...]]  #: by label
    fastest: tuple[Fastest, ...]
    reasons: tuple[Reason, ...]
    checks: tuple[Check, ...]
    faults: tuple[Fault, ...]
    #: of the references themselves: median and largest of those that are known, over the mean [1]
    reference_errors: tuple[float, float] | None
    reference_unknown: int  #: cells with light whose reference states no error
    versions: Mapping[str, tuple[str, ...]]
    statuses: Mapping[str, int]  #: rows that ended so
    scenes: int  #: that claims are about
    named_scenes: int  #: others
    studies: tuple[str, ...]
    started: tuple[str, str] | None  #: when the first and the last cell began
    headlines: tuple[Headline, ...] = ()  #: what a reader should know first
    schema: str = SCHEMA


def summary_of(sweep: Sweep) -> Summary:
    """Return what a sweep says."""
    # Samples first: claims, correlations and worst scenes are made of them.
    made = tuple(samples(sweep))
    found = tuple(correlations(sweep, made))
    goes_with = {sample.label: tuple(strongest(found, sweep, sample)) for sample in made}
    random = np.isfinite(sweep["seed"])
    names = sweep["scene"]
    drawn = drawn_at_random(sweep)
    # Errors of the references themselves, in which no method has a part.
    reference_errors = sweep["reference.error"]
    known = np.isfinite(reference_errors)
    unknown = int(np.count_nonzero(~known & (sweep["reference.mean"] > 0)))
    reference_errors = reference_errors[known]
    # Everything is worked out here, so that page, tables and JSON say the same.
    said = Summary(
        sweep=sweep,
        rows=len(sweep),
        drawn=drawn,
        samples=made,
        claims=tuple(claims(made)),
        correlations=found,
        strongest=goes_with,
        worst={
            sample.label: tuple(
                worst(sweep, sample, [each.property for each in goes_with[sample.label]])
            )
            for sample in made
        },
        fastest=tuple(fastest_within(made, target) for target in TARGETS),
        reasons=tuple(reasons(sweep)),
        checks=tuple(checks(sweep)),
        faults=tuple(faults(sweep)),
        reference_errors=(float(np.median(reference_errors)), float(reference_errors.max()))
        if reference_errors.size
        else None,
        reference_unknown=unknown,
        versions={name: tuple(sorted(set(sweep[f"origin.{name}"]) - {None})) for name in _VERSIONS},
        statuses=dict(Counter(sweep["status"].tolist()).most_common()),
        scenes=len(set(names[random] if drawn else names)),
        named_scenes=len(set(names[~random])) if drawn else 0,
        studies=tuple(sorted(set(sweep["study"]) - {None})),
        started=_span(sweep),
    )
    return replace(said, headlines=tuple(_headlines(said)))


def _headlines(said: Summary) -> list[Headline]:
    made: list[Headline] = []

    def add(kind: str, text: str, good: bool | None = None) -> None:
        made.append(Headline(kind=kind, text=text, good=good))

    # First what was promised most often, then the fastest, then the property that goes with most
    # errors, then faults.
    for target in TARGETS:
        best = best_claims(said.claims, target)
        if best:
            others = f" and {len(best) - 1} more" if best[1:] else ""
            add(
                f"Most often within {written(target)}",
                f"{best[0].label}{others}, {best[0].fraction_words}.",
            )
    for each in said.fastest:
        if any(each.counts.values()):
            label = max(each.counts, key=each.counts.__getitem__)
            none = f"; in {each.none} none is within it" if each.none else ""
            fraction = percent(each.counts[label] / each.scenes, each.scenes)
            add(
                f"Fastest within {written(each.target)}",
                f"{label}, in {fraction} % of {each.scenes} scenes{none}.",
            )
    # The strongest property of each configuration has one vote.
    leading = Counter(chosen[0].property for chosen in said.strongest.values() if chosen)
    if leading:
        name, count = leading.most_common(1)[0]
        add(
            "Goes with error",
            f"the {property_words(name)} goes with the error of {count} of {len(said.samples)} "
            "configurations more "
            "than any other property does.",
        )
    for check in said.checks:
        if check.faulty_rows:
            add(check.check.capitalize(), check_words(check), False)
        if check.published:
            add(
                "As published",
                f"{check.published} images of methods that reproduce a paper with its errors have "
                f"{check.meaning}.",
            )
    # Without a fault the page says how many might have been missed.
    if not any(check.faulty_rows for check in said.checks):
        add("Sound", sound_words(said), True)
    # Rows of several versions may differ by the code and not by the scenes.
    for name in ("airlight", "source"):
        if len(said.versions[name]) > 1:
            add(
                "Versions",
                f"the rows come of several versions: {name} {', '.join(said.versions[name])}.",
                False,
            )
    # Cells that came to nothing.
    lost = sum(said.statuses.get(status, 0) for status in FAULTS)
    words = ", ".join(
        f"{said.statuses[status]} {status}" for status in FAULTS if said.statuses.get(status)
    )
    total = f"{len(said.sweep)} cells"
    add(
        "Not done",
        f"of {total}: {words}." if lost else f"none of {total} failed, hung or ended its process.",
        not lost,
    )
    return made


def check_words(check: Check) -> str:
    """Return in a sentence how many images have a fault."""
    return (
        f"{check.faulty_rows} of {check.rows} images have {check.meaning}, in "
        f"{check.faulty_scenes} of "
        f"{check.scenes} scenes."
    )


def sound_words(said: Summary) -> str:
    """Return in a sentence that no image has a fault, and in how many scenes
    it may have been missed.
    """
    checked = {check.check: check for check in said.checks}
    # No fault in n scenes leaves a fraction that could have been missed: the upper end of the
    # interval of 0 of n.
    most = 100 * binomial_interval(0, checked["not finite"].scenes)[1]
    stated = checked["outside of the bound"].rows
    apart = any(check.published for check in said.checks)
    beside = ", those of published methods left out," if apart else ""
    bound = f", or outside of the bound that {stated} of them state" if stated else ""
    return (
        f"no image of {checked['not finite'].rows}{beside} has a pixel that is not finite or "
        f"negative{bound}; of scenes alike "
        f"at most {most:.2g} % may have one, at {100 * LEVEL:.0f} % confidence."
    )


def _span(sweep: Sweep) -> tuple[str, str] | None:
    known = sorted(set(sweep["origin.started"]) - {None})
    return (_time_words(known[0]), _time_words(known[-1])) if known else None


def _time_words(started: str) -> str:
    """Return a time of a row as readers write it: 2026-11-23 08:30 UTC."""
    return f"{started[:10]} {started[11:16]} UTC"
