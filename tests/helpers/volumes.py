# SPDX-License-Identifier: BSD-3-Clause
"""Small closed meshes and cameras for the tests of light volumes."""

import drjit as dr
import mitsuba as mi
import numpy as np

from realtime.methods.light_volumes.published.mesh import VolumeMesh
from realtime.scene.camera import Camera, pixel_grid

WIDTH, HEIGHT = 11, 8


def make_camera(origin, target=(0.0, 0.0, 0.0), *, fov=50.0, size=(WIDTH, HEIGHT)):
    """Return a camera, in float64."""
    origin = np.asarray(origin, dtype=float)
    forward = np.asarray(target) - origin
    forward /= np.linalg.norm(forward)
    left = np.cross((0.137, 0.211, 1.0), forward)
    pixel = 2 * np.tan(0.5 * np.deg2rad(fov)) / size[0]
    left *= pixel / np.linalg.norm(left)
    vectors = (origin, forward, left, np.cross(forward, left))
    return opaque_camera(size, vectors)


def simple_camera():
    """Return a camera at the origin that looks along z and has the pixel (i, j) in the direction (5 - i, 4 - j, 1)."""
    return opaque_camera((11, 9), ((0, 0, 0), (0, 0, 1), (1, 0, 0), (0, 1, 0)))


def opaque_camera(size, vectors):
    """Return a camera of these vectors, in float64; all such cameras share their kernels, as the product's do."""
    arrays = [mi.Vector3d(*map(float, vector)) for vector in vectors]
    dr.make_opaque(arrays)
    return Camera(*size, arrays[0], tuple(arrays[1:]), grid=pixel_grid(*size))


def tetrahedron(points) -> VolumeMesh:
    """Return a tetrahedron with outward normals."""
    points = np.asarray(points, dtype=float)
    triangles = np.array([(0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)])
    outward = np.linalg.det(points[triangles]).sum() > 0
    return VolumeMesh(np.column_stack((points, np.ones(4))), triangles if outward else triangles[:, ::-1])


def light_pyramid(inverse, *, apex=(0.2, -0.1, 2.3), aim=(0.1, 0.3, -1.0)) -> VolumeMesh:
    """Return the volume of a spot: a grid displaced to the inverse depths given, joined to the light at its edges."""
    side = len(inverse)
    axis = np.asarray(aim) / np.linalg.norm(aim)
    across = np.cross((1.0, 0.0, 0.0), axis)
    across *= 0.6 / np.linalg.norm(across)
    up = np.cross(axis, across)
    u = np.linspace(-1, 1, side)
    direction = axis + u[None, :, None] * across + u[:, None, None] * up
    s = np.asarray(inverse, dtype=float)[..., None]
    vertices = np.concatenate((direction + s * np.asarray(apex), s), axis=2).reshape(-1, 4)
    number = np.arange(side * side).reshape(side, side)
    a, b, c, d = number[:-1, :-1], number[:-1, 1:], number[1:, :-1], number[1:, 1:]
    quads = [np.stack(three, axis=-1).reshape(-1, 3) for three in ((a, b, d), (a, d, c))]
    border = np.concatenate((number[0, :-1], number[:-1, -1], number[-1, :0:-1], number[:0:-1, 0]))
    ring = np.stack((np.roll(border, -1), border, np.full_like(border, side * side)), axis=1)
    # (across, up, axis) is right-handed: u to v turns towards the axis, away from the light.
    return VolumeMesh(np.vstack((vertices, (*apex, 1.0))), np.concatenate((*quads, ring)))
