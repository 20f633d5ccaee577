# SPDX-License-Identifier: BSD-3-Clause
"""A cumulus with hypertexture: the mesh of `cumulus` as a hull, and within it a density of 128^3 voxels."""

from functools import cache
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from validation.scenes.cloud_parts import EXTINCTION, cloud, droplets, sky, sun
from validation.scenes.clouds.hypertexture import distance_into, grid_points, inside, octaves, sigmoid
from validation.scenes.cumulus import cumulus_mesh
from validation.scenes.parts import camera, medium_boundary
from validation.scenes.record import Animation, SceneRecord

VOXELS = 128  #: along each axis
_SEED = 1789
_SIZE = 149.0  #: of the cells of the first of four octaves [m]
_AMPLITUDE = 89.0  #: of the noise [m]
_EMPTY, _FULL = 43.0, 67.0  #: depths between which the density rises, where there is no noise [m]
_MARGIN = 11.0  #: of the grid around the mesh [m]


def cumulus_detail() -> dict[str, Any]:
    """Return the cloud in clear air before a blue sky, with the light of `cumulus`, seen from a little nearer."""
    return {
        "type": "scene",
        "sensor": camera((-103.0, -1439.0, 801.0), (21.0, 13.0, 931.0), fov=48.7, size=(800, 600), in_fog=False),
        "sun": sun((0.571, 0.433, -0.697), (3.17, 3.05, 2.83)),
        "sky": sky((0.067, 0.113, 0.211)),
        "cloud": medium_boundary("cloud", cumulus_mesh(), _medium()),
    }


def _medium() -> dict[str, Any]:
    low, high = grid_box()
    box = mi.ScalarTransform4f().translate(low.tolist()).scale((high - low).tolist())
    return cloud(droplets()) | {
        "type": "heterogeneous",
        "sigma_t": {"type": "gridvolume", "grid": mi.VolumeGrid(density()[..., None]), "to_world": box},
        "scale": EXTINCTION,
    }


def grid_box() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the corners of the box of the grid, (3,) each [m]."""
    vertices, _ = cumulus_mesh()
    return vertices.min(axis=0) - _MARGIN, vertices.max(axis=0) + _MARGIN


@cache
def density(voxels: int = VOXELS) -> NDArray[np.float32]:
    """Return rho from 0 to 1, (z, y, x), on a grid of so many voxels along each axis; it takes seconds.

    The distance is computed on every second voxel, and linear between these.
    """
    mesh, coarse = cumulus_mesh(), voxels // 2
    sparse = grid_points(*grid_box(), (coarse,) * 3)
    within = inside(mesh, sparse)
    distance = np.zeros(within.shape)
    distance[within] = distance_into(mesh, sparse[within])
    place = (np.arange(voxels) + 0.5) * (coarse / voxels) - 0.5
    depth = map_coordinates(distance, np.meshgrid(place, place, place, indexing="ij"), order=1, mode="nearest")
    edge = (depth > 0) & (depth < _FULL + _AMPLITUDE)
    depth[edge] += _AMPLITUDE * octaves(grid_points(*grid_box(), (voxels,) * 3)[edge], _SIZE, 4, _SEED)
    return sigmoid(depth, _EMPTY, _FULL).astype(np.float32)


SCENE = SceneRecord(
    "cumulus-detail",
    cumulus_detail,
    "The cumulus with hypertexture: density by distance and noise on 128^3 voxels, 0 at the hull and 1 in the core.",
    "Bouthors, Neyret, Max, Bruneton, Crassin 2008, sections 8 and 9: 5 000 triangles and 512^3 voxels, 2 frames/s",
    Animation(("light",)),
    clouds=True,
)
