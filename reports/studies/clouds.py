# SPDX-License-Identifier: BSD-3-Clause
"""Studies of clouds: a slab in sunlight by order of scattering, and the
grid of canonical transport.
"""

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, TypeAlias

from airlight.errors import InputError
from airlight.reports.api.inputs import Progress, Words, one_error, several, telling
from airlight.reports.studies.registry import Study
from airlight.reports.tables.table import Column, Table, numbers, table, words

if TYPE_CHECKING:
    Depths: TypeAlias = Sequence[float] | str | None
    Directions: TypeAlias = Sequence[tuple[float, float]] | str
else:
    Depths = Directions = str

_SIDES = (("reflectance", "reflected", "blue"), ("transmittance", "transmitted", "vermillion"))


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class SlabStudy(Study):
    """The light of a slab by order of scattering.

    A row for each set of orders has `orders` (its name), `reflectance`, `transmittance`,
    `reflected_mean`, `reflected_rms`, `transmitted_mean`, `transmitted_rms` [mean free paths] and
    `fluence`, a row for each depth. `data` has besides `orders` the `total` of all, with
    `reflectance`, `transmittance`, `flux` and `radiance`, the estimated `error` of every number,
    and `photons`: the same by photons, with standard errors.
    """

    def __getitem__(self, name: Any) -> Mapping[str, Any]:
        """Return the row of a set of orders by its name, such as '3-4', or of
        one order by its number.
        """
        for row in self.rows:
            if row["orders"] == str(name):
                return row
        raise KeyError(name)


@one_error
def slab(
    tau: float,
    sun: float,
    *,
    phase: str = "isotropic",
    albedo: float = 1.0,
    orders: Words = "sets",
    depths: Depths | None = None,
    directions: Directions = "",
    photons: int = 0,
    progress: Progress = None,
) -> SlabStudy:
    """Compute the light of a slab in sunlight by order of scattering.

    The study computes how much light the slab reflects and transmits, and where the light leaves
    the slab. Light of order n was scattered n times. Displacements are measured from the point of
    entry, horizontally: the mean along the direction in which the sun's light travels, and rms, the
    root of the mean of x^2 + y^2. The numbers come from a deterministic computation with an
    estimate of its error; `--photons` puts a random walk with standard errors beside them. See
    docs/the-reference.md.

    Parameters
    ----------
    tau
        Thickness of the slab [mean free paths], 1e-6 to 1e4.
    sun
        Zenith angle of the sun [degrees], from 0 to below 90.
    phase
        isotropic, hg:G, hg-draine:D, mie, mie-modified, or a CSV file of
        angles [degrees] and values.
    albedo
        Single-scattering albedo, 0 to 1.
    orders
        Orders of scattering, such as 1,2,3-4,31-inf; 'sets' are the orders of
        Bouthors 2008, 'all' is the sum.
    depths
        Depths of fluence, flux and radiance [mean free paths], with commas;
        top and bottom by default.
    directions
        Directions of the radiance, MU:PHI with commas: mu is positive upwards,
        phi [degrees] is 0 forward.
    photons
        Number of photons of a random walk that checks the numbers.
    progress
        Called with (fraction done, what); True shows a bar.

    Examples
    --------
    >>> import airlight
    >>> light = airlight.study("slab", 2.0, 30.0, phase="hg:0.75", albedo=0.9, orders=[1, 2])
    >>> light["1"]["reflectance"] > 0
    True
    """
    from airlight.validation.slab.light import expected_seconds, slab_numbers
    from airlight.validation.slab.request import slab_request
    from airlight.validation.study.cost import Work, check_work

    # One photon has no standard error.
    if photons != int(photons) or photons == 1 or photons < 0:
        raise InputError(
            f"photons: got {photons}, expected a whole number from 2 on, for example 1000000"
        )
    chosen = orders if isinstance(orders, str) else several(orders)
    request = slab_request(
        tau,
        sun,
        phase=os.fspath(phase),
        albedo=albedo,
        orders=chosen,
        depths=depths,
        directions=directions,
    )
    # The time is known before the work: it grows with the orders, the depths and the photons.
    check_work(f"photons {photons}", [Work(expected_seconds(request, int(photons)))])
    with telling(progress, "slab") as tell:
        found = slab_numbers(request, photons=int(photons), progress=tell)
    # The two numbers that most users want, with their errors; everything else is in tables.
    words_of = {
        side: f"{found['total'][side]:.7g} +- {found['error']['total'][side]:.1g}"
        for side in ("reflectance", "transmittance")
    }
    said = (
        f"All orders: reflectance {words_of['reflectance']}, transmittance "
        f"{words_of['transmittance']} (with the light "
        "that was never scattered)."
    )
    return SlabStudy(
        name="slab",
        data=found,
        tables=tuple(_slab_tables(found)),
        lines=(said,),
        rows=tuple(found["orders"]),
        draw=partial(_draw_slab, found),
    )


_EXITS = {
    f"{side}_{kind}": kind for side in ("reflected", "transmitted") for kind in ("mean", "rms")
}
_BY_ORDER = {"reflectance": "reflected", "transmittance": "transmitted", **_EXITS}


def _slab_tables(found: Mapping[str, Any]) -> Iterator[Table]:
    def by_order(title: str, rows: Sequence[Any], digits: int = 6) -> Table:
        columns = (*words("orders"), *numbers(**_BY_ORDER, how={"digits": digits}))
        return table(
            title, columns, [{name: row[name] for name in ("orders", *_BY_ORDER)} for row in rows]
        )

    # Tables follow from what was asked for: photons, depths and directions are optional.
    six: Mapping[str, Any] = {"digits": 6}
    photons, total = found["photons"], found["total"]
    yield by_order("By order; lengths in mean free paths", found["orders"])
    if photons:
        yield by_order(f"By {photons['count']} photons", photons["orders"])
        yield by_order("Standard errors of the photons", photons["standard_error"]["orders"], 2)
    # A row for each order and depth.
    fluence = [
        {"orders": row["orders"], **each} for row in found["orders"] for each in row["fluence"]
    ]
    if fluence:
        columns = (*words("orders"), *numbers("depth", "value", "mean", "rms", how=six))
        yield table("Fluence for unit flux across the beam", columns, fluence)
    if total["flux"]:
        title = "Diffuse flux of all orders for a flux of pi across the beam"
        yield table(title, numbers("depth", "up", "down", how=six), total["flux"])
    if total["radiance"]:
        columns = (
            *numbers("depth", "mu", "phi", "value", how=six),
            Column("error", "error", digits=2),
        )
        errors = found["error"]["total"]["radiance"]
        rows = [{**row, "error": e["value"]} for row, e in zip(total["radiance"], errors)]
        yield table("Radiance of all orders for a flux of pi across the beam", columns, rows)


def _draw_slab(found: Mapping[str, Any], column: str) -> Any:
    """Return the light that leaves a slab by order, and its distance from the entry,
    computed and by photons.
    """
    import numpy as np

    from airlight.reports.plotting.figure import new_figure
    from airlight.reports.plotting.style import COLOURS, WIDTHS, reference_style

    # Left the light that leaves the slab, right how far from its entry; the photons as black dots
    # over the computed bars and lines.
    rows, walked = found["orders"], found["photons"]
    width, double = WIDTHS[column], column == "double"
    figure = new_figure(width, 0.42 * width if double else 1.5 * width)
    fractions, lengths = figure.subplots(*((1, 2) if double else (2, 1)))
    places = np.arange(len(rows))
    dots = reference_style() | {"linestyle": "none", "marker": "o", "markersize": 2.5}

    def values(of: Any, name: str) -> Any:
        return np.array([np.nan if row[name] is None else row[name] for row in of], dtype=float)

    def put(panel: Any, name: str, at: Any, label: str | None = None) -> None:
        if walked:
            errors = 2 * np.nan_to_num(values(walked["standard_error"]["orders"], name))
            panel.errorbar(
                at, values(walked["orders"], name), errors, capsize=2, label=label, **dots
            )

    for number, (name, side, colour) in enumerate(_SIDES):
        # Bars of both sides stand beside one another, 0.2 to the left and to the right of their
        # order.
        at = places + 0.4 * number - 0.2
        fractions.bar(at, values(rows, name), 0.38, color=COLOURS[colour], label=side)
        put(fractions, name, at, "photons, ±2 standard errors" if number else None)
        for kind, style in (("mean", "--"), ("rms", "-")):
            key = f"{side}_{kind}"
            lengths.plot(
                places, values(rows, key), style, color=COLOURS[colour], label=f"{side}, {kind}"
            )
            put(lengths, key, places)
    for panel in (fractions, lengths):
        panel.set_xticks(places, [row["orders"] for row in rows], rotation=45)
        panel.set_xlabel("order of scattering")
        panel.legend()
    fractions.set_ylabel("fraction of the light [1]")
    lengths.set_ylabel("distance from the entry [mean free paths]")
    return figure
