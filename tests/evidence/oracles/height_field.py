# SPDX-License-Identifier: BSD-3-Clause
"""Parts of the oracle of light volumes: the height field of a shadow map in
float64, and rays over a face.

See `tests.evidence.oracles.light_volume` for the derivation.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from airlight.errors import InputError
from airlight.realtime.methods.light_volumes.texel_walls import PLACES
from airlight.realtime.shadow_maps.shadow_map import ShadowMap

Array = NDArray[np.float64]
Index = NDArray[np.int64]


@dataclass(frozen=True)
class HeightField:
    """The height field of a light's shadow map."""

    size: int  #: texels on a side
    #: 1 / planar depth at the corners of the texels, (faces, size + 1, size + 1) by v, u [1/m]
    heights: Array
    #: matrices that give a, b, c of a vector a across + b up + c axis, (faces, 3, 3)
    coordinates: Array
    #: on the bottom, top, left and right of a texel, (faces, size, size, 4), NaN for none
    walls: Array | None = None

    @property
    def is_cube(self) -> bool:
        """Whether the faces look all around."""
        return len(self.heights) == 6


def height_field(shadow_map: ShadowMap, walls: NDArray[np.uint32] | None = None) -> HeightField:
    """Return the height field of a shadow map.

    With k = axis + u across + v up the first surface is at k / s = k distance / |k| from the light,
    so s = |k| / distance, and 0 where the distance is infinite.
    """
    size = shadow_map.size
    distance = np.array(shadow_map.distance, dtype=np.float64)
    if not np.all(distance > 0):
        raise InputError(
            f"shadow map: got a distance of {np.min(distance):g}, expected distances above 0 [m]"
        )
    frames = _frames(shadow_map)
    at = np.linspace(-1.0, 1.0, size + 1)
    v, u = np.meshgrid(at, at, indexing="ij")
    k = np.einsum("ijc,fcx->fijx", np.stack([u, v, np.ones_like(u)], axis=-1), frames)
    heights = np.sqrt(np.sum(k * k, axis=-1)) / distance.reshape(len(frames), size + 1, size + 1)
    coordinates = np.asarray(np.linalg.inv(np.swapaxes(frames, 1, 2)), dtype=np.float64)
    if walls is None:
        return HeightField(size, heights, coordinates)
    number = (
        walls.reshape(len(frames), size, size, 1) >> np.arange(0, 32, 8, dtype=np.uint32) & 0xFF
    )
    return HeightField(
        size, heights, coordinates, np.where(number > 0, (number - 0.5) / PLACES, np.nan)
    )


def _frames(shadow_map: ShadowMap) -> Array:
    """Return across, up and axis of every face as rows, (faces, 3, 3)."""
    if basis := shadow_map.projection.basis:
        return np.array([np.array(vector, dtype=np.float64).reshape(3) for vector in basis])[None]
    frames = np.zeros((6, 3, 3))
    for face in range(6):
        axis = face // 2
        frames[face, 0, (axis + 1) % 3] = frames[face, 1, (axis + 2) % 3] = 1
        frames[face, 2, axis] = -1 if face % 2 else 1
    return frames


@dataclass(frozen=True)
class Path:
    """Some rays in the coordinates a, b, c of a face."""

    normal: Array  #: of n, (rays, 3)
    direction: Array  #: of w, (rays, 3)
    height: Array  #: (rays,) [m]


def by_ray(
    first: Index, first_angle: Array, second: Index, second_angle: Array
) -> tuple[Index, Array]:
    """Join two lists of angles of rays and sort them by ray and angle."""
    ray, angle = np.concatenate([first, second]), np.concatenate([first_angle, second_angle])
    order = np.lexsort((angle, ray))
    return ray[order], angle[order]


def zero_angle(cosine: Array, sine: Array) -> Array:
    """Return where `cosine` cos(theta) + `sine` sin(theta) = 0, from -pi/2 to pi/2
    [rad], in the shape of both.
    """
    return np.arctan2(np.where(sine < 0, cosine, -cosine), np.abs(sine))
