# SPDX-License-Identifier: BSD-3-Clause
"""A Mitsuba scene of some shapes, under the names that they have.

A key of Mitsuba's dictionaries becomes the name of the shape, may hold no dots, and of two shapes with one key the last
alone is left. So the keys are numbers, and the shapes get their names back.
"""

from collections.abc import Sequence
from typing import Any

import mitsuba as mi


def scene_of(shapes: Sequence[Any], others: dict[str, Any] | None = None) -> Any:
    """Return a Mitsuba scene of shapes, all of which keep their names; `others` is what else is in its dictionary."""
    names = [shape.id() for shape in shapes]
    parts = {f"shape-{number}": shape for number, shape in enumerate(shapes)}
    scene = mi.load_dict({"type": "scene"} | (others or {}) | parts)
    for shape, name in zip(shapes, names, strict=True):
        shape.set_id(name)
    return scene
