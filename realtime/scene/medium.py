# SPDX-License-Identifier: BSD-3-Clause
"""Homogeneous media as Dr.Jit values: what fills space, and bounded media in it."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import drjit as dr

from realtime.numerics.array_types import is_single
from realtime.scene.density import Density
from realtime.scene.phase import Phase

OPTICAL_REACH = 20.0  #: optical depths after which float32 has nothing left of light: e^-20 = 2e-9


@dataclass(frozen=True)
class Medium:
    """A homogeneous medium. One extinction for a grey medium, three for a coloured one: code runs once for each."""

    sigma_t: tuple[Any, ...]  #: extinction [1/m], one or three values
    albedo: Any  #: single-scattering albedo, RGB [1]
    phase: Phase
    bounded_media: tuple["BoundedMedium", ...] = ()  #: convex, disjoint, with as many extinctions
    clear: bool = False  #: around the bounded media nothing scatters or absorbs
    clouds: "Clouds | None" = None  #: in clear air: all bounded media, of any shape, for methods that render clouds


@dataclass(frozen=True)
class BoundedMedium:
    """A homogeneous medium within convex bounds (`realtime.scene.convex_bounds`)."""

    medium: Medium
    planes: Any  #: four numbers a half space: its outward normal, and its distance from `centre` [m]; None for a sphere
    count: int  #: half spaces
    centre: Any  #: of the sphere, or of one that holds the medium [m]
    radius: Any  #: of that sphere [m]
    mean_distance: Any  #: R, see `realtime.scene.convex_bounds.mean_distance` [m]
    neighbours: Any = None  #: `sides` numbers a half space: planes that share an edge with it, or itself; None: sphere
    beside: Any = None  #: `planes` of the neighbours
    sides: int = 0
    starts: Any = None  #: by cell of directions a half space, see `realtime.scene.convex_bounds.radial_planes`


@dataclass(frozen=True)
class Clouds:
    """Media within closed bounds of any shape, disjoint, in clear air: tables with an entry for each."""

    sigma_t: tuple[Any, ...]  #: extinction [1/m], by channel; the largest of a cloud with a density
    albedo: Any  #: single-scattering albedos, RGB [1]
    phases: tuple[Phase, ...]  #: those that differ
    phase: Any  #: the number of each cloud's phase function
    density: Density | None = None  #: from place to place; None where all clouds are homogeneous


def per_extinction(medium: Medium, function: Callable[[Any], Any]):
    """Return `function(sigma_t)` for a grey medium, and its three values as a colour for a coloured one."""
    values = [function(sigma_t) for sigma_t in medium.sigma_t]
    return values[0] if len(values) == 1 else type(medium.albedo)(*values)


def optical_reach(Float) -> float:
    """Return the optical depths after which a number type has nothing left of light; float64 takes twice as many."""
    return OPTICAL_REACH if is_single(Float) else 2 * OPTICAL_REACH


def least_extinction(medium: Medium):
    """Return the smallest extinction of the channels [1/m]."""
    least = medium.sigma_t[0]
    for sigma_t in medium.sigma_t[1:]:
        least = dr.minimum(least, sigma_t)
    return least


def transmittance(medium: Medium, distance):
    """Return exp(-sigma_t distance) [1], one value or a colour as in `per_extinction`."""
    return per_extinction(medium, lambda sigma_t: dr.exp(-sigma_t * distance))
