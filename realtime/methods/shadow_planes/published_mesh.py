# SPDX-License-Identifier: BSD-3-Clause
"""Gamma at the vertices of meshes, interpolated: the evaluation of the paper.

A shadow plane is meshed by rows of vertices on the two half lines that bound it, at the distances ratio^k times that of
the silhouette vertex from the light: finely near the light, coarsely far away, and undivided along the edge (Biri 2006,
section 5.1.5). Between the rows k and k + 1 the point (1 - t) u a + t u b, with a and b the ends of the edge, lies in a
quadrilateral that a graphics card draws as two triangles; in the coordinates p = (1 - t) u, q = t u their corners are

    (r_k, 0), (0, r_k), (r_k+1, 0)      and      (r_k+1, 0), (0, r_k), (0, r_k+1).

Beyond the last row Gamma keeps its value there. Surfaces interpolate Gamma between the vertices of their triangles
(5.1.3).
"""

import math

import drjit as dr
import mitsuba as mi

from realtime.kernels.registry import gamma
from realtime.methods.interface.view import View, radiance
from realtime.methods.shadow_planes.plane_table import PlaneIndex
from realtime.rays.ray_light import ray_geometry
from realtime.scene.lights import Light

RATIO = 1.5


def gamma_at(view: View, light: Light, point, *, kernel):
    """Return the radiance of Gamma from the camera to points [W/(m^2 sr)]."""
    offset = point - view.origin
    distance = dr.norm(offset)
    geometry = ray_geometry(view.origin, offset / distance, light)
    return radiance(view.medium, light, gamma(kernel, geometry, distance, medium=view.medium, light=light))


def mesh_gamma(view: View, index: PlaneIndex, light: Light, *, kernel, rows: int):
    """Return the function (plane, ray, x) that interpolates Gamma on the meshes of the planes."""
    Float, Vector = type(view.distance), type(view.direction)
    planes = dr.width(index.ends) // 6
    lane = dr.arange(mi.UInt32, planes * 2 * rows)
    row, end = lane % rows, lane // rows
    corner = Vector(*(dr.gather(Float, index.ends, end * 3 + k) for k in range(3))) * RATIO ** Float(row)
    point = light.position + index.x_axis * corner.x + index.y_axis * corner.y + index.z_axis * corner.z
    values = gamma_at(view, light, point, kernel=kernel)
    dr.eval(values)
    Color = type(values)

    def at(number, ray, x):
        a, b = ([dr.gather(Float, index.ends, (number * 2 + side) * 3 + k) for k in range(2)] for side in (0, 1))
        # The crossing (x wx, x wy) in the plane of the projections of a and b.
        cross = dr.fma(a[0], b[1], -a[1] * b[0])
        p = x * dr.fma(ray.x, b[1], -ray.y * b[0]) / cross
        q = x * dr.fma(a[0], ray.y, -a[1] * ray.x) / cross
        p, q = dr.maximum(p, 0), dr.maximum(q, 0)
        u = dr.clip(p + q, 1, RATIO ** (rows - 1))
        t = dr.clip(q / dr.maximum(p + q, 1e-30), 0, 1)
        cell = dr.minimum(mi.UInt32(dr.log(u) * (1 / math.log(RATIO))), rows - 2)
        near = RATIO ** Float(cell)
        far = RATIO * near
        p, q = u * (1 - t), u * t
        corner = [dr.gather(Color, values, (number * 2 + side) * rows + cell + k) for side in (0, 1) for k in (0, 1)]
        # Barycentric coordinates in the nearer triangle (a_k, b_k, a_k+1), else in (a_k+1, b_k, b_k+1).
        of_b = q / near
        of_a_far = (p - near * (1 - of_b)) / (far - near)
        nearer = corner[0] * (1 - of_b - of_a_far) + corner[2] * of_b + corner[1] * of_a_far
        of_a = p / far
        of_b_far = (q - near * (1 - of_a)) / (far - near)
        farther = corner[1] * of_a + corner[2] * (1 - of_a - of_b_far) + corner[3] * of_b_far
        return dr.select(p / far + q / near <= 1, nearer, farther)

    return at


def surface_gamma(view: View, light: Light, *, kernel, otherwise):
    """Return Gamma at the visible surface, interpolated between the vertices of its triangle.

    Parameters
    ----------
    view, light, kernel
        The frame, a light, a kernel.
    otherwise
        Gamma where no triangle is seen.
    """
    corners, weights, seen = view.visible_triangle()
    total = sum(
        dr.select(seen, weight, 0) * gamma_at(view, light, corner, kernel=kernel)
        for corner, weight in zip(corners, weights)
    )
    return dr.select(seen, total, otherwise)
