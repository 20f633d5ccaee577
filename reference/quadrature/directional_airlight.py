# SPDX-License-Identifier: BSD-3-Clause
"""The airlight of one directional light along the camera rays of a scene, in bounded media."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reference.quadrature.directional_sums import sum_directional
from reference.quadrature.segments import Segments, camera_segments, scattering_range
from reference.scene.directional_light import DirectionalLight
from reference.scene.read import TruthScene
from reference.visibility.directional_casting import directional_intervals, edge_scale
from reference.visibility.intervals import LitIntervals
from reference.visibility.parallel_rays import ParallelRays, parallel_rays

Array = NDArray[np.float64]


@dataclass(frozen=True)
class DirectionalAirlight:
    """What a directional light sends along rays."""

    radiance: Array  #: (rays, 3) [W/(m^2 sr)]
    bound: Array  #: of its error, (rays, 3) [W/(m^2 sr)]
    lit: LitIntervals  #: as shares of the way between the first and the last distance at which a medium scatters


def directional_airlight(
    truth: TruthScene, light: DirectionalLight, distance: Array, how: dict[str, Any]
) -> DirectionalAirlight | None:
    """Compute the airlight of one light; None where nothing scatters.

    Parameters
    ----------
    truth, light
        The scene and the light.
    distance
        To the visible surface, (rays,) [m].
    how
        What `reference.visibility.directional_casting.directional_intervals` takes: how the lit intervals are found.
    """
    if not truth.media:
        return None
    rays, lit, segments = lit_parallel_rays(truth, light, distance, how)
    radiance, bound = sum_directional(truth, light, rays, lit, segments, scale=edge_scale(truth, rays))
    return DirectionalAirlight(radiance, bound + _worth_of_doubt(truth, light, rays, lit), lit)


def lit_parallel_rays(
    truth: TruthScene, light: DirectionalLight, distance: Array, how: dict[str, Any]
) -> tuple[ParallelRays, LitIntervals, Segments]:
    """Return the rays in their planes with a light, which parts of them it reaches, and the media along them.

    Parameters
    ----------
    truth, light, distance, how
        See `directional_airlight`.
    """
    segments = camera_segments(truth, distance)
    rays = parallel_rays(truth.origin, truth.direction, light, scattering_range(segments))
    return rays, directional_intervals(truth, rays, **how), segments


def _worth_of_doubt(truth: TruthScene, light: DirectionalLight, rays: ParallelRays, lit: LitIntervals) -> Array:
    """Return the most that the places which the shadow rays left in doubt can be worth: no light lost on the way."""
    worth = np.zeros((len(rays.direction), 3))
    if lit.doubt is None:
        return worth
    ray, _, share = lit.doubt
    length = share * (rays.last - rays.first)[ray]
    for medium in truth.media:
        factor = medium.albedo * medium.sigma_t * light.irradiance / (4 * np.pi)
        np.add.at(worth, ray, (length * medium.phase(np.clip(rays.cosine[ray], -1, 1)))[:, None] * factor)
    return worth
