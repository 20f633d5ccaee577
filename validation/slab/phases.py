# SPDX-License-Identifier: BSD-3-Clause
"""Phase functions of a slab by name or from a file, written for each side by itself.

A file has two columns: the scattering angle [degrees], increasing from 0 to 180, and the phase
function there, in any unit: it is divided by its mean over the sphere. Between rows it is linear in
the angle. A first line of names is allowed, and so are lines that begin with #.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from airlight.analytic import phase as analytic
from airlight.analytic.droplets import Modified
from airlight.analytic.phase import phase_from_words
from airlight.errors import InputError
from airlight.realtime.clouds.slab_orders.phases import AnglePhase, HenyeyGreensteinPhase, SlabPhase
from airlight.realtime.droplets import CUT, droplet_series
from airlight.realtime.scene.phase import HgDraine
from airlight.reference.monte_carlo.slab_walk.scattering import HenyeyGreenstein, Tabulated
from airlight.reference.monte_carlo.slab_walk.walk import Scattering
from airlight.validation.arrays import Array
from airlight.validation.readers import read_csv

#: |g| up to which the streams resolve Henyey and Greenstein's lobe
LARGEST_G = 0.98


@dataclass(frozen=True)
class PhasePair:
    """One phase function on both sides."""

    name: str  #: as it was asked for
    deterministic: SlabPhase  #: for `realtime.clouds`
    sampled: Callable[[], Scattering]  #: makes it for the photons, when they are asked for


def phase_pair(name: str) -> PhasePair:
    """Return a phase function by its name.

    'isotropic', 'hg', 'hg-draine', 'mie' and 'mie-modified', with numbers as of
    `analytic.phase.phase_from_words`, or the path of a CSV file.
    """
    if name.lower().endswith(".csv"):
        angles, heights = read_phase_file(Path(name))
        return PhasePair(name, tabulated_phase(angles, heights), lambda: Tabulated(angles, heights))
    phase = phase_from_words(name)
    # Henyey and Greenstein's function of g = 0 is isotropic.
    if isinstance(phase, analytic.Isotropic | analytic.HenyeyGreenstein):
        g = phase.g if isinstance(phase, analytic.HenyeyGreenstein) else 0.0
        if abs(g) > LARGEST_G:
            raise InputError(
                f"phase: got the mean cosine {g:g}, expected -{LARGEST_G} to {LARGEST_G}, for "
                "example hg:0.85"
            )
        return PhasePair(name, HenyeyGreensteinPhase(g), lambda: HenyeyGreenstein(g))
    if isinstance(phase, analytic.HgDraine):
        return PhasePair(name, hg_draine_phase(phase.diameter), lambda: _table(phase))
    if not isinstance(phase, analytic.Mie):
        raise InputError(
            f"phase: got {name!r}, expected isotropic, hg:G, hg-draine, mie, mie-modified or "
            "FILE.csv"
        )
    numbers = phase.droplets.effective_radius, phase.droplets.gamma, phase.wavelength
    deterministic = droplet_phase(*numbers, modified=isinstance(phase, analytic.MieModified))
    return PhasePair(name, deterministic, lambda: _table(phase))


def _table(phase: analytic.PhaseFunction) -> Tabulated:
    """Return droplets as a table, by angles that resolve the peak, and the
    place where one is cut out.
    """
    # Even angles; the lobe of the fit is so narrow that its angles are even in the logarithm, and
    # where a peak is cut out both sides of the jump are entries.
    rows = 20_000
    angles, edge = np.linspace(0.0, np.pi, rows + 1), np.deg2rad(Modified.angle)
    if phase.name == "hg-draine":
        angles = np.append(np.concatenate([[0.0], np.geomspace(1e-6, np.pi, rows)])[:-1], np.pi)
    if phase.name == "mie-modified":
        angles = np.unique(np.concatenate([angles, [edge * (1 - 1e-12), edge]]))
    return Tabulated(angles, phase.from_half(np.sin(angles / 2) ** 2, np.cos(angles / 2) ** 2))


def read_phase_file(path: Path) -> tuple[Array, Array]:
    """Return angles [rad] and values of a CSV file."""
    rows = read_csv(path)
    # A first line of names.
    if rows and not _is_number(rows[0][1][0]):
        rows = rows[1:]
    for number, cells in rows:
        if len(cells) != 2 or not all(map(_is_number, cells)):
            raise InputError(
                f"{path}, line {number}: got {','.join(cells)!r}, expected an angle [degrees] and "
                "a value"
            )
    if len(rows) < 2:
        raise InputError(
            f"{path}: got {len(rows)} rows, expected at least two, of angles from 0 to 180 degrees"
        )
    table = np.array([[float(cell) for cell in cells] for _, cells in rows])
    degrees, values = table.T
    if degrees[0] != 0 or degrees[-1] != 180:
        raise InputError(
            f"{path}: got angles from {degrees[0]:g} to {degrees[-1]:g}, expected 0 to 180 degrees"
        )
    # The row that does not increase is the one after the difference.
    falling = np.flatnonzero(np.diff(degrees) <= 0)
    if falling.size:
        raise InputError(
            f"{path}, line {rows[int(falling[0]) + 1][0]}: angles must increase from row to row"
        )
    bad = np.flatnonzero((values < 0) | (values > 1e30))
    if bad.size:
        number = rows[int(bad[0])][0]
        raise InputError(
            f"{path}, line {number}: got the value {values[bad[0]]:g}, expected 0 to 1e30"
        )
    # Values at 0 and 180 degrees alone would be a function without light, except where both are all
    # that there is.
    if not values[1:-1].any() and not (len(values) == 2 and values.any()):
        raise InputError(
            f"{path}: all values are 0 between 0 and 180 degrees, expected a phase function"
        )
    return np.deg2rad(degrees), values / values.max()


def _is_number(word: str) -> bool:
    try:
        return bool(np.isfinite(float(word)))
    except ValueError:
        return False


def tabulated_phase(angles: Array, heights: Array) -> AnglePhase:
    """Return the phase function that is linear in the angle between values.

    `angles` increase from 0 to pi [rad], (A,); `heights`, (A,), are not negative, in any unit.
    """
    return AnglePhase(lambda angle: np.interp(angle, angles, heights), angles)


def droplet_phase(radius: float, gamma: float, wavelength: float, *, modified: bool) -> AnglePhase:
    """Return the phase function of droplets; the numbers are those of
    `realtime.droplets.droplet_series`.

    If it is `modified`, the peak below `CUT` is cut to zero: lengths are then those of the medium
    whose density is lowered by the fraction of the peak.
    """
    series, edge = droplet_series(radius, gamma, wavelength), np.deg2rad(CUT)
    if not modified:
        return AnglePhase(series.values, np.array([0.0, np.pi]))
    return AnglePhase(
        lambda angles: np.where(angles < edge, 0.0, series.values(angles)),
        np.array([0.0, edge, np.pi]),
    )


def hg_draine_phase(diameter: float) -> AnglePhase:
    """Return `realtime.scene.phase.HgDraine` of droplets of a diameter of 5 to 50 um.

    Its narrow lobe is a few thousandths wide: panels near the peak are as short
    as their distance from it.
    """
    fit = HgDraine(diameter)
    (fraction, narrow), (_, wide) = fit.lobes
    constant, square = fit.rise
    breaks = np.append(0.0, np.geomspace(1e-4, np.pi, 16))
    breaks[-1] = np.pi

    def heights(angles: Array) -> Array:
        down, cosines = np.sin(angles / 2) ** 2, np.cos(angles)
        # 4 g sin^2(theta/2) + (1 - g)^2 is 1 + g^2 - 2 g cos theta, without cancellation near the
        # peak.
        lobes = [(1 - g * g) / ((1 - g) ** 2 + 4 * g * down) ** 1.5 for g in (narrow, wide)]
        return fraction * lobes[0] + (constant + square * cosines**2) * lobes[1]

    return AnglePhase(heights, breaks)
