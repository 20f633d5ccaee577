# SPDX-License-Identifier: BSD-3-Clause
"""Properties of meshes for tests of scenes: edges, whether a mesh is
closed, its volume and areas.
"""

from collections import Counter

import numpy as np


def directed_edges(faces) -> Counter:
    """Count the edges of the faces in the direction in which each face runs through them."""
    pairs = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    return Counter(map(tuple, pairs.tolist()))


def is_closed(faces) -> bool:
    """Whether every edge is met exactly twice, in opposite directions."""
    edges = directed_edges(faces)
    return set(edges.values()) == {1} and {(b, a) for a, b in edges} == set(edges)


def volume(vertices, faces) -> float:
    """Signed volume, positive where the faces run counter-clockwise seen from outside."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6)


def normals_by_area(vertices, faces):
    """Return the outward normals of the faces, each as long as the area of its face."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return 0.5 * np.cross(b - a, c - a)


def areas(vertices, faces):
    """Return the areas of the faces."""
    return np.linalg.norm(normals_by_area(vertices, faces), axis=1)
