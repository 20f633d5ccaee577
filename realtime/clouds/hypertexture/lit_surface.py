# SPDX-License-Identifier: BSD-3-Clause
r"""The surface of a cloud with a density: where rho first exceeds a threshold rho_0, from the eye and from the sun.

Bouthors et al. 2008, sections 6.1 and 8, take for the lit surface the first voxel with rho > rho_0 along the light, and
slabs between it and the far side. A slab has one extinction, a cloud one at every place; but slabs depend on optical
lengths alone. So

    sigma_s = sigma_t mean(rho where rho > rho_0)        stands for the extinction of slabs: that of the cloud's body,
    Z = int rho dx / mean(rho where rho > rho_0)         for their thickness along the light, from the surface on,

of which the product is the optical thickness of the cloud as it is there, gaps and wisps counted as what they hold. The
light map keeps front and front - Z, so that the filter and the search are those of homogeneous clouds. Depths below the
surface, and the ways to collectors, are lengths times sigma_s: exact where rho is as in the body, which it is but for a
layer at the surface.

The normal is that of the surface rho = rho_0, or the hull's where the density exceeds it there. Along a ray the density
is taken at the ends of steps of a voxel, and the place between two of them at which it passes rho_0 is linear.
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

from realtime.clouds.bounds import CloudSurfaces, next_crossing
from realtime.clouds.hypertexture.march import march, middle_density, voxel
from realtime.clouds.light_maps import LitSurfaces
from realtime.scene.lights import Light
from realtime.scene.media.bounded import Clouds
from realtime.shadow_maps.shadow_map import check_size, texel_rays


@dataclass(frozen=True)
class DenseSurface:
    """Where rays first meet more than the threshold."""

    distance: Any  #: infinite where they never do [m]
    cloud: Any  #: the number of the cloud there
    hull: Any  #: whether it is the boundary of the cloud, or the start of the ray
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
    `realtime.clouds.hypertexture.march.marched_depths`; `threshold`: rho_0 [1]; `only`: the number of a cloud that is
    seen alone, with what the rays meet behind its surface; None for all, where rays end at the surface.
    """
    Float, lanes = type(direction.x), max(dr.width(direction), dr.width(origin))
    density = clouds.density
    assert density is not None

    def step(total, x, cloud, inside):
        return stride * voxel(clouds, cloud, inside)

    def add(total, begin, finish, cloud, inside):
        distance, number, hull, behind, last = total
        own = inside if only is None else inside & (cloud == only)
        searches = own & ~dr.isfinite(distance)
        # A cloud without a grid has steps as long as a stretch, which may be endless for a ray within rounding of one.
        far = dr.select(dr.isfinite(finish), finish, begin)
        first = density.at(origin + direction * begin, cloud, searches)
        second = density.at(origin + direction * far, cloud, searches)
        at_once = searches & (first > threshold)
        passes = searches & ~at_once & (second > threshold)
        share = dr.select(passes, (threshold - first) / (second - first), 0)
        met = at_once | passes
        distance = dr.select(met, begin + share * (far - begin), distance)
        number = dr.select(met, cloud, number)
        hull = dr.select(met, at_once & (begin != last), hull)
        last = dr.select(inside, finish, last)
        if only is None:
            return (distance, number, hull, behind, last), inside & ~met
        rho = middle_density(clouds, origin, direction, begin, far, cloud, own)
        counted = own & dr.isfinite(distance)
        behind += dr.select(counted, rho * (far - dr.maximum(begin, dr.select(counted, distance, 0))), 0)
        return (distance, number, hull, behind, last), inside

    total = (
        dr.full(Float, dr.inf, lanes),
        dr.zeros(mi.UInt32, lanes),
        dr.full(mi.Bool, False, lanes),
        dr.zeros(Float, lanes),
        dr.full(Float, -1, lanes),
    )
    distance, number, hull, behind, _ = march(surfaces, origin, direction, end, total, step=step, add=add)
    return DenseSurface(distance, number, hull, behind)


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
    """Return what rays along a light meet of one cloud, as `realtime.clouds.light_maps.cast_surfaces` does.

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
    point = origin + direction * distance
    # A little before the boundary, so that the next crossing is that of the boundary itself.
    back_off = 1e-5 * (distance + dr.norm(point))
    crossing = next_crossing(surfaces, point - direction * back_off, direction, dr.zeros(Float, size * size), met.hull)
    slope = -_gradient(clouds, point, mi.UInt32(cloud), there)
    normal = dr.select(met.hull, Vector(crossing.normal), slope)
    normal = dr.select(dr.dot(normal, direction) > 0, -normal, normal)
    length = dr.norm(normal)
    normal = dr.select(length > 0, normal / length, -direction)
    front = dr.select(there, Float(light.extent.depth) - distance, 0)
    back = dr.select(there, front - met.behind / dr.gather(Float, body, mi.UInt32(cloud)), 0)
    lit = LitSurfaces(size, texel, there, front, back, dr.select(there, normal, 0))
    dr.eval(lit)
    return lit


def _gradient(clouds: Clouds, point, cloud, active) -> Any:
    """Return the slope of rho over a voxel [1/m], up to a factor."""
    assert clouds.density is not None
    Vector, width = type(point), voxel(clouds, cloud, active)
    parts = []
    for axis in range(3):
        shift = Vector(*(width if axis == place else type(width)(0) for place in range(3)))
        after, before = (clouds.density.at(place, cloud, active) for place in (point + shift, point - shift))
        parts.append(after - before)
    return Vector(*parts)
