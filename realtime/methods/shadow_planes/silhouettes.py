# SPDX-License-Identifier: BSD-3-Clause
r"""Silhouette edges as seen from a light.

Give every triangle t the number of layers w_t that it stands for, positive if its front faces the
light. Its shadow is the set of directions of its projection on the sphere about the light, and the
number of layers over a direction changes by w_t where one crosses the border of that projection.
Summed over all triangles, the edge e from vertex a to vertex b is crossed with the coefficient

    c_e = sum_t s_te w_t,    s_te = +1 if t runs along e from a to b, -1 if it runs from b to a.

The edges with c_e != 0 are the silhouette. As a sum of borders it is a cycle: at each vertex as
many layers begin as end, *whatever signs w_t have*. A triangle whose plane holds the light, and
whose sign is therefore a matter of rounding, changes the count only inside its own projection,
which has no area; the count over a direction is whole.

Layers:

* a closed component counts its triangles that face the light, w = 1, or just as well its averted
  triangles: both have the same cycle. Edges between a facing and an averted triangle get c = +-1:
  the silhouette of the paper.
* an open component (border edges, or faces that are not consistently oriented) counts all of its
  triangles, each turned to the light: w = +1 or -1. Its folds get c = +-2, its border edges c =
  +-1.
* a triangle whose plane holds the light counts nothing, w = 0.

With the light at (l, 1), or (l, 0) where it is at infinity (`realtime.scene.lights`), the front of
a triangle with the normal n in the plane n . p = c faces it where n . l - c > 0, or n . l > 0.
Nothing else here depends on the position of the light: at infinity, the plane across its direction
replaces the sphere of directions.

Biri, Arques, Michelin 2006, section 5.1.1, for closed meshes.

**Culling.** The shadow volume of an occluder lies in its bounding box extruded away from the light
at (l, w): all points c + s (w c - l), s >= 0, c in the box. That is convex, the hull of the corners
c and of the directions w c - l. It misses the view if it lies wholly outside one of the five planes
through the pinhole that bound what the camera sees (section 5.2 of the paper does the same for
bounded media).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from airlight.realtime.scene.camera import HostCamera
from airlight.realtime.scene.lights import place_and_weight
from airlight.realtime.scene.mesh_adjacency import Occluders

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Silhouette:
    """Directed edges about which shadow volumes turn."""

    edges: NDArray[np.int32]  #: vertex numbers, (edges, 2)
    coefficient: NDArray[
        np.int32
    ]  #: c_e: layers to the left of the edge, as the light sees it, less those to its right


def facing(occluders: Occluders, light: Array) -> NDArray[np.int32]:
    """Return by triangle whether its front faces a light: 1 yes, -1 no, 0 edge-on."""
    l, w = place_and_weight(np.asarray(light, dtype=np.float64))  # noqa: E741
    return np.sign(occluders.normals @ l - w * occluders.offsets).astype(np.int32)


def layers(occluders: Occluders, light: Array) -> NDArray[np.int32]:
    """Return w, the number of layers that each triangle stands for.

    `light` is a homogeneous position, (4,), or a place, (3,) [m].
    """
    sign = facing(occluders, light)
    if occluders.closed.all():
        return np.maximum(sign, 0)
    return np.where(occluders.closed[occluders.component], np.maximum(sign, 0), sign)


def silhouette(
    occluders: Occluders, light: Array, *, used: NDArray[np.bool_] | None = None
) -> Silhouette:
    """Find the silhouette edges.

    Valid for closed, open and non-manifold meshes, either winding, and a light inside an occluder
    (which has then no silhouette: all outside is dark, see
    `realtime.methods.shadow_planes.plane_table.layers_between`).

    Parameters
    ----------
    occluders
        Triangles with their adjacency.
    light
        Homogeneous position of the light, (4,), or its place, (3,) [m].
    used
        By component, whether to look at it; all by default.
    """
    weight = layers(occluders, light)
    if used is not None and not used.all():
        weight[~used[occluders.component]] = 0
    coefficient = occluders.incidence @ weight
    on_silhouette = np.flatnonzero(coefficient)
    return Silhouette(occluders.edges[on_silhouette], coefficient[on_silhouette])


def components_in_view(occluders: Occluders, camera: HostCamera, light: Array) -> NDArray[np.bool_]:
    """Return by component whether its shadow can be seen; `light` is a homogeneous
    position, (4,), or a place, (3,).
    """
    l, w = place_and_weight(light)  # noqa: E741
    origin, normals = view_planes(camera)
    # The eight corners of each box, by their lower and upper coordinates.
    choose = np.array([[i >> k & 1 for k in range(3)] for i in range(8)])
    corners = occluders.boxes[:, choose, np.arange(3)]
    near = (corners - origin) @ normals.T
    far = (w * corners - l) @ normals.T
    # A hull lies outside a plane if its corners and the directions away from the light all do.
    outside = np.all(near < 0, axis=1) & np.all(far <= 0, axis=1)
    return ~outside.any(axis=1)


def view_planes(camera: HostCamera) -> tuple[Array, Array]:
    """Return the pinhole and the normals, towards the view, of the planes
    through it that bound the view.
    """
    # The corners of the image in turn; two neighbours and the pinhole span a plane. The fifth plane
    # bounds what lies behind the camera.
    half = 0.5 * np.array([camera.width, camera.height])
    signs = np.array([(1, 1), (-1, 1), (-1, -1), (1, -1)])
    corner = camera.forward + (signs * half) @ np.stack([camera.left, camera.up])
    normals = np.cross(corner, np.roll(corner, 1, axis=0))
    normals[normals @ camera.forward < 0] *= -1
    return camera.origin, np.vstack([normals, camera.forward])
