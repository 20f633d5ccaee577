# SPDX-License-Identifier: BSD-3-Clause
r"""The airlight of a source along rays, by the midpoint rule with one visibility test a step and light sample.

A table holds the N light samples of an area light. In the orthonormal frame of a light sample, whose normal is the
third axis, a ray is o + x d, and all that an integrand needs follows from its three coordinates (a, b, c) at x:

    r^2 = a^2 + b^2 + c^2,    cos_l = c / r,    cos_scatter = -(o . d + x) / r,

and the place in the map follows too. A step therefore costs one multiply-add for each coordinate, one square root, one
exponential, one look-up. A first loop is over the points, a second over the steps: the kernel grows with neither.

Uniform steps that no surface ends stop at 20 optical depths, where e^-20 = 2e-9 is left.
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np

from realtime.methods.interface.marching import midpoint_sum, steps_between
from realtime.methods.interface.method import View
from realtime.methods.soft_shafts.parameters import SoftShaftsParameters
from realtime.numerics.array_types import aligned_array
from realtime.numerics.functions import summed
from realtime.scene.light_samples import LightFrame, frame_at, light_frames
from realtime.scene.lights import Light
from realtime.shadow_maps.hemisphere_map import HemisphereMaps, cast_hemisphere_maps
from realtime.shadow_maps.shadow_map import ShadowMap, cast_shadow_map


@dataclass(frozen=True)
class SourceState:
    """The state of one source, made again when lights or shapes move."""

    frames: LightFrame | None  #: the points of an area light, one a lane
    width: Any  #: of that light, of a square with its mean square extent [m]
    flat: bool  #: whether all points of that light face the same way
    maps: HemisphereMaps | ShadowMap | None  #: None where nobody asks them


def source_state(
    scene: Any, lights: list[Light], size: int, *, with_maps: bool, for_surfaces: bool = True
) -> SourceState:
    """Return the state of a source of some `lights`; `size` [texels] is that of its maps, also `for_surfaces`."""
    Float = type(lights[0].position.x)
    if lights[0].facing is None:
        maps = cast_shadow_map(scene, lights[0], size) if with_maps else None
        return SourceState(None, dr.opaque(Float, 0, 1), True, maps)
    frames, positions, normals = light_frames(lights)
    # The mean square distance from the middle of a square of the side L is L^2 / 6.
    spread = np.mean(np.sum((positions - positions.mean(axis=0)) ** 2, axis=1))
    hemispheres = None
    if with_maps:
        hemispheres = cast_hemisphere_maps(scene, frames, len(lights), size, for_surfaces=for_surfaces)
    flat = bool(np.all(normals == normals[0]))
    return SourceState(frames, aligned_array(Float, np.array([np.sqrt(6 * spread)])), flat, hemispheres)


@dataclass(frozen=True)
class Fraction:
    """The part of an area light that each ray takes: one light sample, with a shift of its steps."""

    number: Any  #: of the light sample
    shift: Any  #: of the steps, from 0 to 1 of one


def integral_of_points(
    view: View, state: SourceState, points: int, fraction: Fraction | None, p: SoftShaftsParameters
) -> Any:
    """Return the sum of the airlight integrals of the points of an area light [1/m].

    `view`: the rays, in one medium without bounds; `state`: the light, with its maps if `shadow=map`; `points`: how
    many points it has; `fraction`: one point for each ray, counted `points` times; None for all; `p`: the parameters.
    """
    Float = type(view.distance)
    nothing = view.lit_by(view.lights[0]).nothing(dr.width(view.distance))
    if fraction is not None:
        return points * _of_point(view, state, fraction.number, fraction.shift, p)

    return summed(points, lambda number: _of_point(view, state, number, Float(0.5), p), nothing)


def _of_point(view: View, state: SourceState, number: Any, shift: Any, p: SoftShaftsParameters) -> Any:
    Float, medium = type(view.distance), view.medium
    frame = frame_at(state.frames, number)
    origin, direction = frame.local(view.origin - frame.position), frame.local(view.direction)
    along = sum(o * d for o, d in zip(origin, direction))
    begin, end = medium.part(view, Float(0), view.distance, uniform=p.spacing == "uniform")
    # The plane of the light sample cuts the ray.
    meets = -origin[2] / direction[2]
    begin = dr.select(direction[2] > 0, dr.maximum(meets, begin), begin)
    end = dr.select(direction[2] < 0, dr.minimum(meets, end), end)
    lit_part = (end > begin) & ((direction[2] != 0) | (origin[2] > 0))
    at_light = None
    if p.spacing == "equiangular":
        (oa, ob, oc), (da, db, dc) = origin, direction
        height = dr.sqrt(dr.square(ob * dc - oc * db) + dr.square(oc * da - oa * dc) + dr.square(oa * db - ob * da))
        at_light = -along, height
    steps = steps_between(begin, end, p.steps, at_light, asked=lit_part)

    def sample(x: Any):
        a, b, c = (dr.fma(d, x, o) for o, d in zip(origin, direction))
        inverse = dr.rsqrt(dr.fma(a, a, dr.fma(b, b, c * c)))
        r = dr.fma(a, a, dr.fma(b, b, c * c)) * inverse
        weight = dr.maximum(c, 0) * inverse * dr.square(inverse)
        value = weight * medium.source(view, x, lambda phase: phase.evaluate(-(along + x) * inverse))
        lit = lit_part
        if view.features.shadows and p.shadow == "map":
            assert isinstance(state.maps, HemisphereMaps)
            lit = lit & state.maps.lit(number, (a, b, c), lit_part)
        elif view.features.shadows and p.shadow == "ray":
            lit = lit & view.visible(view.at(x), frame)
        return dr.select(lit, value * medium.both_ways(view, x, frame, r), 0)

    nothing = view.lit_by(view.lights[0]).nothing(dr.width(view.distance))
    return midpoint_sum(steps, p.steps, nothing, sample, shift)
