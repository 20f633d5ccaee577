# SPDX-License-Identifier: BSD-3-Clause
"""The description of a scene as a table."""

from collections.abc import Iterator, Mapping
from typing import Any

from airlight.reports.tables.table import Column, Table, table

_LISTED = 12  # most surfaces and values that are shown; the others are in the JSON

#: Units of numbers by their name in the JSON.
_UNITS = {
    **dict.fromkeys(
        ("position", "centre", "radius", "sides", "low", "high", "floor", "cap", "base"), "m"
    ),
    **dict.fromkeys(("scale_height", "mean_free_path"), "m"),
    **dict.fromkeys(("sigma_t", "sigma_s", "sigma_a", "constant", "mean", "largest"), "1/m"),
    **dict.fromkeys(("power", "power_all_round"), "W"),
    **dict.fromkeys(("cutoff_angle", "beam_angle"), "degrees from the axis"),
    **dict.fromkeys(("fov_horizontal", "fov_vertical"), "degrees"),
    **{
        "size": "pixels",
        "area": "m^2",
        "luminous_flux": "lm",
        "intensity": "W/sr",
        "irradiance": "W/m^2",
    },
    "radiance": "W/(m^2 sr)",
}

Cells = tuple[str, str, str]  # what it is, which part of it, and its value


def description_table(described: Mapping[str, Any]) -> Table:
    """Return a description by `reports.interchange.scene.describe_scene`, a
    row for each number to set.
    """
    width, height = described["camera"]["size"]
    title = f"{described['scene']}, {width} x {height} pixels. {described['purpose']}"
    columns = (
        Column("what", "", words=True),
        Column("part", "", words=True),
        Column("value", "", words=True, long=True),
    )
    return table(title, columns, _rows(described))


def _rows(described: Mapping[str, Any]) -> Iterator[Cells]:
    yield "axes", "", f"right-handed, {described['up']} up"
    yield from _block("camera", described["camera"])
    yield from _block("medium", described["medium"] or {"everywhere": "vacuum"})
    for medium in described["bounded_media"]:
        yield from _block("bounded medium", medium)
    for light in described["lights"]:
        yield from _block("light", light)
    yield from _block("sky", described["sky"] or {})
    surfaces = described["surfaces"]
    # A scene may have thousands of surfaces: the first ones and a count.
    yield "surfaces", "", f"{len(surfaces)}; diffuse: radiance = reflectance / pi irradiance"
    for surface in surfaces[:_LISTED]:
        yield (
            "",
            surface["name"],
            _words({key: value for key, value in surface.items() if key != "name"}),
        )
    if len(surfaces) > _LISTED:
        yield "", "", f"and {len(surfaces) - _LISTED} more: --json lists them"
    if "drawn" in described:
        yield from _block("drawn", described["drawn"])
    yield "pixels", "", described["radiance"]
    yield from _block("file to write", described["file"])


def _block(what: str, part: Mapping[str, Any]) -> Iterator[Cells]:
    """Yield a row for each member of a part; of several records a row each."""
    for name, value in part.items():
        # A list of records is numbered, a mapping of records goes by its keys; a list of numbers
        # stays in one row. The part is named in its first row only.
        listed = dict(enumerate(value, 1)) if isinstance(value, list | tuple) else value
        records = list(listed.items()) if isinstance(listed, Mapping) else []
        if records and all(isinstance(each, Mapping) for _, each in records):
            for key, each in records:
                yield what, f"{name} {key}", _words(each)
                what = ""
        else:
            yield what, name, _words(value, name)
            what = ""


def _words(value: Any, name: str = "") -> str:
    """Return a value in words, with the unit that its name has."""
    if isinstance(value, Mapping):
        return "; ".join(f"{key} {_words(each, key)}" for key, each in value.items())
    if isinstance(value, list | tuple) and len(value) > _LISTED:
        return f"{len(value)} values"
    if isinstance(value, list | tuple):
        # The size of an image is in pixels, that of a light that was drawn in metres.
        metres = name == "size" and any(isinstance(each, float) for each in value)
        unit = "m" if metres else _UNITS.get(name, "") if value else ""
        return f"({', '.join(map(_words, value))}) {unit}".rstrip()
    if isinstance(value, bool) or value is None:
        return {True: "yes", False: "no", None: "none"}[value]
    return (
        f"{value:.7g} {_UNITS.get(name, '')}".rstrip()
        if isinstance(value, int | float)
        else str(value)
    )
