# SPDX-License-Identifier: BSD-3-Clause
r"""How much of a cloud lies between a sun and a point, in a map that segments of single scattering
look up.

A ray of the light through each texel marches through a cloud. It stores l = int rho dx, in metres
of full density, at layers whose heights are

    h_k = front - (front - back) (k/K)^2,        k = 0 .. K,

between the first and the last place of the ray with any density: narrow where the light comes in
and is still strong, wide behind. A look-up is linear in k between two layers, and between the four
nearest texels, each with its own front and back. Such a map is a deep shadow map (Lokovic and Veach
2000), which the paper names as its future work: a depth map alone takes the way from the first
surface for cloud of one density, without wisps and gaps. The depth of a segment is sigma_t l, so
that other extinctions need no new map.

**The surface of a cloud with a density:** where rho first exceeds a threshold rho_0, from
the eye and from the sun.

Bouthors et al. 2008, sections 6.1 and 8, take for the lit surface the first voxel with rho > rho_0
along the light, and slabs between it and the far side. A slab has one extinction, a cloud one at
every place; but slabs depend on optical lengths alone. Hence slabs have

    sigma_s = sigma_t mean(rho where rho > rho_0)   as extinction, like the body of the cloud,
    Z = int rho dx / mean(rho where rho > rho_0)    as thickness along the light behind the surface,

whose product is the true optical thickness of the cloud, gaps and wisps counted with their
densities. The light map stores front and front - Z, so that the filter and the search are the same
as for homogeneous clouds. Depths below the surface, and the ways to collectors, are lengths times
sigma_s: exact where rho is the density of the body, which is everywhere except in a layer at the
surface.

Along a ray the density is taken at the ends of steps of a voxel, and the place between two of them
at which it passes rho_0 is linear.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

from airlight.realtime.clouds.light_maps import LitSurfaces
from airlight.realtime.clouds.march import CloudSurfaces, march, middle_density, voxel
from airlight.realtime.numerics.array_types import Metres, bytes_of
from airlight.realtime.numerics.functions import cell_of
from airlight.realtime.scene.lights import Light
from airlight.realtime.scene.media.bounded import Clouds
from airlight.realtime.shadow_maps.projection import Projection, light_projection
from airlight.realtime.shadow_maps.shadow_map import check_size, texel_rays

SIZE, LAYERS = 256, 64  #: texels on a side, layers of each


@dataclass(frozen=True)
class LightDepths:
    """Depths between one sun and the points of one cloud; row by row, the layers of a
    texel one after the other.
    """

    lengths: Any  #: l at the K + 1 heights of each texel [m]
    front: Any  #: by texel [m]
    back: Any  #: by texel [m]
    position: Any  #: middle of the rectangle where heights are 0 [m]
    projection: Projection

    def at(self, point, active: Any = True) -> Metres:
        """Return l of points [m]."""
        u, v, height, _ = self.projection.homogeneous(mi.UInt32(0), point - self.position, 1)
        Float = type(height)
        # Texels have their values in their middles, u and v go from -1 to 1.
        (column, x), (row, y) = (
            cell_of(dr.fma(0.5 * SIZE, place + 1, -0.5), SIZE) for place in (u, v)
        )
        total = Float(0)
        for down, weight_down in ((0, 1 - y), (1, y)):
            for along, weight_along in ((0, 1 - x), (1, x)):
                texel = (row + down) * SIZE + column + along
                front, back = (
                    dr.gather(Float, heights, texel, active) for heights in (self.front, self.back)
                )
                # The layer k = K sqrt((front - height)/(front - back)), of this texel's front and
                # back.
                fraction = dr.clip((front - height) / dr.maximum(front - back, 1e-20), 0, 1)
                layer, between = cell_of(dr.sqrt(fraction) * LAYERS, LAYERS + 1)
                first = texel * (LAYERS + 1) + layer
                near, far = (
                    dr.gather(Float, self.lengths, place, active) for place in (first, first + 1)
                )
                total = dr.fma(weight_down * weight_along, dr.lerp(near, far, between), total)
        return total


def light_depths(
    surfaces: CloudSurfaces,
    clouds: Clouds,
    light: Light,
    *,
    cloud: Any,
    stride: Any,
) -> LightDepths:
    """Return the depths between a sun and all points of a cloud.

    `surfaces`, `clouds`: the boundaries, and what fills them, with a density; `light`: a
    directional light, with an extent that holds the clouds; `cloud`: the number of the cloud,
    opaque: all clouds share kernels; `stride`: how long the steps are at most [voxels].
    """
    Float = type(light.position.x)
    # One ray of the light for each texel, from before all shapes; a height is `top` less the
    # distance along the ray.
    start, axis, texel = texel_rays(light, SIZE)
    Vector = type(light.position)
    origin, direction = Vector(start), Vector(axis) + dr.zeros(Vector, SIZE * SIZE)
    top = Float(light.extent.depth)
    dr.eval(origin, direction, texel)
    nothing = dr.full(Float, dr.inf, SIZE * SIZE), dr.zeros(Float, SIZE * SIZE)

    def full_step(total, x, number):
        return stride * voxel(clouds, number)

    # First march: the first and the last place of each ray with any density of this cloud.
    def widen(total, begin, end, inside, number):
        first, last = total
        dense = (number == cloud) & (
            middle_density(clouds, origin, direction, begin, end, number) > 0
        )
        return (
            dr.select(dense, dr.minimum(first, begin), first),
            dr.select(dense, end, last),
        ), mi.Bool(True)

    first, last = march(
        surfaces, origin, direction, Float(dr.inf), nothing, step=full_step, add=widen
    )
    # Rays that meet none of the cloud take no part in the second march.
    mask = dr.isfinite(first)
    first, last = dr.select(mask, first, 0), dr.select(mask, last, 0)
    dr.eval(first, last)
    lengths = dr.zeros(Float, SIZE * SIZE * (LAYERS + 1))

    # Second march: l at the layers. A step ends at the next layer at the latest.
    def to_layer(total, x, number):
        layer, *_ = total
        ahead = first + (last - first) * dr.square(Float(layer + 1) / LAYERS) - x
        return dr.minimum(dr.maximum(ahead, 0), full_step(total, x, number))

    def add(total, begin, end, inside, number):
        layer, length = total
        in_cloud = number == cloud
        rho = middle_density(clouds, origin, direction, begin, end, number)
        length = dr.select(in_cloud, dr.fma(rho, end - begin, length), length)
        # The layer that the step has reached: k from the fraction of the way, with room for the
        # rounding of the distance.
        fraction = dr.clip((end - first) / dr.maximum(last - first, 1e-20), 0, 1)
        reached = dr.minimum(mi.UInt32(dr.fma(dr.sqrt(fraction), LAYERS, 1e-3)), LAYERS)
        # The next layer has this length, too, if the ray leaves the cloud before it; otherwise a
        # later step writes over it.
        dr.scatter(
            lengths, length, texel * (LAYERS + 1) + dr.minimum(reached + 1, LAYERS), in_cloud
        )
        dr.scatter(lengths, length, texel * (LAYERS + 1) + reached, in_cloud & (reached > layer))
        return (dr.maximum(layer, reached), length), end < last

    nothing = dr.zeros(mi.UInt32, SIZE * SIZE), dr.zeros(Float, SIZE * SIZE)
    march(surfaces, origin, direction, last, nothing, step=to_layer, add=add, active=mask)
    # No step ends at layers in vacuum: they have the length of the layer before them.
    lengths = dr.block_prefix_reduce(dr.ReduceOp.Max, lengths, LAYERS + 1, exclusive=False)
    # Distances as heights, from the order of rays to the order of texels.
    arrays = []
    for distance in (first, last):
        heights = dr.zeros(Float, SIZE * SIZE)
        dr.scatter(heights, dr.select(mask, top - distance, 0), texel)
        arrays.append(heights)
    dr.eval(lengths, arrays)
    front, back = arrays
    return LightDepths(lengths, front, back, light.position, light_projection(light))


def sun_depths(
    surfaces: CloudSurfaces, clouds: Clouds, lights: Sequence[Light], *, stride: Any
) -> tuple[tuple[LightDepths, ...], ...]:
    """Return the maps of all suns, by light and cloud; arguments as of `light_depths`."""
    count = dr.width(clouds.phase)
    return tuple(
        tuple(
            light_depths(surfaces, clouds, light, cloud=dr.opaque(mi.UInt32, cloud), stride=stride)
            for cloud in range(count)
        )
        for light in lights
    )


def depths_memory(Float: Any) -> int:
    """Return how much the map of a cloud and a sun takes [bytes]."""
    # K + 1 lengths, front and back of each texel.
    return SIZE * SIZE * (LAYERS + 3) * bytes_of(Float)


@dataclass(frozen=True)
class DenseSurface:
    """Where rays first meet more than the threshold."""

    distance: Any  #: infinite where they never do [m]
    cloud: Any  #: the number of the cloud there
    behind: Any  #: int rho dx from there on, of a single cloud; 0 for all clouds together [m]


def dense_surface(
    surfaces: CloudSurfaces,
    clouds: Clouds,
    origin,
    direction,
    end,
    *,
    threshold: Any,
    stride: Any,
    only: Any = None,
) -> DenseSurface:
    """Return where rays first meet more than a density.

    `surfaces`, `clouds`, `origin`, `direction`, `end`, `stride`: as for
    `realtime.clouds.march.depths_along`; `threshold`: rho_0 [1]; `only`: the number of a single
    cloud, behind whose surface rays go on to add up its density; None for all clouds, where rays
    end at the surface.
    """
    Float, lanes = type(direction.x), max(dr.width(direction), dr.width(origin))
    density = clouds.density
    assert density is not None

    def step(total, x, cloud):
        return stride * voxel(clouds, cloud)

    def add(total, begin, finish, inside, cloud):
        distance, number, behind = total
        # A ray searches until it has met the surface.
        candidate = mi.Bool(True) if only is None else cloud == only
        searches = candidate & ~dr.isfinite(distance)
        first = density.at(origin + direction * begin, cloud, searches)
        second = density.at(origin + direction * finish, cloud, searches)
        # Either the step begins above the threshold, where a ray enters the cloud, or rho passes it
        # between both ends, where it is linear.
        at_once = searches & (first > threshold)
        passes = searches & ~at_once & (second > threshold)
        fraction = dr.select(passes, (threshold - first) / (second - first), 0)
        met = at_once | passes
        distance = dr.select(met, begin + fraction * (finish - begin), distance)
        number = dr.select(met, cloud, number)
        if only is None:
            return (distance, number, behind), ~met
        # With one cloud alone the ray goes on behind the surface: int rho dx of the steps from
        # there on, of the step with the surface only the part behind it.
        rho = middle_density(clouds, origin, direction, begin, finish, cloud)
        counted = candidate & dr.isfinite(distance)
        behind += dr.select(
            counted, rho * (finish - dr.maximum(begin, dr.select(counted, distance, 0))), 0
        )
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
    cloud: Any,
    body: Any,
    threshold: float,
    stride: Any,
) -> LitSurfaces:
    """Return the lit surfaces of one cloud along a light, as
    `realtime.clouds.light_maps.cast_surfaces` does.

    `surfaces`, `clouds`, `threshold`, `stride`: as for `dense_surface`; `light`, `size`: as for
    `cast_surfaces`; `cloud`: its number, opaque; `body`: by cloud, mean(rho where rho > rho_0) [1].
    """
    check_size(size)
    Float, Vector = type(light.position.x), type(light.position)
    start, axis, texel = texel_rays(light, size)
    origin, direction = Vector(start), Vector(axis) + dr.zeros(Vector, size * size)
    met = dense_surface(
        surfaces,
        clouds,
        origin,
        direction,
        Float(dr.inf),
        threshold=threshold,
        stride=stride,
        only=cloud,
    )
    mask = dr.isfinite(met.distance)
    distance = dr.select(mask, met.distance, 0)
    # The height of the surface, and Z below it; rays that meet no surface have 0 for both.
    front = dr.select(mask, Float(light.extent.depth) - distance, 0)
    back = dr.select(mask, front - met.behind / dr.gather(Float, body, cloud), 0)
    lit = LitSurfaces(size, texel, mask, front, back)
    dr.eval(lit)
    return lit
