# SPDX-License-Identifier: BSD-3-Clause
"""The collector search: the tangent slab of a collector, the fixed point, and the
light that comes from there.

**The slab that touches a cloud where light enters it, and a point and a direction in it.**

A collector is a place c and a width sigma. The lit surface filtered by sigma
(`realtime.clouds.light_maps`) gives a point q of the filtered surface, its outward normal n and the
thickness Z of the cloud along the light w_L there. The slab is the one that touches it: its lit
face goes through q across n. With mu_L = -n . w_L,

    t = sigma_t mu_L Z                      its thickness; Z lies along the light,
    d = sigma_t (q - p) . n                 the depth of the point p below the face,
    f = p + n d / sigma_t                   the foot of p on the face,
    mu = v . n                              of the direction v in which light leaves p,
    x = (w_L + mu_L n)/|..|,  y = n x x     the horizontal direction of the light, and the one beside it,
    cos phi = v . x / sin, sin phi = v . y / sin,   sin = sqrt(1 - mu^2).

The canonical transport of (t, d, mu, phi, mu_L) gives the radiance of a set of orders at p in the
direction v, and where its light enters the slab: c = f + (c_x x + c_y y)/sigma_t.

Where a cloud is no slab:

* p above the filtered face: d = 0. The filter removes bumps of the cloud.
* p deeper than the slab is thick: t = d. There is cloud down to p at least.
* The sun low over the tangent plane: mu_L is 0.02 at least, and n is turned towards the sun until it
  is. Normals of a map have a component towards the light, so that the sun is never below the plane
  of their mean; at silhouettes it comes close to the plane.
* The sun in the zenith: x is any horizontal direction, as the transport does not depend on it.

`thickness=light` measures both lengths along the light, as printed: t = sigma_t Z and d/mu_L, the
lengths in a depth map. A slab in which the sun stands at 75 degrees is then 3.9 times too thick.

**The collector of a set of orders:** a fixed point on the lit surface of a cloud
(Bouthors 2008, section 6.1).

Let P(c, sigma) be the slab that touches the surface filtered by sigma where c lies along the light,
and F the canonical transport, which maps a slab, p and v to the place and the width (c, sigma)
where light enters. The search solves

    (c, sigma) = F(P(c, sigma)).

Seen along the light, the map from c to F maps a plane into itself. On a slab the map is constant:
the first step is right and the second confirms it. On a cloud the map varies with the normal of the
surface at c, times the distance from c to p: where both are large the map is no contraction, and
steps overshoot.

* *Projection*. c' is the point of the tangent plane that c lies over, along the light: it differs
  from c where the surface curves.
* *Step*. c' + w (F - c'), no longer than the new sigma (the paper's bound on |c_i - c_(i-1)|): the
  surface was filtered by sigma, and says nothing of what lies further away.
* *Two-cycles*. Where the map has a slope s below -1 along the line between two places, the steps go
  to and fro between them without end. w is 1 at first, and is halved after every step that turns
  back (its scalar product with the last step is negative). The mean of the map with the weight w
  and the identity has the slope 1 - w (1 - s), which is within (-1, 1) for every s from 1 - 2/w
  to 1: from -3 for w = 1/2, from -7 for 1/4.
* *Start*. c = p, and sigma so large that the whole lit surface is one plane; or the
  collector of the last frame.
* *Cover*. Light enters where there is cloud. Only the fraction A of the collector, read from the
  filtered map, is cloud, so the light of the infinite slab is weighted by A; the paper does not
  weight it.
* *Way*. The ray behind p has the depth T in clouds, and the slab L along the same direction: d/|mu|
  upwards, (t - d)/mu downwards. The eye gets the light that was scattered into the ray over the
  depth T, not L: the light is weighted by (1 - exp(-T))/(1 - exp(-L)), as if its source were
  uniform. Where the ray leaves the slab through the lit face (mu < 0), p lies |mu| T deep at least,
  as there is cloud so far. With the paper's L silhouettes of thin parts are too bright, and slopes
  that face away from the sun are black.
* *End*. After `iterations` steps, or where a step has no length. The last slab gives the light: F
  has it with the place and the width.

The distance |F - c'| / sigma of the last step says how far the search is from its end:
`CollectorLight.missed`.

**The light of all sets of orders at points of a cloud under one sun:** one search for each set.

A frame hands the collectors of each set on to the next frame: the vectors from the points to the
centres, and the widths, which are 0 where there is no collector. Where the camera moved, a point of
the next frame is displaced from the point whose collector it takes, and the collector by as much.
"""

from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import mitsuba as mi

from airlight.realtime.clouds.canonical.transport_grid import Transport
from airlight.realtime.clouds.light_maps import FilteredSurface, LightMap, filtered_surface
from airlight.realtime.numerics.functions import opacity

_LEAST_LENGTH = 1e-4  #: of the horizontal part of a unit vector that has a direction


@dataclass(frozen=True)
class TangentSlab:
    """A slab, a point and a direction in it; lengths in mean free paths
    unless they say otherwise.
    """

    thickness: Any  #: t
    depth: Any  #: d of the point, from 0 to t
    mu: Any  #: cosine of the direction with the normal
    cos_phi: Any
    sin_phi: Any
    mu_l: Any  #: cosine of the sun's zenith angle
    foot: Any  #: of the point on the lit face [m]
    normal: Any
    along: Any  #: the horizontal direction of the light
    beside: Any  #: across it and the normal


def tangent_slab(
    surface: FilteredSurface,
    *,
    axis: Any,
    point: Any,
    toward: Any,
    extinction: Any,
    along_light: bool = False,
) -> TangentSlab:
    """Return the slab that touches a filtered surface, with a point and a direction in it.

    `surface`: what `realtime.clouds.light_maps.filtered_surface` found; `axis`: unit direction in
    which the light travels; `point`: points in the cloud or on it [m]; `toward`: unit directions in
    which light leaves the points; `extinction`: of the cloud [1/m]; `along_light`: whether
    thickness and depth are those along the light, as printed.
    """
    Float = type(surface.cover)
    normal, mu_l = _facing(surface.normal, axis)
    # The depth of p below the face [m]; points above it count as on it.
    below = dr.maximum(dr.dot(surface.middle - point, normal), 0)
    # Z lies along the light, and the slab across its face.
    depth, thickness = extinction * below, extinction * surface.thickness
    if along_light:
        depth /= mu_l
    else:
        thickness *= mu_l
    # The horizontal part of w_L. With the sun in the zenith it has no direction: any level one will
    # do, here the cross product with an axis that is not along the normal.
    along = axis + normal * mu_l
    length = dr.norm(along)
    helper = dr.select(dr.abs(normal.x) < 0.5, type(normal)(1, 0, 0), type(normal)(0, 1, 0))
    along = dr.select(
        length > _LEAST_LENGTH, along / length, dr.normalize(dr.cross(helper, normal))
    )
    beside = dr.cross(normal, along)
    # v in the system of the slab; where v is vertical, phi counts as 0.
    mu = dr.clip(dr.dot(toward, normal), -1, 1)
    x, y = dr.dot(toward, along), dr.dot(toward, beside)
    sine = dr.sqrt(dr.square(x) + dr.square(y))
    flat = sine > 0
    # Cloud reaches down to p at least.
    return TangentSlab(
        thickness=dr.maximum(thickness, depth),
        depth=depth,
        mu=mu,
        cos_phi=dr.select(flat, x / sine, Float(1)),
        sin_phi=dr.select(flat, y / sine, Float(0)),
        mu_l=mu_l,
        foot=dr.fma(normal, below, point),
        normal=normal,
        along=along,
        beside=beside,
    )


def _facing(normal: Any, axis: Any) -> tuple[Any, Any]:
    """Return a unit normal turned until its cosine with the light is 0.02 at least, and this."""
    cosine = -dr.dot(normal, axis)
    # n + s (-w_L), whose cosine is c for s = c sqrt((1 - a^2)/(1 - c^2)) - a, a the cosine of n.
    least_cosine = 0.02  # of the sun over a tangent plane
    sine = dr.sqrt(dr.maximum(1 - dr.square(cosine), 0))
    turn = least_cosine / (1 - least_cosine**2) ** 0.5 * sine - cosine
    low = cosine < least_cosine
    normal = dr.select(low, dr.normalize(dr.fma(axis, -turn, normal)), normal)
    return normal, dr.select(low, type(cosine)(least_cosine), dr.minimum(cosine, 1))


@dataclass(frozen=True)
class Collector:
    """The part of a lit surface through which light enters."""

    centre: Any  #: [m]
    width: Any  #: standard deviation along one axis [m]


@dataclass(frozen=True)
class CollectorLight:
    """The result of a search."""

    collector: Collector
    radiance: Any  #: for unit irradiance across the beam [1/sr]
    missed: Any  #: distance from the fixed point [`Collector.width`]


@dataclass(frozen=True)
class Search:
    """How collectors are searched."""

    iterations: int = 10
    #: whether slabs are as thick as the cloud is along the light, as printed
    along_light: bool = False
    covered: bool = True  #: whether light enters only where the map has cloud


def cold_start(light_map: LightMap, point) -> Collector:
    """Return the collector with which a search starts that knows nothing: the
    point, and the whole cloud.
    """
    return Collector(
        +point, light_map.texel * light_map.size + dr.zeros(type(light_map.texel), dr.width(point))
    )


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

    `light_map`: of the cloud under one sun; `transport`: see `Transport`; `set_number`: of the
    orders, for the transport; `point`: points in the cloud or on it [m]; `toward`: unit directions
    in which light leaves them; `extinction`: of the cloud [1/m]; `behind`: optical depth of the
    clouds on the ray behind each point; `start`: with which the search starts; `search`: how it
    goes on; `active`: lanes to compute; in the others the collector stays and no light comes.
    """
    Float = type(start.width)
    lanes = max(dr.width(point), dr.width(toward))

    def step(index, going, centre, width, last_step, weight, radiance, missed):
        # P(c, sigma): the slab that touches the surface filtered by sigma, where c lies along the
        # light.
        surface = filtered_surface(light_map, centre, width)
        slab = tangent_slab(
            surface,
            axis=light_map.axis,
            point=point,
            toward=toward,
            extinction=extinction,
            along_light=search.along_light,
        )
        slab = _reaching_behind(slab, behind)
        # F: the radiance, and the place and the width where light enters.
        light, c_x, c_y, spread = transport(
            set_number, slab.thickness, slab.depth, slab.mu, slab.cos_phi, slab.sin_phi, slab.mu_l
        )
        # *Way* and *cover*: the light of the depth T behind p, and only where the map has cloud.
        light *= opacity(behind) / opacity(_way(slab))
        if search.covered:
            light *= dr.minimum(surface.cover, 1)
        path = dr.rcp(extinction)
        target = slab.foot + slab.along * (c_x * path) + slab.beside * (c_y * path)
        # Where no light comes a collector has no width, but is divided by it.
        new_width = dr.maximum(spread, 1e-3) * path
        # c' lies where the line along the light through c meets the face: (c' - foot) . n = 0.
        over = dr.dot(centre - slab.foot, slab.normal) / slab.mu_l
        projected = dr.fma(light_map.axis, over, centre)
        # The step F - c'. Its weight is halved for good where it turns back; it is no longer than
        # the new sigma.
        way = target - projected
        distance = dr.norm(way)
        weight = dr.select(dr.dot(way, last_step) < 0, 0.5 * weight, weight)
        fraction = dr.minimum(weight, new_width / dr.maximum(distance, 1e-20))
        moved = dr.fma(way, fraction, projected)
        relative = distance / new_width
        return index + 1, relative > 0, moved, new_width, way, weight, light, relative

    # The counter, lanes that go on, c and sigma, the last step, w, the radiance, |F - c'|/sigma.
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
    _, _, centre, width, _, _, radiance, missed = dr.while_loop(
        state=state,
        cond=lambda index, going, *rest: going & (index < search.iterations),
        body=step,
        labels=("index", "going", "centre", "width", "last_step", "weight", "radiance", "missed"),
    )
    return CollectorLight(Collector(centre, width), radiance, missed)


def _reaching_behind(slab: TangentSlab, behind: Any) -> TangentSlab:
    """Return a slab with the point so deep that there is something of it behind."""
    # The least way out of the slab: a hundredth of a mean free path, or half of a thinner slab.
    skin = dr.minimum(0.01, 0.5 * slab.thickness)
    deep = dr.maximum(slab.depth, dr.maximum(skin, -slab.mu * behind))
    # Through the lit face, p is |mu| T deep at least; downwards, a skin remains below it.
    depth = dr.select(
        slab.mu < 0, dr.minimum(deep, slab.thickness), dr.minimum(slab.depth, slab.thickness - skin)
    )
    return replace(slab, depth=depth)


def _way(slab: TangentSlab) -> Any:
    """Return the optical length of the slab behind the point."""
    # L = d/|mu| to the lit face, (t - d)/mu to the other one. A direction that is more level than
    # the cosine 1e-4 counts as one with it.
    across = dr.select(slab.mu < 0, slab.depth, slab.thickness - slab.depth)
    return dr.maximum(across / dr.maximum(dr.abs(slab.mu), 1e-4), 1e-4)


@dataclass(frozen=True)
class OrdersLight:
    """The light of sets of orders at points."""

    by_set: tuple[Any, ...]  #: for unit irradiance across the beam [1/sr]
    #: for the next frame, by set; centres count from the points [m]
    collectors: tuple[Collector, ...]


def light_of_orders(
    light_map: LightMap,
    transport: Transport,
    *,
    sets: int,
    point,
    toward,
    extinction,
    behind,
    search: Search,
    last: tuple[Collector, ...] | None = None,
    active: Any = True,
) -> OrdersLight:
    """Search the collectors of all sets of orders, and return their light.

    `light_map`, `transport`, `point`, `toward`, `extinction`, `behind`, `search`, `active`: see
    `realtime.clouds.collector_search.collector_light`; `sets`: how many sets there are, numbers
    from 0 on; `last`: the `OrdersLight.collectors` of the last frame; None where a search starts
    with nothing.
    """
    cold = cold_start(light_map, point)
    Float, Vector = type(cold.width), type(cold.centre)
    # By set the collector, at first from the last frame, and the light that comes from it, in
    # arrays of each lane that a loop can index by the number of the set.
    centres, widths = (dr.alloc_local(kind, sets, value=kind(0)) for kind in (Vector, Float))
    radiances = dr.alloc_local(Float, sets, value=Float(0))
    for number, collector in enumerate(last or ()):
        centres[mi.UInt32(number)], widths[mi.UInt32(number)] = collector.centre, collector.width

    def search_set(number, centres, widths, radiances):
        start = (
            cold if last is None else _warm(cold, Collector(centres[number], widths[number]), point)
        )
        light = collector_light(
            light_map,
            transport,
            number,
            point=point,
            toward=toward,
            extinction=extinction,
            behind=behind,
            start=start,
            search=search,
            active=active,
        )
        # From the point, so that the collector moves with it; no width where lanes are not active.
        centres[number] = light.collector.centre - point
        widths[number] = dr.select(active, light.collector.width, 0)
        radiances[number] = light.radiance
        return number + 1, centres, widths, radiances

    # One loop over the sets: a search for each would make the kernel eight times as long.
    lanes = max(dr.width(point), dr.width(toward))
    _, centres, widths, radiances = dr.while_loop(
        state=(dr.zeros(mi.UInt32, lanes), centres, widths, radiances),
        cond=lambda number, *found: number < sets,
        body=search_set,
        labels=("number", "centres", "widths", "radiances"),
    )
    numbers = [mi.UInt32(number) for number in range(sets)]
    collectors = tuple(Collector(centres[number], widths[number]) for number in numbers)
    return OrdersLight(tuple(radiances[number] for number in numbers), collectors)


def _warm(cold: Collector, last: Collector, point) -> Collector:
    """Return the collector with which a search starts: the last frame's where there is one."""
    way, width = last.centre, last.width
    mask = width > 0
    return Collector(dr.select(mask, point + way, cold.centre), dr.select(mask, width, cold.width))
