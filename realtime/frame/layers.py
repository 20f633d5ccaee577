# SPDX-License-Identifier: BSD-3-Clause
"""Layers become a frame: adaptive sampling around a method, passes over its image after it, and their composition.

Each does nothing, and records nothing, where a method has nothing for it.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import drjit as dr
import mitsuba as mi

from realtime.frame.surface import Cast, visible_surface
from realtime.methods.interface.layers import GBuffer, Layers
from realtime.methods.interface.method import Method
from realtime.methods.interface.view import View
from realtime.numerics.array_types import PerRay
from realtime.scene.camera import Camera, ray_directions
from realtime.scene.medium import Medium
from realtime.tiles.adaptive_sampling import Corners, between_corners


def adaptive_layers(render: Callable[[View], Layers], view: View, corners: Corners, tolerance: float) -> Layers:
    """Return what a method renders, interpolated between the corners of tiles where that is enough.

    Parameters
    ----------
    render
        Any method that computes each ray by itself, on whichever layout.
    view
        All pixels of the image, in square tiles.
    corners, tolerance
        See `realtime.tiles.adaptive_sampling.between_corners`.
    """
    part = view.part()
    known = {"carried": view.carried, "extra_layers": view.extra_layers}
    given: list[Layers] = []  # by the last call of `render`, for what is a mask in its layers and what is missing

    def sample(pixel, distance, tile, layout):
        layers = render(replace(part(pixel, distance, tile, layout), **known))
        given.append(layers)
        shares = layers.visibility or ()
        extra = (layers.extra or {}).values()
        more = (layers.transmittance, layers.background, *extra, *(share for share in shares if not _is_mask(share)))
        numbers = (layers.in_scattered, *(value for value in more if value is not None))
        return numbers, tuple(share for share in shares if _is_mask(share))

    numbers, masks = between_corners(
        corners, view.pixel, view.distance, sample, width=view.camera.width, tolerance=tolerance
    )
    layers, number, mask = given[-1], iter(numbers), iter(masks)
    carried = given[0].carried  # What a branch computes cannot be handed on: the corners are.
    in_scattered = next(number)
    transmittance = None if layers.transmittance is None else next(number)
    background = None if layers.background is None else next(number)
    extra = None if layers.extra is None else {name: next(number) for name in layers.extra}
    if layers.visibility is None:
        return Layers(in_scattered, None, transmittance, background, extra, carried)
    shares = tuple(next(mask) if _is_mask(share) else next(number) for share in layers.visibility)
    return Layers(in_scattered, shares, transmittance, background, extra, carried)


def composed(layers: Layers, by_light: tuple[PerRay, ...]) -> tuple[PerRay, PerRay | None]:
    """Return the airlight, and what is seen through it, by the formula of `realtime.methods.interface.layers`.

    Parameters
    ----------
    layers
        Of a method.
    by_light
        The radiance of the surfaces by light where the layers have a visibility, otherwise their sum alone.

    Returns
    -------
    airlight
        In-scattered radiance [W/(m^2 sr)].
    surface
        Radiance from behind it [W/(m^2 sr)]; None where that is the shaded surface as it is.
    """
    if layers.visibility is None:
        if layers.transmittance is None and layers.background is None:
            return layers.in_scattered, None
        behind = sum(by_light)
    else:
        behind = sum(_lit_share(share, color) for share, color in zip(layers.visibility, by_light))
    if layers.background is not None:
        behind = behind + layers.background
    return layers.in_scattered, behind if layers.transmittance is None else layers.transmittance * behind


def added(
    sums: tuple[PerRay, PerRay], layers: Layers, by_light: tuple[PerRay, ...]
) -> tuple[PerRay, PerRay, PerRay | None]:
    """Return airlight and surface of some lights with those of others added, and what is seen of no light.

    Parameters
    ----------
    sums
        Airlight and surface of the others [W/(m^2 sr)].
    layers, by_light
        Of these, as for `composed`.

    Returns
    -------
    airlight, surface
        The sums [W/(m^2 sr)]. They have an entry per ray.
    beyond
        The background of the layers through their transmittance, which is no light's own; None where there is none.
    """
    airlight, surface = composed(replace(layers, background=None), by_light)
    beyond = layers.background
    if beyond is not None and layers.transmittance is not None:
        beyond = layers.transmittance * beyond
    return sums[0] + airlight, sums[1] + (sum(by_light) if surface is None else surface), beyond


def _lit_share(share: PerRay, color: PerRay) -> PerRay:
    return dr.select(share, color, 0) if _is_mask(share) else share * color


def _is_mask(share: PerRay) -> bool:
    return isinstance(share, bool) or dr.is_mask_v(share)


def image_passes(method: Method, parameters: Any, *, surfaces: bool) -> Callable[..., Any]:
    """Return the stage that runs the passes of a method over the whole image, and composes what they return.

    Parameters
    ----------
    method
        A method with passes.
    parameters
        Its parameters.
    surfaces
        Whether there is something that the camera can see.

    Returns
    -------
    stage
        (geometry, facets, pixel, lane, camera, medium, cast, by_light, layers, history) -> airlight, surface, and for
        the next frame layers and G-buffer, row by row. `lane` has the entry of every pixel, row by row; `geometry` is
        for Mitsuba's surfaces.
    """

    def run(geometry, facets, pixel, lane, camera, medium, cast, by_light, layers, history):
        if method.passes_read_depth_alone:
            shown = GBuffer(cast.distance, None, None)
        else:
            shown = _surfaces(facets, pixel, camera, medium, cast) if surfaces else _no_surfaces(camera, medium, cast)
        layers = _complete(layers, dr.width(pixel))
        dr.eval(layers, shown)
        layers, g_buffer = _in_order(layers, lane), _in_order(shown, lane)
        for image_pass in method.passes:
            dr.eval(layers, g_buffer)
            layers = image_pass(layers, g_buffer, history, camera=camera, parameters=parameters)
        layers = _complete(layers, dr.width(pixel))
        dr.eval(layers, g_buffer)
        return *composed(_in_order(layers, pixel), by_light), layers, g_buffer

    return run


def _surfaces(facets, pixel: PerRay, camera: Camera, medium: Medium, cast: Cast) -> GBuffer:
    direction, _ = ray_directions(camera, pixel)
    seen = visible_surface(cast, facets, camera.origin, direction, color=type(medium.albedo))
    there = dr.isfinite(seen.distance)
    return GBuffer(seen.distance, dr.select(there, seen.normal, 0), dr.select(there, seen.albedo, 0))


def _no_surfaces(camera: Camera, medium: Medium, cast: Cast) -> GBuffer:
    width = dr.width(cast.distance)
    return GBuffer(cast.distance, dr.zeros(type(camera.origin), width), dr.zeros(type(medium.albedo), width))


def _complete(layers: Layers, width: int) -> Layers:
    """Return layers in which every array has an entry per pixel: passes read neighbours."""

    def whole(value):
        if value is None or isinstance(value, tuple):
            return value if value is None else tuple(whole(item) for item in value)
        if isinstance(value, bool):
            return dr.full(mi.Bool, value, width)
        if isinstance(value, float | int):
            return dr.full(type(layers.in_scattered.x), value, width)
        return value if dr.width(value) == width else dr.gather(type(value), value, dr.zeros(mi.UInt32, width))

    parts = layers.in_scattered, layers.visibility, layers.transmittance, layers.background
    return Layers(*(whole(value) for value in parts))


def _in_order(record: Any, index: PerRay) -> Any:
    """Return layers or a G-buffer whose entries come in another order."""

    def gathered(value):
        if value is None or isinstance(value, tuple):
            return value if value is None else tuple(gathered(item) for item in value)
        return dr.gather(type(value), value, index)

    return type(record)(**{name: gathered(value) for name, value in vars(record).items()})
