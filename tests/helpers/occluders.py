# SPDX-License-Identifier: BSD-3-Clause
"""Meshes on which silhouettes and shadow planes go wrong, for tests: each returns
(vertices (n, 3), faces (m, 3)).

`SOUND` are closed and oriented outwards, `AWKWARD` each have the one flaw that their docstring
names, `ALL` are both. Arbitrary numbers throughout; no vertex occurs twice within a mesh.
"""

import numpy as np

from airlight.validation.scenes.meshes import (
    Mesh,
    box,
    grid,
    icosphere,
    joined,
    placed,
    rotation,
    torus,
)

_TURN = rotation((0.3, 1.0, -0.2), 27.1)


def closed_sphere(levels: int = 2) -> Mesh:
    """Return a closed sphere of 20 * 4^levels triangles, 0.83 m wide."""
    vertices, faces = icosphere(levels)
    return placed((0.415 * vertices, faces), (0.13, -0.07, 0.19), _TURN)


def closed_box() -> Mesh:
    """Return a closed box of 12 triangles, two coplanar ones to a side."""
    return placed(box((0.61, 0.47, 0.83)), (-0.11, 0.17, 0.05), _TURN)


def closed_torus() -> Mesh:
    """Return a closed ring of genus 1: seen from near its plane its silhouette has
    folds and crosses itself.
    """
    return placed(torus(0.53, 0.19, (31, 17)), (0.07, 0.03, -0.13), _TURN)


def open_grid() -> Mesh:
    """Return a flat sheet of 2 * 5 * 4 triangles with a border of 18 edges."""
    vertices, faces = grid((-0.41, -0.37, 0.0), (0.83, 0, 0), (0, 0.71, 0), (5, 4))
    return placed((vertices, faces), (0.0, 0.0, 0.23), _TURN)


def open_cylinder(sides: int = 13) -> Mesh:
    """Return a tube without ends: two borders of `sides` edges."""
    angle = 2 * np.pi * np.arange(sides) / sides
    ring = np.stack([0.37 * np.cos(angle), 0.37 * np.sin(angle)], axis=1)
    vertices = np.concatenate([np.column_stack([ring, np.full(sides, z)]) for z in (-0.31, 0.43)])
    i = np.arange(sides)
    j = (i + 1) % sides
    faces = np.concatenate(
        [np.stack([i, j, sides + j], axis=1), np.stack([i, sides + j, sides + i], axis=1)]
    )
    return placed((vertices, faces), (0.05, 0.02, 0.09), _TURN)


def moebius_strip(steps: int = 24) -> Mesh:
    """Return a strip with half a twist: one border, and a seam of one edge that both its
    triangles run along alike.
    """
    angle = 2 * np.pi * np.arange(steps) / steps
    axis = np.stack([np.cos(angle), np.sin(angle), np.zeros(steps)], axis=1)
    across = np.cos(angle / 2)[:, None] * axis + np.sin(angle / 2)[:, None] * np.array(
        [0.0, 0.0, 1.0]
    )
    vertices = np.concatenate([0.59 * axis - 0.17 * across, 0.59 * axis + 0.17 * across])
    low, high = np.arange(steps), np.arange(steps) + steps
    # After one turn the two borders have changed places.
    next_low, next_high = np.append(low[1:], high[0]), np.append(high[1:], low[0])
    faces = np.concatenate(
        [np.stack([low, next_low, next_high], axis=1), np.stack([low, next_high, high], axis=1)]
    )
    return placed((vertices, faces), (0.0, 0.0, 0.0), _TURN)


def boxes_sharing_an_edge() -> Mesh:
    """Return two closed boxes that have one edge in common, at which four triangles meet."""
    corners, faces = box((1.0, 1.0, 1.0))
    # The edge from corner 3, (+, +, -), to corner 7, (+, +, +), is the other box's
    # from corner 0 to corner 4.
    other = np.array([3, 8, 9, 10, 7, 11, 12, 13])
    shifted = corners + np.array([1.0, 1.0, 0.0])
    vertices = np.concatenate([corners, np.delete(shifted, [0, 4], axis=0)])
    both = np.concatenate([faces, other[faces]])
    return placed((0.43 * vertices, both), (-0.09, -0.05, 0.03), _TURN)


def boxes_sharing_a_corner() -> Mesh:
    """Return two closed boxes that have one vertex in common and no edge."""
    corners, faces = box((1.0, 1.0, 1.0))
    other = np.array([7, *range(8, 15)])
    vertices = np.concatenate([corners, corners[1:] + 1.0])
    return placed(
        (0.41 * vertices, np.concatenate([faces, other[faces]])), (-0.07, 0.03, 0.01), _TURN
    )


def doubled_faces() -> Mesh:
    """Return a closed sphere whose first seven faces occur twice, the copies
    with their corners rotated.
    """
    vertices, faces = closed_sphere(1)
    return vertices, np.concatenate([faces, np.roll(faces[:7], 1, axis=1)])


def degenerate_faces() -> Mesh:
    """Return a closed box with a line for a triangle and a point for
    another: neither has an area.
    """
    vertices, faces = closed_box()
    return vertices, np.concatenate([faces, [[0, 1, 0], [5, 5, 5]]])


def sliver() -> Mesh:
    """Return a closed box one edge of which is split: a triangle of no area closes the
    gap between the two halves.
    """
    vertices, faces = box((0.61, 0.47, 0.83))
    a, b = faces[0][0], faces[0][1]
    middle = 0.5 * (vertices[a] + vertices[b])
    c, new = faces[0][2], len(vertices)
    split = np.array([[a, new, c], [new, b, c], [a, b, new]])
    return np.concatenate([vertices, [middle]]), np.concatenate([split, faces[1:]])


def inside_out() -> Mesh:
    """Return a closed sphere whose faces all run clockwise seen from outside."""
    vertices, faces = closed_sphere(2)
    return vertices, faces[:, ::-1].copy()


def mixed_winding() -> Mesh:
    """Return a closed sphere every fifth face of which is turned over."""
    vertices, faces = closed_sphere(2)
    faces = faces.copy()
    faces[::5] = faces[::5, ::-1]
    return vertices, faces


def crossing_spheres() -> Mesh:
    """Return two closed spheres that run into one another: each is sound, but no
    edge runs where they meet.
    """
    return joined(
        [
            closed_sphere(2),
            placed(closed_sphere(2), (0.37, 0.11, -0.07), rotation((1, 0.2, 0.5), 31.0)),
        ]
    )


def nested_spheres() -> Mesh:
    """Return a small closed sphere within a large one: shadow planes of
    the inner one do not count.
    """
    vertices, faces = closed_sphere(2)
    centre = vertices.mean(axis=0)
    return joined([(vertices, faces), (centre + 0.41 * (vertices - centre), faces)])


def flat_roof() -> tuple[Mesh, np.ndarray]:
    """Return a closed box whose top has 2 * 4 * 4 coplanar triangles, and a light
    that lies in their plane.

    The numbers are exact in binary, so that the light's height over the plane is exactly 0.
    """
    n = 4
    ticks = np.arange(n + 1) / n - 0.5
    x, y = (a.reshape(-1) for a in np.meshgrid(ticks, ticks, indexing="ij"))
    top = np.stack([x, y, np.full(len(x), 0.375)], axis=1)
    _, roof = grid((0, 0, 0), (1, 0, 0), (0, 1, 0), (n, n))
    edge = [k * (n + 1) for k in range(n)] + [n * (n + 1) + k for k in range(n)]
    edge += [k * (n + 1) + n for k in range(n, 0, -1)] + list(range(n, 0, -1))
    rim = np.array(edge)
    below = np.arange(len(rim)) + len(top)
    bottom = np.concatenate([top[rim] - (0, 0, 0.75), [[0.0, 0.0, -0.375]]])
    following, below_following = np.roll(rim, -1), np.roll(below, -1)
    centre = np.full(len(rim), len(top) + len(rim))
    faces = [
        roof,
        np.stack([below, below_following, following], axis=1),
        np.stack([below, following, rim], axis=1),
        np.stack([centre, below_following, below], axis=1),
    ]
    return (np.concatenate([top, bottom]), np.concatenate(faces)), np.array([1.75, 0.625, 0.375])


SOUND = {
    "sphere": closed_sphere,
    "box": closed_box,
    "torus": closed_torus,
    "crossing spheres": crossing_spheres,
    "nested spheres": nested_spheres,
    "flat roof": lambda: flat_roof()[0],
    "boxes sharing a corner": boxes_sharing_a_corner,
}
AWKWARD = {
    "open grid": open_grid,
    "open cylinder": open_cylinder,
    "Moebius strip": moebius_strip,
    "boxes sharing an edge": boxes_sharing_an_edge,
    "doubled faces": doubled_faces,
    "degenerate faces": degenerate_faces,
    "sliver": sliver,
    "inside out": inside_out,
    "mixed winding": mixed_winding,
}
ALL = SOUND | AWKWARD
