# SPDX-License-Identifier: BSD-3-Clause
"""Camera rays in a density grid, sampled: extinctions by Mitsuba's plugin, transmittances by ratio tracking.

Transmittances are unbiased estimates by ratio tracking with Mitsuba's own majorant m (Novak, Selle, Jarosz 2014): the
product of 1 - sigma_t/m over the points of a Poisson process of the density m. No cell of the grid and no optical depth
is known here. Distances are equi-angular about lights at places and even under suns and skies, between the ends of the
box. Integrands are bounded: over the angle at a place sigma_t T_1 T_2 p height, under a sun sigma_t T_1 T_2 p.
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

from reference.monte_carlo.single_scatter.boundary_walk import Surroundings
from reference.monte_carlo.single_scatter.distance_sampling import Span, equi_angular, equi_angular_pdf
from reference.monte_carlo.single_scatter.stretches import Part, Path, Ray, lit


def read_majorant(medium) -> float:
    """Return the largest extinction of a Mitsuba medium with a grid [1/m], 0 of others."""
    if "sigma_t.data" not in mi.traverse(medium):
        return 0.0
    return float(dr.max(medium.get_majorant(dr.zeros(mi.MediumInteraction3f)))[0])


@dataclass(frozen=True)
class _GridPart(Part):
    """Camera rays in the box of a grid."""

    majorant: float
    estimated = True

    def distances(self, u, low, length, span: Span | None) -> tuple[Any, Any]:
        """Sample distances by the angle at a light, or evenly; see `Part`."""
        u = mi.Float64(u)
        if span is None:
            return u * length, 1 / length
        y = equi_angular(u, span)
        return y, equi_angular_pdf(y, span)

    def kept(self, x, point, path: Path, ray: Ray, sampler, active) -> tuple[Any, Any]:
        """Return estimates of the transmittance of both ways; see `Part`."""
        camera, sampler = self._tracked((ray.origin, ray.direction, mi.Float(x)), sampler, active)
        light, sampler = self._tracked(path.shadow_ray(), sampler, active)
        return lit(self.around, path, active) * (camera * light), sampler

    def _tracked(self, line: tuple[Any, Any, Any], sampler, active) -> tuple[Any, Any]:
        """Return estimates of the transmittance along lines: origin, direction, length [m]; and the sampler."""
        origin, direction, distance = line
        meets, near, far = self.medium.intersect_aabb(mi.Ray3f(origin, direction))
        begin, end = dr.maximum(near, 0), dr.minimum(far, distance)

        def fly(x, kept, sampler):
            x = x - dr.log(1 - sampler.next_1d()) / self.majorant
            place = dr.zeros(mi.MediumInteraction3f)
            place.p = origin + direction * x
            _, _, sigma_t = self.medium.get_scattering_coefficients(place, x < end)
            return x, dr.select(x < end, kept * (1 - sigma_t[0] / self.majorant), kept), sampler

        start = dr.select(active & meets, begin, dr.inf)
        state = start, dr.full(mi.Float, 1, dr.width(start)), sampler
        _, kept, sampler = dr.while_loop(state, lambda x, *_: x < end, fly, label="ratio tracking")
        return kept, sampler


def grid_part(majorant: float, around: Surroundings, ray: Ray, medium, distance) -> Part:
    """Return the part of camera rays in the box of a density grid, up to the surface at a distance [m]."""
    meets, near, far = medium.intersect_aabb(mi.Ray3f(ray.origin, ray.direction))
    start, end = mi.Float64(dr.maximum(near, 0)), mi.Float64(dr.minimum(far, distance))
    return _GridPart(around, start, end, medium, meets & (end > start), majorant)
