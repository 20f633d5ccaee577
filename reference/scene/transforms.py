# SPDX-License-Identifier: BSD-3-Clause
"""Transforms of Mitsuba as matrices in float64, and what their scales do to lights and spheres.

A spot turns directions into its own frame and compares their angle to its axis with its cone. One
scale for all axes, and a mirror, leave angles as they are; other scales make the cone oval. A
directional light takes the image of the axis z for its direction and keeps its length, by which
Mitsuba then multiplies the light on surfaces. A sphere that is mirrored is inside out.
"""

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SAME = 1e-5  #: scales and angles of a float32 transform that differ by less are meant to be equal


def matrix_of(
    transform: "mi.Transform4f | mi.ScalarTransform4f | mi.ScalarTransform4d",
) -> Array:
    """Return a transform of Mitsuba as a matrix, (4, 4)."""
    return np.array(transform.matrix, dtype=np.float64).reshape(4, 4)


def stretch(matrix: Array) -> float:
    """Return the largest scale of a transform over its smallest, 1 where it keeps angles."""
    largest, *_, smallest = np.linalg.svd(matrix[:3, :3], compute_uv=False)
    return float(largest / smallest) if smallest > 0 else float("inf")


def outwards(matrix: Array) -> str:
    """Return what to do about a sphere whose normals point inwards."""
    if np.linalg.det(matrix[:3, :3]) < 0:
        return (
            "no negative scale, which turns a sphere inside out: make it positive, a mirrored "
            "sphere is the same"
        )
    return "normals that point outwards: remove flip_normals"
