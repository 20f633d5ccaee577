# SPDX-License-Identifier: BSD-3-Clause
"""The shadow planes of one light as the paper draws them: in its order, with edges
to mesh, and about a spot.

**The order** (section 5.1.4). Planes come towards the camera by the cosine of the angle at the
light between the camera and the middle of their edge, the least first. For a light at infinity the
distance c of the middle from the axis takes the place of that angle: cos psi = 1 - c^2/(2 D^2) +
..., so -c has the order of the cosine.

**A spot as an occluder**: the cone over a point light that the paper adds (its section 6, with 32
edges). Points outside the cone are in shadow, one layer deep. The silhouette of the cone is a ring
of edges about the axis, close to the light; the corners lie on the cone of the spot, so that the
pyramid is inside it. As the light sees the ring it runs counter-clockwise, with no layer to its
left and one to its right: every edge has the coefficient -1.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airlight.realtime.methods.shadow_planes.plane_table import (
    PlaneIndex,
    edge_planes,
    layers_between,
    light_basis,
    parted,
    plane_index,
    table_of,
)
from airlight.realtime.methods.shadow_planes.silhouettes import silhouette
from airlight.realtime.numerics.array_types import ArrayTypes
from airlight.realtime.scene.mesh_adjacency import Occluders

Array = NDArray[np.float64]

#: Distance of the ring of a spot from the light, over the distance of the camera from the light.
#: All light passes within the ring, so it must be nearer to the light than anything in the picture.
NEARNESS = 1e-6


@dataclass(frozen=True)
class PaperPlanes:
    """The shadow planes of one light, with the edges and the order that the paper needs."""

    index: PlaneIndex
    centres: Any  #: cosine at the middle of the edge of every plane, section 5.1.4; w = 0: -c [m]
    ends: Any  #: ends of the edge of every plane in the frame [m], six numbers each, flat


def paper_planes(
    occluders: Occluders,
    light: Array,
    camera: Array,
    *,
    used: NDArray[np.bool_],
    types: ArrayTypes,
    towards_camera: bool,
    ring: Array | None = None,
) -> PaperPlanes:
    """Find the shadow planes of a light.

    Parameters
    ----------
    occluders, light, camera, used, types
        As of `realtime.methods.shadow_planes.plane_table.index_planes`.
    towards_camera
        Whether they come in the paper's order; otherwise as rays cross them.
    ring
        The `cone_ring` of a spot whose cone is an occluder.
    """
    basis = light_basis(light, camera)
    layers = layers_between(occluders, light, basis, used=used)
    edges = silhouette(occluders, light, used=used)
    ends, coefficient = basis.coordinates(occluders.vertices[edges.edges]), edges.coefficient
    # The ring of a spot, with a layer of shadow outside: the camera may lie there.
    if ring is not None:
        of_ring = NEARNESS * basis.distance * ring_edges(ring) @ basis.axes.T
        ends = np.concatenate([ends, of_ring])
        coefficient = np.concatenate([coefficient, np.full(len(ring), -1, dtype=np.int32)])
        layers += is_outside(ring, basis.axes[2])
    # A plane may be parted in two: `planes.edge` says of each which edge it has.
    planes = parted(edge_planes(ends, coefficient, w=basis.w))
    ends = ends[planes.edge]
    centres = edge_centres(ends, basis.w)
    rank = centres if towards_camera else None
    Float = types.scalar
    return PaperPlanes(
        plane_index(planes, basis, layers=layers, types=types, rank=rank),
        table_of(Float, centres, 11),
        table_of(Float, ends, 6),
    )


def edge_centres(ends: Array, w: int) -> Array:
    """Return the values by which planes are ordered towards the camera, from the ends (planes,
    2, 3) of their edges [m]: the cosine at the middle of the edge, or for w = 0 minus its distance
    from the axis.
    """
    middle = 0.5 * (ends[:, 0] + ends[:, 1])
    if w:
        return middle[:, 2] / np.maximum(np.linalg.norm(middle, axis=1), np.finfo(float).tiny)
    return -np.linalg.norm(middle[:, :2], axis=1)


def cone_ring(axis: Array, cos_cutoff: float, sides: int) -> Array:
    """Return unit vectors from a light through the corners of a ring on its cone, (sides, 3).

    `axis`: of the spot, a unit vector; `cos_cutoff`: cosine of the half angle of the cone, in (0,
    1); `sides`: edges of the ring, 3 or more.
    """
    # The coordinate axis that is farthest from the spot's axis gives a product that is not small.
    across = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    across /= np.linalg.norm(across)
    above = np.cross(across, axis)  # looking along the axis, `across` is to the right of it
    angle = 2 * np.pi * (np.arange(sides) + 0.5) / sides
    sine = np.sqrt((1 - cos_cutoff) * (1 + cos_cutoff))
    return cos_cutoff * axis + sine * (
        np.cos(angle)[:, None] * across + np.sin(angle)[:, None] * above
    )


def ring_edges(ring: Array) -> Array:
    """Return the corners at both ends of every edge of a ring, (sides, 2, 3)."""
    return np.stack([ring, np.roll(ring, -1, axis=0)], axis=1)


def is_outside(ring: Array, direction: Array) -> bool:
    """Return whether a direction from the light, (3,), of any length [1], is outside the
    pyramid of a ring, (n, 3).
    """
    # The axis is on the other side of every plane of the pyramid: seen along it the
    # ring runs counter-clockwise.
    normals = np.cross(ring, np.roll(ring, -1, axis=0))
    return bool(np.any(normals @ direction > 0))
