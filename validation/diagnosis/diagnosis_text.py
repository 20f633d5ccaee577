# SPDX-License-Identifier: BSD-3-Clause
"""What a diagnosis says, in lines."""

from validation.diagnosis.diagnose import RIGHT, UNEXPLAINED, Diagnosis

_SHOWN = 5
_CERTAIN = 1e4  # evidence beyond which the number says no more


def diagnosis_lines(diagnosis: Diagnosis) -> list[str]:
    """Return what comes first, what is left, and what else was thought of."""
    pixel = "at pixel centres" if diagnosis.pixel == "centre" else "means over pixels"
    lines = [f"{diagnosis.path} against {diagnosis.scene}, {pixel}: values are {_percent(diagnosis.residual)} off."]
    together = [row for row in diagnosis.ranked if row.together]
    if diagnosis.first == RIGHT:
        lines.append("Nothing is wrong with it: what is left is noise, or less than any engine is off.")
    elif diagnosis.first == UNEXPLAINED:
        lines.append("Nothing here explains it. The hypotheses that come closest are below.")
    elif together:
        lines.append(f"Two faults explain it: {'; and '.join(row.words for row in together)}.")
    else:
        lines.append(f"{diagnosis.first}: {diagnosis.ranked[0].words}.")
    if diagnosis.first not in (RIGHT, UNEXPLAINED):
        rest = "which is noise, or little" if diagnosis.explained else "which is no noise: something else is wrong too"
        lines.append(f"Without it values are {_percent(diagnosis.left)} off, {rest}.")
    lines.append("")
    lines.append(f"{'hypothesis':<16} {'left':>9} {'evidence':>9}  what it says")
    for row in diagnosis.ranked[:_SHOWN]:
        weight = f"{row.evidence:.0f}" if abs(row.evidence) < _CERTAIN else f"{row.evidence:.1e}"
        lines.append(f"{row.name:<16} {_percent(row.residual):>9} {weight:>9}  {row.words}")
    lines.append("")
    lines.append(
        "left: mean relative error without the fault; evidence: natural logarithm of the odds against `right`."
    )
    return lines


def _percent(share: float) -> str:
    return f"{100 * share:.3g} %"
