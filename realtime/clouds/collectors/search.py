# SPDX-License-Identifier: BSD-3-Clause
r"""The collector of a set of orders: a fixed point on the lit surface of a cloud (Bouthors 2008, section 6.1).

Let P(c, sigma) be the slab that touches the surface filtered by sigma where c lies along the light, and F the canonical
transport: it tells of a slab and of p and v in it the place and the width (c, sigma) of the entry of light. Wanted is

    (c, sigma) = F(P(c, sigma)).

Seen along the light, the map from c to c is one of the plane into itself. On a slab it is constant: the first step is
right and the second finds that it is. On a cloud it turns with the normal of the surface at c, over the distance from c
to p: where both are large it is no contraction, and steps overshoot.

* *Projection*. c' is the point of the tangent plane that c lies over, along the light: it differs from c where the
  surface curves.
* *Step*. c' + w (F - c'), no longer than the new sigma (the paper's bound on |c_i - c_(i-1)|): the surface was filtered
  by sigma, and says nothing of what lies further away.
* *Two-cycles*. Where the map has a slope below -1 along the line between two places, the steps go to and fro between
  them for ever. w is 1 at first, and half of what it was after every step that turns back (its scalar product with the
  last one is negative). The mean of the map and the identity with the weight w has the slope 1 - w (1 - s), which is
  within (-1, 1) for every s from 1 - 2/w on: -3 for w = 1/2, -7 for 1/4.
* *Start*. c = p, and sigma so large that the whole lit surface is one plane; or the collector of the last frame.
* *Cover*. Light enters where there is cloud. Of the collector's width the share A of the filtered map is cloud, so the
  light of the slab, whose face has no end, counts A times; the paper counts it whole.
* *Way*. The ray behind p has the depth T in clouds, and the slab L along the same direction: d/|mu| upwards,
  (t - d)/mu downwards. Light that was scattered into the ray on the way T, not L, is what the eye gets: it counts
  (1 - exp(-T))/(1 - exp(-L)) times, as if its source were even. Where the ray leaves the slab through the lit face
  (mu < 0), p lies |mu| T deep at least, as there is cloud so far. The paper takes L: then silhouettes of thin parts are
  too bright, and slopes that face away from the sun are black.
* *End*. After `iterations` steps; or in those rays that take no more than a share `settled` of sigma as their step. The
  light is that of the last slab: F gives it with the place and the width.

The distance |F - c'| / sigma of the last step says how far the search is from its end: `CollectorLight.missed`.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import mitsuba as mi

from realtime.clouds.collectors.tangent_slab import TangentSlab, tangent_slab
from realtime.clouds.light_maps.pyramid import LightMap, filtered_surface

#: ``transport(set_number, t, d, mu, cos_phi, sin_phi, mu_l)`` -> T [1/sr], c_x, c_y, sigma [mean free paths].
Transport = Callable[..., tuple[Any, Any, Any, Any]]

_SKIN = 0.01  #: of a slab, which is left on the way out of it [mean free paths]
_LEVEL = 1e-4  #: cosine of a direction that never leaves
_NARROWEST = 1e-3  #: width of a collector [mean free paths]: where no light comes there is none


@dataclass(frozen=True)
class Collector:
    """The part of a lit surface through which light enters."""

    centre: Any  #: [m]
    width: Any  #: standard deviation along one axis [m]


@dataclass(frozen=True)
class CollectorLight:
    """What a search ends with."""

    collector: Collector
    radiance: Any  #: for unit irradiance across the beam [1/sr]
    missed: Any  #: distance from the fixed point [`Collector.width`]
    steps: Any  #: how many were taken


@dataclass(frozen=True)
class Search:
    """How collectors are searched."""

    iterations: int = 10
    settled: float = 0.0  #: step at which a ray has found its collector [`Collector.width`]; 0: none has
    along_light: bool = False  #: whether slabs are as thick as the cloud is along the light, as printed
    covered: bool = True  #: whether light enters only where there is cloud; as printed: everywhere
    as_ray: bool = (
        True  #: whether light comes from as far behind the point as the ray is in cloud; as printed: the slab
    )


def cold_start(light_map: LightMap, point) -> Collector:
    """Return the collector with which a search starts that knows nothing: the point, and the whole cloud."""
    return Collector(+point, light_map.texel * light_map.size + dr.zeros(type(light_map.texel), dr.width(point)))


def collector_light(
    light_map: LightMap,
    transport: Transport,
    set_number: Any,
    *,
    point,
    toward,
    extinction,
    behind: Any,
    start: Collector,
    search: Search,
    active: Any = True,
) -> CollectorLight:
    """Find the collectors of one set of orders, and the light that comes from them.

    `light_map`: of the cloud under one sun; `transport`: see `Transport`; `set_number`: what the transport is asked
    for; `point`: points in the cloud or on it [m]; `toward`: unit directions in which light leaves them; `extinction`:
    of the cloud [1/m]; `behind`: optical depth of the clouds on the ray behind each point; `start`: with which the
    search starts; `search`: how it goes on; `active`: lanes to compute; in the others the collector stays and no light
    comes.
    """
    Float = type(start.width)
    lanes = max(dr.width(point), dr.width(toward))

    def step(index, going, centre, width, last, weight, radiance, missed):
        surface = filtered_surface(light_map, centre, width)
        slab = tangent_slab(
            surface,
            axis=light_map.axis,
            point=point,
            toward=toward,
            extinction=extinction,
            along_light=search.along_light,
        )
        if search.as_ray:
            slab = _reaching_behind(slab, behind)
        found, c_x, c_y, spread = transport(
            set_number, slab.thickness, slab.depth, slab.mu, slab.cos_phi, slab.sin_phi, slab.mu_l
        )
        if search.as_ray:
            found *= (1 - dr.exp(-behind)) / (1 - dr.exp(-_way(slab)))
        if search.covered:
            found *= dr.minimum(surface.cover, 1)
        path = dr.rcp(extinction)
        wanted = slab.foot + slab.along * (c_x * path) + slab.beside * (c_y * path)
        new_width = dr.maximum(spread, _NARROWEST) * path
        # c' lies where the line along the light through c meets the face: (c' - foot) . n = 0.
        over = dr.dot(centre - slab.foot, slab.normal) / slab.mu_l
        projected = dr.fma(light_map.axis, over, centre)
        way = wanted - projected
        distance = dr.norm(way)
        weight = dr.select(dr.dot(way, last) < 0, 0.5 * weight, weight)
        share = dr.minimum(weight, new_width / dr.maximum(distance, 1e-20))
        moved = dr.fma(way, share, projected)
        relative = distance / new_width
        return index + 1, relative > search.settled, moved, new_width, way, weight, found, relative

    state = (
        dr.zeros(mi.UInt32, lanes),
        dr.full(dr.mask_t(Float), True, lanes) & active,
        start.centre + dr.zeros(type(point), lanes),
        start.width + dr.zeros(Float, lanes),
        dr.zeros(type(point), lanes),
        dr.full(Float, 1, lanes),
        dr.zeros(Float, lanes),
        dr.zeros(Float, lanes),
    )
    steps, _, centre, width, _, _, radiance, missed = dr.while_loop(
        state=state,
        cond=lambda index, going, *rest: going & (index < search.iterations),
        body=step,
        labels=("index", "going", "centre", "width", "last", "weight", "radiance", "missed"),
    )
    return CollectorLight(Collector(centre, width), radiance, missed, steps)


def _reaching_behind(slab: TangentSlab, behind: Any) -> TangentSlab:
    """Return a slab with the point so deep that there is something of it behind."""
    skin = dr.minimum(_SKIN, 0.5 * slab.thickness)
    deep = dr.maximum(slab.depth, dr.maximum(skin, -slab.mu * behind))
    depth = dr.select(slab.mu < 0, dr.minimum(deep, slab.thickness), dr.minimum(slab.depth, slab.thickness - skin))
    return replace(slab, depth=depth)


def _way(slab: TangentSlab) -> Any:
    """Return the optical length of the slab behind the point."""
    across = dr.select(slab.mu < 0, slab.depth, slab.thickness - slab.depth)
    return dr.maximum(across / dr.maximum(dr.abs(slab.mu), _LEVEL), 1e-4)
