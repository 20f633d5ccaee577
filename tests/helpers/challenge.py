# SPDX-License-Identifier: BSD-3-Clause
"""Scenes of challenges and their references, each made once for all tests."""

from functools import cache
from pathlib import Path

from airlight.validation.arrays import Array


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
