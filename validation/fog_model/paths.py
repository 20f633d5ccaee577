# SPDX-License-Identifier: BSD-3-Clause
"""Single-scattering paths of an image: camera, node, light, with the length of each leg in every medium."""

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from reference.scene.read import TruthMedium

Array = NDArray[np.float64]
Index = NDArray[np.int64]

AROUND = 0  #: number of the medium without bounds; the media with bounds count on from there


@dataclass(frozen=True)
class Nodes:
    """Points on lit parts of rays, each with its share of the integral along the ray; (n,) unless it says otherwise."""

    ray: Index  #: number of the ray
    medium: Index  #: number of the medium that scatters there
    x: Array  #: distance from the camera [m]
    r: Array  #: distance from the light [m]; 1 for a directional light
    cosine: Array  #: of the scattering angle
    weight: Array  #: length of the ray that the node stands for, times the profile of the light [m]
    camera: Array  #: length in each medium between camera and node, (n, media) [m]
    leg: Array  #: length in each medium between light and node, (n, media) [m]
    towards: Array  #: unit vector from the light to the node, (n, 3); 0 for a directional light

    @staticmethod
    def joined(parts: "list[Nodes]") -> "Nodes":
        """Join nodes of several lights."""
        return Nodes(*(np.concatenate([getattr(part, f.name) for part in parts]) for f in fields(Nodes)))


@dataclass(frozen=True)
class SurfacePoints:
    """Visible surface points that a light reaches; (n,) unless it says otherwise."""

    ray: Index  #: number of the ray
    radiance: Array  #: what they send to the camera where nothing dims it, (n, 3) [W/(m^2 sr)]
    r: Array  #: distance from the light [m]; 1 for a directional light
    camera: Array  #: length in each medium between camera and surface, (n, media) [m]
    leg: Array  #: length in each medium between light and surface, (n, media) [m]
    towards: Array  #: unit vector from the light to the surface, (n, 3); 0 for a directional light

    @staticmethod
    def joined(parts: "list[SurfacePoints]") -> "SurfacePoints":
        """Join surface points of several lights."""
        names = [f.name for f in fields(SurfacePoints)]
        return SurfacePoints(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))


@dataclass(frozen=True)
class LightPaths:
    """All paths from one light of the scene."""

    name: str  #: the light's id
    intensity: Array  #: radiant intensity, irradiance or radiance times area, (3,): what multiplies the nodes
    nodes: Nodes
    surface: SurfacePoints


@dataclass(frozen=True)
class ScatteringPaths:
    """All paths of some pixels of an image."""

    shape: tuple[int, int]  #: height and width of the whole image [pixels]
    pixels: Index  #: numbers of the pixels that have paths, row by row, ascending, (m,)
    ray_pixel: Index  #: by ray, which of these pixels it belongs to, (rays,)
    rays_per_pixel: int
    direction: Array  #: of the rays, unit, (rays, 3)
    axis: Array  #: of the camera, unit, (3,)
    media: tuple[TruthMedium, ...]  #: that without bounds first
    media_names: tuple[str, ...]
    lights: tuple[LightPaths, ...]
