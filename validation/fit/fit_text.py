# SPDX-License-Identifier: BSD-3-Clause
"""What `airlight compare --fit` prints beside the table of parameters."""

from validation.fit.fit import Confounded, Fit

_MUCH = 0.1  # share of the pixels: if more are left out, the reader should look why
_BAD = 0.99  # share of the variance: an image that is explained less is not understood


def fit_lines(fit: Fit) -> list[str]:
    """Return how well an image is explained, and what it does not tell apart."""
    pixel = "at pixel centres" if fit.pixel == "centre" else "means over pixels"
    holds = "airlight + surface" if fit.holds == "total" else fit.holds
    left = f"{fit.left_out} of {fit.pixels} pixels disagree with what explains the others, and are left out"
    lines = [
        f"{fit.path} as {holds} of {fit.scene}, {pixel}: {100 * fit.explained:.6g} % of its variance is explained; the "
        f"relative rmse left is {fit.residual:.3g}, the usual error of a value {fit.noise:.2g}.",
        left + (": look where, by airlight compare" if fit.left_out > _MUCH * fit.pixels else "") + ".",
    ]
    if fit.explained < _BAD:
        lines.append("That is no explanation: something that was not looked for is different.")
    held = {name for group in fit.confounded for name in group.parameters}
    lines += [
        f"{each.name} has no upper end: this image allows any value above {each.low:.6g}."
        for each in fit.parameters
        if each.high is None and each.low is not None and each.name not in held
    ]
    lines.append(f"The fit took {fit.seconds:.2g} s.")
    return lines + [line for group in fit.confounded for line in _group_lines(group)]


def _group_lines(group: Confounded) -> list[str]:
    names = ", ".join(group.parameters)
    alone = len(group.parameters) == 1
    lines = [f"This image says nothing of {names}." if alone else f"This image does not tell apart: {names}."]
    for each in group.products:
        ends = f"{each.low:.6g} or more" if each.high is None else f"{each.low:.6g} to {each.high:.6g}"
        lines.append(f"Known is {each.name} = {each.value:.6g} ({ends}).")
    return [*lines, f"Way out: {group.way_out}."]
