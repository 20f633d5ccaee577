# SPDX-License-Identifier: BSD-3-Clause
r"""The surface of a cloud with a density: where rho first exceeds a threshold rho_0, from the eye and from the sun.

Bouthors et al. 2008, sections 6.1 and 8, take for the lit surface the first voxel with rho > rho_0 along the light, and
slabs between it and the far side. A slab has one extinction, a cloud one at every place; but slabs depend on optical
lengths alone. So

    sigma_s = sigma_t mean(rho where rho > rho_0)        stands for the extinction of slabs: that of the cloud's body,
    Z = int rho dx / mean(rho where rho > rho_0)         for their thickness along the light, from the surface on,

whose product is the true optical thickness of the cloud, gaps and wisps counted with their densities. The light map
keeps front and front - Z, so that the filter and the search are the same as for homogeneous clouds. Depths below the
surface, and the ways to collectors, are lengths times sigma_s: exact where rho equals that of the body, which is
everywhere except in a layer at the surface.

Along a ray the density is taken at the ends of steps of a voxel, and the place between two of them at which it passes
rho_0 is linear.
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

from realtime.clouds.bounds import CloudSurfaces
from realtime.clouds.light_maps import LitSurfaces
from realtime.clouds.march import march, middle_density, voxel
from realtime.scene.lights import Light
from realtime.scene.media.bounded import Clouds
from realtime.shadow_maps.shadow_map import check_size, texel_rays


@dataclass(frozen=True)
class DenseSurface:
    """Where rays first meet more than the threshold."""

    distance: Any  #: infinite where they never do [m]
    cloud: Any  #: the number of the cloud there
    behind: Any  #: int rho dx from there on, 0 where it was not asked for [m]


def dense_surface(
    surfaces: CloudSurfaces,
    clouds: Clouds,
    origin,
    direction,
    end,
    *,
    threshold: Any,
    stride: Any,
    only: int | None = None,
) -> DenseSurface:
    """Return where rays first meet more than a density.

    `surfaces`, `clouds`, `origin`, `direction`, `end`, `stride`: as for
    `realtime.clouds.march.depths_along`; `threshold`: rho_0 [1]; `only`: the number of a cloud that is
    seen alone, with what the rays meet behind its surface; None for all, where rays end at the surface.
    """
    Float, lanes = type(direction.x), max(dr.width(direction), dr.width(origin))
    density = clouds.density
    assert density is not None

    def step(total, x, cloud):
        return stride * voxel(clouds, cloud)

    def add(total, begin, finish, cloud):
        distance, number, behind = total
        own = mi.Bool(True) if only is None else cloud == only
        searches = own & ~dr.isfinite(distance)
        first = density.at(origin + direction * begin, cloud, searches)
        second = density.at(origin + direction * finish, cloud, searches)
        at_once = searches & (first > threshold)
        passes = searches & ~at_once & (second > threshold)
        fraction = dr.select(passes, (threshold - first) / (second - first), 0)
        met = at_once | passes
        distance = dr.select(met, begin + fraction * (finish - begin), distance)
        number = dr.select(met, cloud, number)
        if only is None:
            return (distance, number, behind), ~met
        rho = middle_density(clouds, origin, direction, begin, finish, cloud)
        counted = own & dr.isfinite(distance)
        behind += dr.select(counted, rho * (finish - dr.maximum(begin, dr.select(counted, distance, 0))), 0)
        return (distance, number, behind), mi.Bool(True)

    total = (
        dr.full(Float, dr.inf, lanes),
        dr.zeros(mi.UInt32, lanes),
        dr.zeros(Float, lanes),
    )
    distance, number, behind = march(surfaces, origin, direction, end, total, step=step, add=add)
    return DenseSurface(distance, number, behind)


def lit_dense_surface(
    surfaces: CloudSurfaces,
    clouds: Clouds,
    light: Light,
    size: int,
    *,
    cloud: int,
    body: Any,
    threshold: float,
    stride: Any,
) -> LitSurfaces:
    """Return the lit surfaces of one cloud along a light, as `realtime.clouds.light_maps.cast_surfaces` does.

    `surfaces`, `clouds`, `threshold`, `stride`: as for `dense_surface`; `light`, `size`: as for `cast_surfaces`;
    `cloud`: its number; `body`: by cloud, mean(rho where rho > rho_0) [1].
    """
    check_size(size)
    Float, Vector = type(light.position.x), type(light.position)
    start, axis, texel = texel_rays(light, size)
    origin, direction = Vector(start), Vector(axis) + dr.zeros(Vector, size * size)
    met = dense_surface(
        surfaces, clouds, origin, direction, Float(dr.inf), threshold=threshold, stride=stride, only=cloud
    )
    there = dr.isfinite(met.distance)
    distance = dr.select(there, met.distance, 0)
    front = dr.select(there, Float(light.extent.depth) - distance, 0)
    back = dr.select(there, front - met.behind / dr.gather(Float, body, mi.UInt32(cloud)), 0)
    lit = LitSurfaces(size, texel, there, front, back)
    dr.eval(lit)
    return lit
