# SPDX-License-Identifier: BSD-3-Clause
"""What a method returns, what a pass over the whole image is given, and what a frame makes of both.

A frame shows

    surface * visibility * transmittance + in_scattered + transmittance * background,

in which `surface` is the light of a lamp that the visible surface reflects to the camera, through the medium of the
scene and without shadows, summed over the lamps.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from realtime.numerics.array_types import Metres, PerRay
from realtime.scene.camera import Camera


@dataclass(frozen=True)
class Layers:
    """What a method says of every ray. What it leaves out costs nothing."""

    in_scattered: PerRay  #: radiance that the media scatter into the ray, a colour [W/(m^2 sr)]
    #: By light, or by source (`Method.by_source`), which share of it reaches the surface: 0 to 1, or a mask; None:
    #: shadow rays say it.
    visibility: tuple[PerRay, ...] | None = None
    transmittance: PerRay | None = (
        None  #: share of what comes from behind that passes what the method adds to the scene's media; None: all
    )
    background: PerRay | None = None  #: radiance from behind all media, 0 where a surface hides it [W/(m^2 sr)]
    #: Further layers of the image by their names, radiance [W/(m^2 sr)] or shares, only where the view asks for them
    extra: Mapping[str, PerRay] | None = None
    carried: Any = None  #: arrays that the next frame finds in its view, whatever their sizes; see `Method.carries`


@dataclass(frozen=True)
class GBuffer:
    """The visible surfaces, one entry per pixel, row by row."""

    depth: Metres  #: distance along the ray, infinite where there is no surface [m]
    normal: PerRay | None  #: unit normal on the side of the camera; 0 where there is no surface
    albedo: PerRay | None  #: diffuse reflectance; 0 where there is no surface; None, as normals: no pass reads them


@dataclass(frozen=True)
class History:
    """What the last frame leaves to a pass, one entry per pixel, row by row."""

    layers: Layers  #: as the passes left them
    g_buffer: GBuffer
    camera: Camera
