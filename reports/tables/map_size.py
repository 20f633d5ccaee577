# SPDX-License-Identifier: BSD-3-Clause
"""The tables of `airlight maps`: error and flicker against the size of the shadow map."""

from typing import TYPE_CHECKING, Any

from reports.tables.bench import print_markdown
from reports.tables.terminal import number, print_table

if TYPE_CHECKING:
    from validation.frames.map_size import MapErrors, MapFlicker, Slope


def parse_map_sizes(option: str, words: str) -> list[int]:
    """Return the sizes of shadow maps that an option names, ascending.

    Raises
    ------
    InputError
        If one is none.
    """
    from analytic.errors import InputError
    from realtime.shadow_maps.shadow_map import check_size

    try:
        sizes = [int(one) for one in words.split(",")]
    except ValueError:
        raise InputError(f"{option}: got {words!r}, wanted sizes in texels, for example 128,256,512") from None
    for size in sizes:
        check_size(size)
    return sorted(set(sizes))


def map_data(errors: "MapErrors", flicker: "MapFlicker | None") -> dict[str, Any]:
    """Return what was found in one scene as JSON-ready data."""
    from reports.data.serialize import plain

    found = {"method": errors.configuration.label, "errors": plain(errors)}
    return found | {"flicker": None if flicker is None else plain(flicker)}


def print_maps(name: str, size: tuple[int, int], errors: "MapErrors", flicker: "MapFlicker | None", *, markdown: bool):
    """Print the tables of one scene.

    Parameters
    ----------
    name, size
        The scene and the size of its images [pixels].
    errors, flicker
        From `validation.frames.map_size`; flicker may be None.
    markdown
        Print Markdown.
    """
    show = print_markdown if markdown else print_table
    title = f"{name}, {size[0]} x {size[1]}, {errors.configuration.label}"
    cells = [
        (
            str(texels),
            *(number(value, 2) for value in (one.relative_rmse, one.relative_bias, one.p50, one.p99, one.max)),
        )
        for texels, one in zip(errors.sizes, errors.metrics, strict=True)
    ]
    show(("map", "rel. RMSE", "rel. bias", "p50", "p99", "max"), cells, f"{title}: error")
    print(f"\nThe relative RMSE {_trend(errors.slope)}.")
    if flicker is None:
        return
    cells = [
        (str(texels), *(number(value, 2) for value in values))
        for texels, *values in zip(flicker.sizes, flicker.texels, flicker.flicker, flicker.errors, strict=True)
    ]
    headers = ("map", "texels a frame", "flicker", "rel. RMSE")
    show(headers, cells, f"{title}: flicker of a moving light")
    print(f"\nThe flicker {_trend(flicker.slope)}; the truth itself changes by {number(flicker.truth_change, 2)}.")


def _trend(slope: "Slope") -> str:
    """Return how errors change with the size of the map, as the predicate of a sentence."""
    from math import isnan

    if isnan(slope.order):
        return "follows no law: too few errors above 0"
    spread = "" if isnan(slope.standard_error) else f" +- {slope.standard_error:.1g}"
    if abs(slope.order) < 0.01:
        return "does not depend on the size"
    if slope.order < 0:
        return f"does not fall: it grows as size^{-slope.order:.2f}{spread}"
    return f"falls as size^-{slope.order:.2f}{spread}"
