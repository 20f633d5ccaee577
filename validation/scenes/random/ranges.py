# SPDX-License-Identifier: BSD-3-Clause
"""What is drawn, from where to where: `ranges.toml` covers the methods' whole field, a file of one's own overrides it.

A pair is a range, a table of numbers are the weights of a choice.
"""

import math
import tomllib
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

from analytic.errors import InputError, nearest

FILE = Path(__file__).with_name("ranges.toml")

Ranges = dict[str, Any]


@cache
def _defaults() -> tuple[Ranges, Mapping[str, tuple[float, float]]]:
    """Return the ranges as they are drawn without a file, and the limits that they may have."""
    ranges = tomllib.loads(FILE.read_text(encoding="utf-8"))
    limits = ranges.pop("limits")
    return ranges, limits


def read_ranges(path: Path) -> Ranges:
    """Read ranges from a TOML file."""
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"ranges: cannot read {path}: {error}") from error
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"ranges: {path} is no TOML: {error}") from error
    return ranges_from(table, str(path))


def ranges_from(table: Mapping[str, Any], where: str = "ranges") -> Ranges:
    """Return the usual ranges with what a table says in their place.

    Unknown names, ranges that are empty or beyond what can be drawn, and weights of which none is above 0 are refused.
    """
    usual, limits = _defaults()
    changed: Ranges = {}
    for name, value in table.items():
        if name not in usual:
            raise InputError(f"{where}: got {name!r}, wanted some of {', '.join(usual)}{nearest(name, usual)}")
        if name in limits:
            changed[name] = _checked_range(f"{where}: {name}", value, *limits[name])
        elif name != "meshes":
            changed[name] = _checked_weights(f"{where}: {name}", value, tuple(usual[name]))
        elif not isinstance(value, str) or (value and not Path(value).is_dir()):
            raise InputError(f"{where}: {name} is {value!r}; wanted a folder of .obj and .ply files")
        else:
            changed[name] = value
    return usual | changed


def _checked_range(where: str, value: Any, least: float, most: float) -> tuple[float, float]:
    pair = value if isinstance(value, list | tuple) else [value, value]
    if len(pair) != 2 or not all(_is_number(each) for each in pair) or not least <= pair[0] <= pair[1] <= most:
        raise InputError(f"{where} is {value!r}; wanted [from, to], two numbers from {least:g} to {most:g}")
    return float(pair[0]), float(pair[1])


def _checked_weights(where: str, value: Any, names: tuple[str, ...]) -> dict[str, float]:
    if not isinstance(value, Mapping):
        raise InputError(f"{where} is {value!r}; wanted a table of weights, such as {{ {names[0]} = 1 }}")
    for name, weight in value.items():
        if name not in names:
            raise InputError(f"{where}: got {name!r}, wanted some of {', '.join(names)}{nearest(name, names)}")
        if not _is_number(weight) or weight < 0:
            raise InputError(f"{where}: {name} has the weight {weight!r}; wanted a number of 0 or more")
    if not any(value.values()):
        raise InputError(f"{where}: no weight is above 0; wanted one at least")
    return {name: float(value.get(name, 0.0)) for name in names}


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
