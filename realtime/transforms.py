# SPDX-License-Identifier: BSD-3-Clause
"""Transforms of Mitsuba's plugins on the host, in float64, and which of them lights
and spheres cannot have.
"""

from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from airlight.errors import InputError

Array = NDArray[np.float64]

_UNEVEN = 1e-5  # of a scale: float32 transforms of one scale differ by less along their axes


def host_matrix(transform: Any) -> Array:
    """Return a transform of Mitsuba as a matrix, (4, 4)."""
    return np.array(transform.matrix, dtype=np.float64).reshape(4, 4)


def spot_axis(emitter: Any) -> Array:
    """Return the unit vector along the axis of a spot, (3,).

    Raises InputError for scales that differ between axes: Mitsuba turns directions into the spot's
    own frame, where the cone is round, so that it is oval in the world.
    """
    matrix = host_matrix(emitter.world_transform())[:3, :3]
    squares = matrix.T @ matrix  # a multiple of the identity where angles stay as they are
    scale = np.trace(squares) / 3
    # The square of a scale differs by twice the fraction of the scale; `not <=` refuses NaN, too.
    if not np.abs(squares - scale * np.eye(3)).max() <= 2 * _UNEVEN * scale:
        scales = " x ".join(f"{length:g}" for length in np.sqrt(np.diag(squares)))
        raise InputError(
            f"light '{emitter.id()}' has a to_world that stretches its cone, by {scales} or by "
            "shear; expected one "
            "scale for all axes and no shear, which a 'rotate' brings whose axis is not of unit "
            "length: take the scale "
            "away, in a modelling program before the export"
        )
    return np.asarray(matrix[:, 2] / np.linalg.norm(matrix[:, 2]))


def beam_axis(emitter: Any) -> Array:
    """Return the unit vector along which a directional light travels, (3,).

    Raises InputError for one that is scaled: Mitsuba multiplies the light on surfaces by
    the length of the vector.
    """
    # A directional emitter shines along +z of its own frame.
    axis = host_matrix(emitter.world_transform())[:3, 2]
    length = float(np.linalg.norm(axis))
    if not abs(length - 1) <= _UNEVEN:
        raise InputError(
            f"light '{emitter.id()}' has a to_world that scales its direction by {length:g}, by "
            "which Mitsuba "
            "multiplies its light on surfaces; expected no scale: remove it, or give 'direction' "
            "instead of 'to_world'"
        )
    return np.asarray(axis / length)


def turned_outwards(sphere: Any) -> str:
    """Return what to do about a sphere whose normals point inwards."""
    if np.linalg.det(host_matrix(mi.traverse(sphere)["to_world"])[:3, :3]) < 0:
        return "make the negative scale of its to_world positive: a mirror turns it inside out"
    return "remove flip_normals"
