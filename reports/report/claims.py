# SPDX-License-Identifier: BSD-3-Clause
"""The claims at the top of a report, a sentence each; every one follows from the
numbers of `report.json`.

The kinds of claims:

    reference      whether an estimator confirms the reference, with its margin and the worst of its intervals
    left-out       the light that single scattering leaves out
    image          the errors of an engine's images
    failed         values that are not finite or negative, lit intervals on which shadow rays disagree
    published      values that are negative or not finite in what reproduces a paper, errors included: no failures
    refused        which method refuses which scene
    times          when times were measured, and whether the machine changed meanwhile
    growth         whether a time jumps as the work grows
    not-measured   what was left out for its time, HDR-FLIP that could not be computed
"""

from collections.abc import Iterable, Iterator, Sequence

from airlight.realtime.methods.shader.source import is_users
from airlight.reports.data.records import Claim, Scene
from airlight.reports.tables.agreement import (
    margin_words,
    shown_interval,
    verdict,
    worst_interval,
)
from airlight.reports.tables.costs import WORK, cliffs
from airlight.reports.tables.methods import published_as, runs_of
from airlight.validation.metrics.errors import known
from airlight.validation.statistics.records import Agreement
from airlight.validation.study.row import Row
from airlight.validation.timing import Scaling

Scenes = Sequence[Scene]

_WORDS = {"volpath": "Mitsuba's volpath", "single-scatter": "our own Mitsuba integrator"}


def claims(scenes: Scenes) -> list[Claim]:
    """Return the claims that follow from the scenes of a report, in the order of the page."""
    if not scenes:
        return []
    # The order of the page: first whether the reference can be trusted, then what it leaves out,
    # then faults.
    sentences = [*_trust(scenes), _left_out(scenes), *_images(scenes), *_failed(scenes)]
    # A refusal is the method's answer, "left out" is our decision: two claims.
    slow = "Not measured for the time that they take"
    for kind, words, left_out in (("refused", "Refused", False), ("not-measured", slow, True)):
        without = [
            (name, m)
            for name, m in _entries(scenes)
            if m.reason and (m.status == "left out") == left_out
        ]
        named = [f"{m.label} in {name}" for name, m in without]
        if named:
            sentences.append(
                _claim(kind, f"{words}, with the reason in the tables: {'; '.join(named)}.")
            )
    return sentences + _without_flip(scenes) + _timed(scenes)


def unstudied(names: Sequence[str], known: Sequence[str]) -> list[Claim]:
    """Return a claim on the built-in scenes that the effort leaves out, if any."""
    left = [name for name in known if name not in names]
    if not left:
        return []
    text = (
        f"Scenes not studied, for the time that they take: {', '.join(left)}. "
        "A scene that is named is studied, `--full` has all."
    )
    return [_claim("not-measured", text)]


def growth_claims(records: Sequence[Scaling]) -> list[Claim]:
    """Return the claims that follow from how times grow, the records of `scaling`."""
    if not records:
        return []
    # Each jump is a claim that fails; a single one holds when there is none.
    jumps = [_claim("growth", f"A time jumps: {jump}.", good=False) for jump in cliffs(records)]
    scenes = " and ".join(dict.fromkeys(record.scene for record in records))
    kinds = ", ".join(dict.fromkeys(WORK[record.kind] for record in records))
    return jumps or [
        _claim(
            "growth", f"No time of a frame of {scenes} jumps as the work grows: {kinds}.", good=True
        )
    ]


def confirmed(scenes: Scenes) -> bool:
    """Return whether no comparison speaks against the reference, and each layer is
    confirmed by at least one.
    """
    for scene in scenes:
        # One comparison that speaks against the reference outweighs all others; an undecided one
        # does not, if another confirms its layer.
        compared = list(scene.agreement.values())
        if any(verdict(entry) is False for entry in compared):
            return False
        for layer in {entry.layer for entry in compared}:
            if not any(verdict(entry) for entry in compared if entry.layer == layer):
                return False
    return True


def _claim(kind: str, text: str, good: bool | None = None) -> Claim:
    return Claim(kind=kind, text=text, good=good)


def _entries(scenes: Scenes) -> list[tuple[str, Row]]:
    """Return the scene's name with every entry: first methods, then images of engines."""
    entries = [(scene.name, entry) for scene in scenes for entry in scene.methods]
    return sorted(entries, key=lambda pair: pair[1].kind == "image")


def _trust(scenes: Scenes) -> list[Claim]:
    """Return a claim for each estimator that checked the reference."""
    compared = [(scene.name, entry) for scene in scenes for entry in scene.agreement.values()]
    # A scene in the dark has nothing to compare.
    if not compared:
        text = "There is no light to compare with Mitsuba's volpath: no airlight and no lit surface in any scene."
        return [_claim("reference", text)]
    estimators = dict.fromkeys(entry.estimator for _, entry in compared)
    said = [
        _verdict(_WORDS[name], [pair for pair in compared if pair[1].estimator == name])
        for name in estimators
    ]
    # It cannot trace some scenes (`reference.monte_carlo.volpath_gaps`).
    checked = {name for name, entry in compared if entry.estimator == "volpath"}
    if left := dict.fromkeys(name for name, _ in compared if name not in checked):
        text = f"{_WORDS['volpath']} did not check the reference in {', '.join(left)}."
        said.append(_claim("reference", text))
    return said


def _verdict(words: str, compared: list[tuple[str, Agreement]]) -> Claim:
    # Three outcomes: against, undecided, confirmed.
    against, open_ = (
        [_place(*pair) for pair in compared if verdict(pair[1]) is found] for found in (False, None)
    )
    if against:
        text = (
            f"The reference is NOT confirmed by {words} in {', '.join(against)}: there the 95 % "
            "interval of the "
            "relative bias is not inside the margin."
        )
        return _claim("reference", text, False)
    good = [pair for pair in compared if verdict(pair[1])]
    text = ""
    if good:
        # The interval that fills most of its margin shows how close the decision was.
        filled = {_place(*pair): worst_interval([pair[1]]) for pair in good}
        place, (worst, most) = max(filled.items(), key=lambda item: item[1][1])
        low, high = (100 * known(end) for end in shown_interval(worst.statistics))
        text = (
            f"The reference is confirmed by {words} in {len(good)} of {len(compared)} comparisons: "
            "every 95 % interval "
            "of the pooled relative bias lies within its margin. The interval that fills most of "
            "its margin, "
            f"{100 * most:.0f} %, is {low:+.2g}..{high:+.2g} %, in {place}."
        )
    if open_:
        text += (" " if text else "") + (
            f"By {words} it is not decided within the time in {', '.join(open_)}: the 95 % "
            "interval is not narrow "
            "enough there."
        )
    return _claim("reference", text, None if open_ else True)


def _place(scene: str, entry: Agreement) -> str:
    return f"{scene} ({entry.layer}, {margin_words(entry.statistics)})"


def _left_out(scenes: Scenes) -> Claim:
    left_out = [(scene.name, scene.multiple.medium.value) for scene in scenes]
    fractions = "; ".join(
        f"{name} {'unknown' if value is None else f'{100 * value:.2g} %'}"
        for name, value in left_out
    )
    text = f"Every method here scatters once. The fraction of the airlight that this leaves out: {fractions}."
    return _claim("left-out", text)


def _images(scenes: Scenes) -> Iterator[Claim]:
    for scene, entry in _entries(scenes):
        error = entry.error
        if entry.kind != "image" or not error or error.relative_rmse is None:
            continue
        what = "total of airlight and surface" if entry.layer == "total" else entry.layer
        text = (
            f"The image {entry.label} of {scene}, judged by its {what}"
            f"{_of_model(entry)}: relative RMSE "
            f"{100 * error.relative_rmse:.3g} %, relative bias "
            f"{100 * known(error.relative_bias):+.3g} %."
        )
        yield _claim("image", text)


def _of_model(entry: Row) -> str:
    """Say by which equation an image is judged, where it is not the physical one."""
    if entry.model is None:
        return ""
    return f" and the equation of the model {entry.model.name or entry.model.terms}"


def _failed(scenes: Scenes) -> Iterator[Claim]:
    for count, words in (
        ("nonfinite", "values that are not finite"),
        ("negative", "negative values"),
    ):
        # Papers as printed make negative values by design: a fact, no failure.
        wrong = [(name, m) for name, m in _entries(scenes) if getattr(m.error, count, 0)]
        failed = [_pixels(name, m, count) for name, m in wrong if not published_as(m)]
        if failed:
            yield _claim("failed", f"Images with {words}: {'; '.join(failed)}.", False)
        peers = [_pixels(name, m, count) for name, m in wrong if published_as(m)]
        if peers:
            yield _claim(
                "published", f"As the papers have it, images with {words}: {'; '.join(peers)}."
            )
    # Lit intervals of the reference that random shadow rays contradict.
    left = [f"{scene.name} ({scene.reference.left})" for scene in scenes if scene.reference.left]
    if left:
        text = f"Random shadow rays disagree with lit intervals, and were not resolved: {'; '.join(left)} of them."
        yield _claim("failed", text + " They are counted in the error of the reference.", False)


def _timed(scenes: Scenes) -> list[Claim]:
    """Return a claim on the runs in which times were measured, if any were."""
    runs = [(scene.name, run) for scene in scenes for run in runs_of(scene.methods)]
    if not runs:
        return []
    dates = sorted(run.started for _, run in runs)
    when = dates[0] if dates[0] == dates[-1] else f"between {dates[0]} and {dates[-1]}"
    text = f"The times of a scene are of one run, in which its methods took turns: {when}."
    # Runs during which the machine changed, with the factors that tell it.
    changed = [
        f"{name} ({run.between:.2f} times between rounds, {run.within:.2f} within one)"
        for name, run in runs
        if run.steady is False
    ]
    if changed:
        where = ", ".join(changed)
        text += f" The machine changed meanwhile, so that ratios count there, and no milliseconds: {where}."
    return [_claim("times", text)]


def _pixels(scene: str, m: Row, count: str) -> str:
    pixels = getattr(m.error, count)
    return f"{m.label} in {scene} ({pixels} pixel{'' if pixels == 1 else 's'})"


def _without_flip(scenes: Scenes) -> list[Claim]:
    """Return a claim on the images that have no HDR-FLIP, with the reason of the first."""
    without = [
        (name, m.label, m.flip.note)
        for name, m in _entries(scenes)
        if m.flip and m.flip.value is None
    ]
    if not without:
        return []
    name, label, why = without[0]
    count = f"{len(without)} image{'' if len(without) == 1 else 's'}"
    return [_claim("not-measured", f"No HDR-FLIP of {count}; of {label} in {name}: {why}.")]


def own_fault(method: str, refused: str | None) -> str | None:
    """Return the fault of a user method, None for none; a refusal by name is a result and no fault.

    They begin with the name of the method (`realtime.methods.user_method`,
    `realtime.methods.shader`, `reports.machine.own_process`).
    """
    return (
        refused
        if is_users(method) and refused and refused.startswith(f"method {method}: ")
        else None
    )


def own_faults(methods: Iterable[Row]) -> list[str]:
    """Return the faults of user methods, each once."""
    faults = (own_fault(row.method, row.reason) for row in methods if row.kind == "function")
    return list(dict.fromkeys(filter(None, faults)))
