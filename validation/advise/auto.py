# SPDX-License-Identifier: BSD-3-Clause
"""The method `auto`: the configuration that the advice names."""

from collections.abc import Mapping
from typing import Any

from analytic.errors import InputError
from realtime.scene.read_scene import Scene
from validation.advise.choose import Advice, advise
from validation.advise.model import read_model
from validation.configurations.methods import Configuration

AUTO = "auto"  #: the word in the place of a method
USUAL_ERROR = 1e-3


def auto_configuration(
    scene: Scene, kernel: str | None = None, settings: Mapping[str, Any] | None = None
) -> tuple[Configuration, Advice]:
    """Return the configuration to take in a scene, and the advice.

    Parameters
    ----------
    scene
        As methods read it, at the size of its image.
    kernel
        None: the advice names it.
    settings
        `error`, the relative RMSE to hold, `USUAL_ERROR` by default.

    Raises
    ------
    InputError
        For a kernel, another setting or an error that nobody can ask for, and where every method refuses the scene.
    """
    given = dict(settings or {})
    asked = given.pop("error", USUAL_ERROR)
    if kernel is not None or given:
        other = f"the kernel {kernel!r}" if kernel is not None else f"{next(iter(given))!r}"
        raise InputError(f"--method auto: got {other}, wanted --set error=SHARE or nothing: it chooses the rest itself")
    advice = advise(read_model(), scene, checked_error(asked, "--method auto: error"))
    if advice.best is None:
        raise InputError(f"--method auto: every method refuses the scene: {advice.candidates[0].refused}")
    return advice.best.chosen, advice


def checked_error(asked: Any, where: str) -> float:
    """Return an error that can be asked for; refuse others by what they are."""
    try:
        error = float(asked)
    except (TypeError, ValueError):
        error = float("nan")
    if not 0 < error < 1:
        raise InputError(f"{where}: got {asked}, wanted a relative RMSE between 0 and 1, such as 1e-3")
    return error


def words_of(advice: Advice) -> str:
    """Return what was chosen and why, in a line."""
    best = advice.best
    if best is None:
        return "every method refuses the scene"
    bound = f"stays below {best.error_bound:.2g} in {best.covered:.0%} of scenes like it"
    known = "" if advice.holds else f"; none is predicted to hold {advice.error:g}"
    return f"{best.chosen.label}: predicted to cost {best.cost_ms:.3g} ms a frame; its error {bound}{known}"
