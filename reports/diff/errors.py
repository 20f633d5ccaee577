# SPDX-License-Identifier: BSD-3-Clause
"""The errors of two reports compared, scene by scene and method by method."""

from reports.diff.finding import Finding, Report
from validation.statistics.noise import FLOORS, error_band

_ERRORS = ("relative_rmse", "relative_bias", "p50", "p99", "max", "nonfinite", "negative")


def compare_methods(old: Report, new: Report, *, tolerance: float, gone: str) -> tuple[list[Finding], int]:
    """Return the findings on the methods of a scene, and how many numbers were compared."""
    name = old["name"]
    before, after = ({entry["label"]: entry for entry in scene["methods"]} for scene in (old, new))
    findings = [Finding(gone, name, label, "gone") for label in before if label not in after]
    findings += [Finding("note", name, label, "new") for label in after if label not in before]
    reason = _incomparable(old, new)
    if reason:
        findings.append(reason)
    compared = 0
    for label in [label for label in before if label in after]:
        old_entry, new_entry = before[label], after[label]
        if bool(old_entry["refused"]) != bool(new_entry["refused"]):
            lost = new_entry["refused"]
            words = f"refused: {lost}" if lost else "no longer refused"
            # Leaving a method out for the time it takes is a decision of the user, not a fault.
            decided = old_entry.get("left_out") or new_entry.get("left_out")
            findings.append(Finding("note" if decided else "worse" if lost else "better", name, label, words))
        elif old_entry.get("layer", "airlight") != new_entry.get("layer", "airlight"):
            findings.append(Finding("note", name, label, "errors not compared: they are of different layers"))
        elif reason is None:
            for layer, key in (("", "error"), ("surface ", "surface_error")):
                changes, count = _errors(old_entry.get(key), new_entry.get(key), tolerance, prefix=layer)
                findings += [Finding(v, name, label, what, a, b) for v, what, a, b in changes]
                compared += count
            changes, count = _flip(old_entry, new_entry, tolerance)
            findings += [Finding(v, name, label, what, a, b) for v, what, a, b in changes]
            compared += count
    return findings, compared


def _incomparable(old: Report, new: Report) -> Finding | None:
    """Say why the errors of a scene cannot be compared, None if they can."""
    if old["size"] != new["size"]:
        sizes = " and ".join("x".join(map(str, scene["size"])) for scene in (old, new))
        return Finding("note", old["name"], "", f"errors not compared: the images are {sizes} pixels")
    before, after = (scene["truth"]["mean"] for scene in (old, new))
    if before is None or after is None:
        return None
    # Each bound limits the mean absolute error, so the means differ by at most the sum of both bounds.
    bounds = sum(scene["truth"].get("relative_bound") or 0.0 for scene in (old, new))
    if abs(after - before) > (bounds + FLOORS["mean"]) * abs(before):
        words = "the truth moved (mean radiance): another scene by this name, or another truth; errors not compared"
        return Finding("worse", old["name"], "", words, before, after)
    return None


Change = tuple[str, str, float | None, float | None]  # verdict, what, old, new


def _errors(old: Report | None, new: Report | None, tolerance: float, *, prefix: str) -> tuple[list[Change], int]:
    """Compare the errors of a configuration in one layer."""
    if old is None or new is None:
        return ([("worse", f"{prefix}error is gone", None, None)] if old else []), 0
    changes: list[Change] = []
    for name in _ERRORS:
        before, after = old.get(name), new.get(name)
        what = f"{prefix}{name}"
        if before is None or after is None:
            if before is not after:  # JSON writes NaN as null
                changes.append(("worse" if after is None else "better", what, before, after))
            continue
        band = error_band(name, before, tolerance=tolerance, pixels=old["pixels"], rmse=old.get("relative_rmse") or 0.0)
        grown = abs(after) - abs(before)
        if abs(grown) > band:
            changes.append(("worse" if grown > 0 else "better", what, before, after))
    return changes, len(_ERRORS)


def _flip(old: Report, new: Report, tolerance: float) -> tuple[list[Change], int]:
    before, after = ((entry.get("flip") or {}).get("value") for entry in (old, new))
    if before is None or after is None:
        return [], 0
    if abs(after - before) <= error_band("flip", before, tolerance=tolerance):
        return [], 1
    return [("worse" if after > before else "better", "HDR-FLIP", before, after)], 1
