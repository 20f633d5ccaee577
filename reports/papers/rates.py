# SPDX-License-Identifier: BSD-3-Clause
"""Frames a second of a row of a paper's table, beside what was published."""

from collections.abc import Mapping
from typing import Any

from reports.tables.methods import per_second
from reports.tables.table import Interval, Value, measured, numbers

_WHOLE = {"whole": True}
COLUMNS = (
    *numbers("published"),
    *numbers(light_moved="light moved: all anew", how=_WHOLE),
    *numbers(of_published="of published", how={"digits": 2, "after": " x"}),
    *numbers(light_moved_camera_kept="light moved: camera rays kept", how=_WHOLE),
    *numbers(colours_changed="colours changed: surface and airlight anew", how=_WHOLE),
    *numbers(quartiles="quartiles ms of all anew"),
)


def rates(row: Mapping[str, Any], published: float | None, *, comparable: bool) -> dict[str, Value]:
    """Return the values of `COLUMNS`.

    Parameters
    ----------
    row
        Of report.json, with the timings of a frame; `light_moved` is None where nothing was measured.
    published
        Frames a second of the paper; None where it has none.
    comparable
        Whether the image has the published size.
    """
    if row["light_moved"] is None:
        return {"published": published}
    names = ("light_moved", "light_moved_camera_kept", "colours_changed")
    times = {name: measured(row.get(name)) for name in names}
    anew = times["light_moved"]
    assert anew is not None
    return {
        "published": published,
        "of_published": 1000 / anew.median / published if published and comparable else None,
        "quartiles": Interval(anew.low, anew.high),
        **{name: per_second(time) for name, time in times.items()},
    }


def size_words(row: Mapping[str, Any]) -> str:
    """Return the size of an image in words."""
    return "{} x {}".format(*row["size"])
