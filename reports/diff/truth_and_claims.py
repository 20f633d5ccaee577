# SPDX-License-Identifier: BSD-3-Clause
"""What two reports claim, compared: truth, verdicts, kernels that break, faults that nothing catches, the fastest."""

from collections.abc import Iterator, Mapping

from reports.data.claims import confirmed
from reports.diff.finding import Finding, Report
from reports.tables.agreement import verdict
from reports.tables.methods import TARGETS, fastest_within
from reports.tables.scaling import TIMES, WORK, same_records
from validation.statistics.noise import other_power


def compare_truth(old: Report, new: Report, gone: str) -> Iterator[Finding]:
    """Compare the truth of a scene in two reports."""
    name = old["name"]
    if not confirmed([new]) and confirmed([old]):
        yield Finding("worse", name, "", "the truth is no longer confirmed")
    elif confirmed([new]) and not confirmed([old]):
        yield Finding("better", name, "", "the truth is confirmed now")
    for key, agreement in old["agreement"].items():
        if key not in new["agreement"]:
            yield Finding(gone, name, "", f"the comparison with {key} is gone")
        elif verdict(agreement) is True and verdict(new["agreement"][key]) is None:
            yield Finding("note", name, "", f"{key} ran out of time before it could confirm the truth")
    if old["size"] == new["size"]:
        for key in ("disagreements", "left"):
            before, after = old["truth"].get(key), new["truth"].get(key)
            if before is not None and after is not None and after > before:
                yield Finding("worse", name, "", f"lit intervals of the truth: {key}", before, after)


def compare_claims(old: Report, new: Report) -> Iterator[Finding]:
    """Compare the parts that concern the whole report."""
    yield from _claims(old, new)
    yield from _stability(old, new)
    yield from _growth(old, new)


def _claims(old: Report, new: Report) -> Iterator[Finding]:
    """Compare the verdicts at the top: of each kind, how many are bad."""
    before, after = old["claims"], new["claims"]
    for kind in dict.fromkeys(entry["kind"] for entry in (*before, *after)):
        bad = [
            [entry["text"] for entry in claims if entry["kind"] == kind and entry["good"] is False]
            for claims in (before, after)
        ]
        if len(bad[1]) > len(bad[0]):
            yield from (Finding("worse", "", "", f"claim: {text}") for text in bad[1] if text not in bad[0])
        elif len(bad[1]) < len(bad[0]):
            yield from (Finding("better", "", "", f"no longer: {text}") for text in bad[0] if text not in bad[1])


def _stability(old: Report, new: Report) -> Iterator[Finding]:
    """Compare which kernels break their bars."""
    before, after = ({entry["kernel"]: entry["broken"] for entry in report["stability"]} for report in (old, new))
    for kernel in before:
        if kernel in after and after[kernel] and not before[kernel]:
            yield Finding("worse", "", kernel, f"breaks its bar: {after[kernel][0]}")
        elif kernel in after and before[kernel] and not after[kernel]:
            yield Finding("better", "", kernel, "keeps its bars again")


def _growth(old: Report, new: Report) -> Iterator[Finding]:
    """Compare the powers of the work with which times grow."""
    for before, after in same_records(old.get("scaling", ()), new.get("scaling", ())):
        for name, growth in after["growth"].items():
            if other_power(before["growth"][name], growth):
                was, is_now = before["growth"][name]["exponent"], growth["exponent"]
                what = f"the power of the {WORK[after['kind']]} with which {TIMES[name]} grows"
                yield Finding("worse" if is_now > was else "better", after["scene"], after["label"], what, was, is_now)


def compare_winners(before: Mapping[str, Report], after: Mapping[str, Report]) -> Iterator[Finding]:
    """Return a note where another method is the fastest: no fault, as the noise may change the order."""
    for name in [name for name in before if name in after]:
        for target in TARGETS:
            was, is_now = (_fastest(scene, target) for scene in (before[name], after[name]))
            if was != is_now:
                words = f"fastest within {100 * target:g} %: {was or 'none'} before, {is_now or 'none'} now"
                yield Finding("note", name, "", words)


def _fastest(scene: Report, target: float) -> str | None:
    best = fastest_within(target, scene["methods"])
    return best["label"] if best else None
