# SPDX-License-Identifier: BSD-3-Clause
"""A method that uses all of the interface: a veil before the scene that glows as far as each tile is near."""

from dataclasses import dataclass, replace

import drjit as dr
import mitsuba as mi

from realtime.methods.interface.layers import Layers
from realtime.methods.interface.method import Method, always, never
from realtime.parameters import Parameters, parameter
from realtime.tiles.layout import TILE


@dataclass(frozen=True)
class VeilParameters(Parameters):
    share: float = parameter(0.5, "share of every light that reaches the surfaces", least=0, most=1)
    veil: float = parameter(0.8, "transmittance of the veil", above=0, most=1)
    keep: float = parameter(0.25, "weight of the last frame", least=0, below=1)


def prepare(scene, parameters):
    return lambda now: tuple(0.1 * light.intensity for light in now.lights)


def cull(view, state, parameters):
    return dr.gather(type(view.distance), view.distance, dr.arange(mi.UInt32, dr.width(view.distance) // TILE) * TILE)


def render(view, state, lists, *, kernel, parameters):
    Color, glow = type(view.medium.albedo), dr.exp(-dr.minimum(dr.gather(type(lists), lists, view.tile), 99))
    background = dr.select(dr.isfinite(view.distance), Color(0), Color(0.3, 0.4, 0.5))
    shares = tuple(parameters.share for _ in view.lights)
    return Layers(sum(state) * glow, shares, Color(parameters.veil), background)


def soften(layers, g_buffer, history, *, camera, parameters):
    """Average each pixel and its left neighbour where the surface goes on, then this frame and the last."""
    here, value = dr.arange(mi.UInt32, camera.width * camera.height), layers.in_scattered
    left = dr.select(here % camera.width > 0, here - 1, here)
    alike = dr.dot(g_buffer.normal, dr.gather(type(g_buffer.normal), g_buffer.normal, left)) > 0.9
    value = dr.select(alike, 0.5 * (value + dr.gather(type(value), value, left)), value)
    if history is not None:
        value = dr.lerp(value, history.layers.in_scattered, parameters.keep)
    return replace(layers, in_scattered=value)


VISIBLE = {"provides_visibility": always, "uses_kernel": never}
VEIL = Method("veil", render, "a veil", "tests", VeilParameters, prepare, cull=cull, passes=(soften,), **VISIBLE)
