# SPDX-License-Identifier: BSD-3-Clause
"""The figure of a slab by order: what leaves it, and how far from the point of entry, computed and by photons."""

from pathlib import Path

from reference.storage.files import ensure_folder
from reports.figures.files import new_figure, read_data, values, write_data
from reports.machine.progress import Progress
from reports.plotting.style import COLOURS, WIDTHS, truth_style

NAME = "slab-orders"
SUMMARY = "light reflected and transmitted by a slab of droplets by sets of orders, its mean and rms displacement"

TAU, SUN, PHASE = 10.0, 60.0, "mie"
_PHOTONS = 2_000_000
_NUMBERS = (
    "reflectance",
    "reflected_mean",
    "reflected_rms",
    "transmittance",
    "transmitted_mean",
    "transmitted_rms",
)
_HEADER = ("orders", *_NUMBERS, *(f"{name}_photons" for name in _NUMBERS), *(f"{name}_se" for name in _NUMBERS))


def compute(folder: Path | str, *, quick: bool = False, progress: Progress | None = None) -> None:
    """Write `slab-orders.csv` into a folder: the sets of orders of Bouthors 2008 in a slab of water droplets.

    Parameters
    ----------
    quick
        Fewer photons, and Henyey and Greenstein's phase function.
    """
    from validation.slab.light import slab_numbers
    from validation.slab.request import slab_request

    target = ensure_folder(folder)
    phase, photons = ("hg:0.85", 20_000) if quick else (PHASE, _PHOTONS)
    numbers = slab_numbers(slab_request(TAU, SUN, phase=phase, depths=()), photons=photons, seed=1, progress=progress)
    walked = numbers["photons"]
    rows = [
        (row["orders"], *(each[name] for each in (row, photon, error) for name in _NUMBERS))
        for row, photon, error in zip(numbers["orders"], walked["orders"], walked["standard_error"]["orders"])
    ]
    write_data(target, NAME, _HEADER, rows, tau=TAU, sun=SUN, phase=phase, photons=photons)


def draw(folder: Path | str, column: str = "double"):
    """Return the figure, see `reports.figures.files.plot`."""
    import numpy as np

    rows = read_data(folder, NAME)
    width = WIDTHS[column]
    double = column == "double"
    figure = new_figure(width, 0.42 * width if double else 1.5 * width)
    shares, lengths = figure.subplots(*((1, 2) if double else (2, 1)))
    places = np.arange(len(rows))
    sides = (("reflectance", "reflected", "blue"), ("transmittance", "transmitted", "vermillion"))
    dots = truth_style() | {"linestyle": "none", "marker": "o", "markersize": 2.5}

    def put(panel, name: str, at, label: str | None = None) -> None:
        errors = 2 * np.nan_to_num(np.array(values(rows, f"{name}_se")))
        panel.errorbar(at, values(rows, f"{name}_photons"), errors, capsize=2, label=label, **dots)

    for number, (share, side, colour) in enumerate(sides):
        at = places + 0.4 * number - 0.2
        shares.bar(at, values(rows, share), 0.38, color=COLOURS[colour], label=side)
        put(shares, share, at, "photons, ±2 standard errors" if number else None)
        for kind, style in (("mean", "--"), ("rms", "-")):
            name = f"{side}_{kind}"
            lengths.plot(places, values(rows, name), style, color=COLOURS[colour], label=f"{side}, {kind}")
            put(lengths, name, places)
    for panel in (shares, lengths):
        panel.set_xticks(places, [row["orders"] for row in rows], rotation=45)
        panel.set_xlabel("order of scattering")
        panel.legend()
    shares.set_ylabel("share of the light [1]")
    lengths.set_ylabel("distance from the entry [mean free paths]")
    return figure
