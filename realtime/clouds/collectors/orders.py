# SPDX-License-Identifier: BSD-3-Clause
"""The light of all sets of orders at points of a cloud under one sun: one search for each set.

What a frame leaves to the next are the collectors of each set: the vectors from the points to the centres, and the
widths, which are 0 where there is none. Where the camera moved, a point of the next frame lies beside the one whose
collector it takes, and its collector lies beside that too.
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr

from realtime.clouds.collectors.search import Collector, Search, Transport, cold_start, collector_light
from realtime.clouds.light_maps.pyramid import LightMap


@dataclass(frozen=True)
class OrdersLight:
    """The light of sets of orders at points."""

    by_set: tuple[Any, ...]  #: for unit irradiance across the beam [1/sr]
    collectors: tuple[Collector, ...]  #: for the next frame, by set; centres count from the points [m]


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
    `realtime.clouds.collectors.search.collector_light`; `sets`: how many sets there are, numbers from 0 on; `last`: the
    `OrdersLight.collectors` of the last frame; None where a search starts with nothing.
    """
    cold = cold_start(light_map, point)
    lights = []
    for number in range(sets):
        start = cold if last is None else _warm(cold, last[number], point)
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
        lights.append(light)
    kept = (Collector(light.collector.centre - point, dr.select(active, light.collector.width, 0)) for light in lights)
    return OrdersLight(tuple(light.radiance for light in lights), tuple(kept))


def _warm(cold: Collector, last: Collector, point) -> Collector:
    """Return the collector with which a search starts: the last frame's where there is one."""
    way, width = last.centre, last.width
    there = width > 0
    return Collector(dr.select(there, point + way, cold.centre), dr.select(there, width, cold.width))
