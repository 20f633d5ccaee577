# SPDX-License-Identifier: BSD-3-Clause
"""The stages of a frame before the method's: camera rays are cast, and what they meet is shaded.

What is cast depends on camera and geometry alone, and serves many frames (`realtime.frame.incremental`). So there are
two frozen functions: one casts and shades, and hands on what it cast, which costs it nothing; one shades what was cast
for another frame. To cast and to shade in two steps wherever something moved would take up to 7 % longer.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import drjit as dr

from realtime.bounded_media.pieces import camera_insides, optical_depths
from realtime.frame.surface import Cast, cast_rays, lit_by_points, lit_surface, visible_surface
from realtime.numerics.recorded import Frozen
from realtime.scene.camera import ray_directions
from realtime.scene.lights import sources_of
from realtime.scene.read_scene import Scene


def surface_stages(
    scene: Scene, *, provides_visibility: bool, by_source: bool = False, through_media: bool = True
) -> tuple[Callable[..., Any], Callable[..., Any], bool]:
    """Return the stages for a scene.

    Parameters
    ----------
    scene
        The scene; what matters is what cannot move.
    provides_visibility
        Whether the method finds out which surfaces are lit.
    by_source
        Whether it does so for all points of a light with extent together.
    through_media
        Whether the bounded media dim the surfaces; if not, the method says how much they do.

    Returns
    -------
    surface
        (geometry, facets, pixel, camera, medium, lights) -> what camera rays meet, and what `shade` returns.
    shade
        (geometry, facets, pixel, camera, medium, lights, cast) -> surface radiance by light, or a tuple of their sum.
    casts_rays
        Whether `shade` needs the geometry.
    """
    if not scene.features.surfaces:
        return _nothing_met, no_surface, False
    sources = sources_of(scene.lights)
    # The map of a light at infinity covers the media alone; surfaces beside them are lit too.
    asked = [not (light.w and provides_visibility) for light in scene.lights]

    def cast_all(geometry, facets, pixel, camera, medium) -> Cast:
        direction, _ = ray_directions(camera, pixel)
        cast = cast_rays(geometry, facets, camera.origin, direction)
        if not (medium.bounded_media and through_media):
            return cast
        insides = camera_insides(medium, camera.origin, direction, cast.distance)
        return replace(cast, insides=insides)

    def shade_all(geometry, facets, pixel, camera, medium, lights, cast):
        direction, _ = ray_directions(camera, pixel)
        seen = visible_surface(cast, facets, camera.origin, direction, color=type(medium.albedo))
        medium = medium if through_media else replace(medium, bounded_media=())
        depths = optical_depths(medium, cast.distance, cast.insides) if medium.bounded_media else None
        shown = {"medium": medium, "depths": depths}

        def lit(number: int):
            return lit_surface(geometry, seen, light=lights[number], shadows=asked[number], **shown)

        def lit_by(source: list[int]):
            if len(source) == 1:
                return lit(source[0])
            if medium.bounded_media:
                return sum(lit(number) for number in source)
            points = [lights[number] for number in source]
            return lit_by_points(geometry, seen, medium=medium, lights=points, shadows=asked[source[0]])

        if provides_visibility and not by_source:
            return tuple(lit(number) for number in range(len(lights)))
        colors = tuple(lit_by(source) for source in sources)
        return colors if by_source else (sum(colors),)

    @Frozen
    def surface(geometry, facets, pixel, camera, medium, lights):
        cast = cast_all(geometry, facets, pixel, camera, medium)
        return cast, shade_all(geometry, facets, pixel, camera, medium, lights, cast)

    return surface, Frozen(shade_all), scene.facets is None or any(asked)


def _nothing_met(geometry, facets, pixel, camera, medium, lights):
    cast = Cast(dr.full(type(camera.origin.x), dr.inf, dr.width(pixel)))
    return cast, no_surface(geometry, facets, pixel, camera, medium, lights, cast)


def no_surface(geometry, facets, pixel, camera, medium, lights, cast):
    """Return what `shade` returns where there are no surfaces: black, RGB [W/(m^2 sr)], for each light.

    The parameters are those of `shade`: `geometry`, `facets`, `pixel`, `camera`, `medium`, `lights`, `cast`.
    """
    return tuple(dr.zeros(type(medium.albedo), dr.width(pixel)) for _ in lights)
