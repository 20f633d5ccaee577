# SPDX-License-Identifier: BSD-3-Clause
"""Scenes of challenges and their references, each made once for all tests."""

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

from airlight.validation.arrays import Array


def make_small(change: Callable[[Any, str, Any], None]) -> None:
    """Let challenges have three scenes of 32 x 24 pixels, by a function such as `setattr`."""
    from airlight.reports.challenge import draw, entry, folder, score

    change(draw, "EACH", 1)
    for module in (draw, entry, folder):
        change(module, "SIZE", (32, 24))
    for module in (folder, score):
        change(module, "draw_scenes", drawn)


@cache
def drawn(seed):
    """Return the scenes of a seed."""
    from airlight.reports.challenge.draw import draw_scenes

    return draw_scenes(seed)


@cache
def references(seed: str, folder: Path) -> dict[str, Array]:
    """Return the airlight of each scene of a seed by its name; a folder gets the scenes' files."""
    from airlight.reports.challenge.score import scene_reference

    return {each.name: scene_reference(folder, each)[0].airlight for each in drawn(seed)}
