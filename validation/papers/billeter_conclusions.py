# SPDX-License-Identifier: BSD-3-Clause
"""The conclusions of Billeter, Sintorn, Assarsson 2010, and whether they hold for our measurements.

Every sentence is computed from the rows that were measured.
"""

from collections.abc import Iterator, Mapping, Sequence

from validation.configurations.timing import Timing
from validation.papers.billeter_images import TILES, VOLUMES, FigureRow
from validation.papers.billeter_tessellation import PublishedTable, TableRow

#: Rates whose ratio is below this count as equal.
EQUAL = 1.03


def pays_from(rates: Mapping[int, tuple[float, float]]) -> int | None:
    """Return the smallest map [texels] from which on adaptive tessellation is faster at every larger size.

    Parameters
    ----------
    rates
        By size of the map [texels], frames a second with static and with adaptive tessellation.

    Returns
    -------
    int or None
        None if adaptive tessellation is not faster at the largest map.
    """
    smallest = None
    for size in sorted(rates, reverse=True):
        static, adaptive = rates[size]
        if adaptive <= EQUAL * static:
            break
        smallest = size
    return smallest


def conclusions(figures: Sequence[FigureRow], table: Sequence[TableRow]) -> list[str]:
    """Return sentences on the paper's conclusions, as far as the rows allow them.

    Parameters
    ----------
    figures
        Rows of Figures 6 and 7.
    table
        Rows of Table 1.
    """
    return [
        *_adaptive(table),
        *_walk(table),
        *_marching(figures),
        *_tiles(figures),
        *_walls(figures),
        *_map_sizes(figures),
    ]


def _adaptive(table: Sequence[TableRow]) -> Iterator[str]:
    for published in _views(table):
        rows = {(row.map, row.evaluation): _rate(row.light_moved) for row in table if row.published == published}
        pairs = {size: (rows.get((size, "static")), rows.get((size, "adaptive"))) for size, _ in rows}
        known = {size: (static, adaptive) for size, (static, adaptive) in pairs.items() if static and adaptive}
        if not known:
            yield f"{published.scene}: adaptive tessellation could not be compared with static at any map."
            continue
        ratios = ", ".join(f"{adaptive / static:.2f} at {size}" for size, (static, adaptive) in sorted(known.items()))
        shared = {size: published.fps[size] for size in known if size in published.fps}
        words = f"{published.scene}: adaptive tessellation is faster than static {_from(pays_from(known))}"
        words += f" (its frames a second over static's: {ratios})"
        if not shared:
            yield words + "; the paper has no figures for these maps."
            continue
        same = pays_from(shared) == pays_from({size: known[size] for size in shared})
        verdict = "the same as published" if same else "the paper's conclusion does not hold here"
        yield f"{words}, published: {_from(pays_from(shared))}; {verdict}."


def _walk(table: Sequence[TableRow]) -> Iterator[str]:
    for published in _views(table):
        ratios = []
        for size in dict.fromkeys(row.map for row in table if row.published == published):
            rates = {
                row.evaluation: _rate(row.light_moved) for row in table if (row.published, row.map) == (published, size)
            }
            meshes = [rate for name in ("static", "adaptive") if (rate := rates.get(name))]
            if meshes and (walk := rates.get("walk")):
                ratios.append(f"{walk / max(meshes):.2f} at {size}")
        if ratios:
            yield f"{published.scene}: frames a second of walk over those of the faster mesh: {', '.join(ratios)}."


def _marching(figures: Sequence[FigureRow]) -> Iterator[str]:
    """Compare the paper's marcher with each form of the light volume by itself: only the mesh is the paper's."""
    whole = [row for row in figures if row.entry.where != TILES]
    marched = [row for row in whole if row.entry.method == "ray-march" and _parameter(row, "sum") == "transitions"]
    volumes = {row.entry.volume: row for row in whole if row.entry.where.startswith("Fig. 7") and row.entry.volume}
    for row in marched:
        if row.light_moved is None:
            yield f"Fig. 7: marching with {_parameter(row, 'steps')} samples was not measured: {row.missing}."
    for name in VOLUMES:
        volume = volumes.get(name)
        if volume is not None:
            for row in marched:
                yield from _marched_against(row, volume, name)


def _marched_against(row: FigureRow, volume: FigureRow, name: str) -> Iterator[str]:
    """Compare the marcher with one form of the light volume."""
    if row.light_moved is None or row.error is None or row.map_error is None:
        return
    if volume.light_moved is None or volume.error is None or volume.map_error is None:
        return
    steps = _parameter(row, "steps")
    times = row.light_moved.median_ms / volume.light_moved.median_ms
    words = f"Fig. 7: marching with {steps} samples takes {times:.3g} times as long as the {name}"
    if row.entry.fps and volume.entry.fps:
        of_mesh = "" if name == "mesh" else " of the mesh"
        words += f" (published{of_mesh}: {volume.entry.fps / row.entry.fps:.3g})"
    share = _ratio(volume.map_error.relative_rmse, row.map_error.relative_rmse)
    words += f"; against the same map the {name} has {share:.2g} of its error"
    yield words + f", against the truth {_ratio(volume.error.relative_rmse, row.error.relative_rmse):.2g}."
    faster = "faster" if times > EQUAL else "no faster"
    equal = "as good" if row.error.relative_rmse <= 1.1 * volume.error.relative_rmse else "not as good"
    yield f"Fig. 7: the {name} is {faster} than {steps} samples, which by the error against the truth are {equal}."


def _tiles(figures: Sequence[FigureRow]) -> Iterator[str]:
    by_entry = {(row.entry.method, row.entry.map, row.entry.parameters): row for row in figures}
    for row in figures:
        if row.entry.where != TILES:
            continue
        values = dict(row.entry.parameters)
        del values["tolerance"]
        other = by_entry.get((row.entry.method, row.entry.map, tuple(values.items())))
        if (
            other is None
            or row.light_moved is None
            or other.light_moved is None
            or row.error is None
            or other.error is None
        ):
            continue
        share = row.light_moved.median_ms / other.light_moved.median_ms
        yield (
            f"{row.entry.scene}, {row.entry.configuration('exact').label}: where airlight between the corners of tiles "
            f"is interpolated, a frame takes {share:.2f} of the time; relative RMSE against the truth "
            f"{row.error.relative_rmse:.2g} instead of {other.error.relative_rmse:.2g}."
        )


def _walls(figures: Sequence[FigureRow]) -> Iterator[str]:
    pairs: dict[tuple[str, int], dict[str, tuple[float, float]]] = {}
    for row in figures:
        walls = dict(row.entry.parameters).get("walls") if row.entry.where != TILES else None
        if walls is not None and row.light_moved is not None and row.error is not None:
            measured = row.light_moved.median_ms, row.error.relative_rmse
            pairs.setdefault((row.entry.scene, row.entry.map), {})[str(walls)] = measured
    for (scene, texels), by_walls in pairs.items():
        if len(by_walls) == 2:
            (slanted_ms, slanted), (upright_ms, upright) = by_walls["slanted"], by_walls["upright"]
            yield (
                f"{scene}, map {texels}: with upright walls a frame takes {upright_ms / slanted_ms:.2f} times as long "
                f"as with slanted ones, and has {_ratio(upright, slanted):.2g} of their error against the truth."
            )


def _map_sizes(figures: Sequence[FigureRow]) -> Iterator[str]:
    """Compare the largest map with the smallest, each form of the light volume with itself."""
    for name in VOLUMES:
        rows = [row for row in figures if row.entry.where.startswith("Fig. 6") and row.entry.volume == name]
        times = {
            row.entry.map: (row.light_moved.median_ms, row.entry.fps)
            for row in rows
            if row.light_moved is not None and row.entry.fps
        }
        if len(times) < 2:
            continue
        small, large = min(times), max(times)
        here, published = times[large][0] / times[small][0], times[small][1] / times[large][1]
        of_mesh = "" if name == "mesh" else " of the mesh"
        yield (
            f"Fig. 6: from map {small} to {large} a frame of the {name} takes {here:.3g} times as long, "
            f"published{of_mesh}: {published:.3g}."
        )


def _views(table: Sequence[TableRow]) -> list[PublishedTable]:
    views: list[PublishedTable] = []
    for row in table:
        if row.published not in views:
            views.append(row.published)
    return views


def _parameter(row: FigureRow, name: str) -> float | str | None:
    return dict(row.entry.parameters).get(name)


def _rate(timing: Timing | None) -> float | None:
    return None if timing is None else 1000 / timing.median_ms


def _ratio(numerator: float, denominator: float) -> float:
    return numerator / denominator if denominator > 0 else float("nan")


def _from(size: int | None) -> str:
    return "at none of these maps" if size is None else f"from {size} on"
