# SPDX-License-Identifier: BSD-3-Clause
"""A spot as a caster: the cone over a point light that the paper adds (Biri 2006, section 6, with 32 edges).

What is outside the cone is in shadow, one layer deep. Its silhouette is a ring of edges about the axis, close to the
light; the corners lie on the cone of the spot, so that the pyramid is inside it. As the light sees the ring it runs
counter-clockwise, with no layer to its left and one to its right: every edge has the coefficient -1
(`realtime.methods.shadow_planes.silhouettes`).
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Distance of the ring from the light over that of the camera: what passes the light within it is lit all around.
NEARNESS = 1e-6


def cone_ring(axis: Array, cos_cutoff: float, sides: int) -> Array:
    """Return unit vectors from a light through the corners of a ring on its cone, (sides, 3).

    Parameters
    ----------
    axis
        Of the spot, a unit vector.
    cos_cutoff
        Cosine of the half angle of the cone, in (0, 1).
    sides
        Edges of the ring, 3 or more.
    """
    across = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    across /= np.linalg.norm(across)
    above = np.cross(across, axis)  # looking along the axis, `across` is to the right of it
    angle = 2 * np.pi * (np.arange(sides) + 0.5) / sides
    sine = np.sqrt((1 - cos_cutoff) * (1 + cos_cutoff))
    return cos_cutoff * axis + sine * (np.cos(angle)[:, None] * across + np.sin(angle)[:, None] * above)


def ring_edges(ring: Array) -> Array:
    """Return the corners at both ends of every edge of a ring, (sides, 2, 3)."""
    return np.stack([ring, np.roll(ring, -1, axis=0)], axis=1)


def is_outside(ring: Array, direction: Array) -> bool:
    """Return whether a direction from the light, (3,), of any length [1], is outside the pyramid of a ring, (n, 3)."""
    # The axis is on the other side of every plane of the pyramid: seen along it the ring runs counter-clockwise.
    normals = np.cross(ring, np.roll(ring, -1, axis=0))
    return bool(np.any(normals @ direction > 0))
