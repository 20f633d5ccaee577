# SPDX-License-Identifier: BSD-3-Clause
"""Gamma at the vertices of meshes, interpolated: the evaluation of the paper.

A shadow plane is meshed by rows of vertices on the two half lines that bound it. The row k is
ratio^k times as far from the light as the silhouette vertex: finely near the light, coarsely far
away, and undivided along the edge (Biri 2006, section 5.1.5). Between the rows k and k + 1 the
point (1 - t) u a + t u b, with a and b the ends of the edge, lies in a quadrilateral that a
graphics card draws as two triangles; in the coordinates p = (1 - t) u, q = t u their corners are

    (r_k, 0), (0, r_k), (r_k+1, 0)      and      (r_k+1, 0), (0, r_k), (0, r_k+1).

Near the light Gamma falls as 1/u. Interpolated linearly between u and ratio u it is too large by up
to (ratio + 1)^2/(4 ratio) - 1, 4 % for 1.5, at whatever distance: this is why rows at equal ratios
are wise. The planes of a cone begin NEARNESS of the camera's distance from the light
(`realtime.methods.published.biri2006.planes`); by the same ratio they need
log(1/NEARNESS)/log(ratio) rows, 35, to come as far as the camera, and have so many more than the
planes of occluders.

Beyond the last row Gamma keeps its value there. Surfaces interpolate Gamma between the vertices of
their triangles (5.1.3).

**In bounded media**, medium by medium (Biri 2006, sections 4.2 and 5.2).

"When several participating media exist, stages 3 to 5 need to be computed for each one of them." In
the medium m, which a ray enters at A and leaves at F, with the end E at F or at the surface before
that,

    L_m = sum over lit [a, b] in [A, E] of Gamma_m(b) - Gamma_m(a),

where Gamma_m(P) integrates from the camera in the paper, with the exponent continued before A, and
Gamma_m(A) is subtracted where the ray enters (4.2). Before A the exponent grows, so that Gamma_m is
a multiple of the difference that is wanted, and so is the error of its interpolation. Here all
Gamma_m begin at A, and Gamma_m(A) is 0: without vertices and rounding that is the same. The passes
are

* stage 3: add Gamma_m(E) if E is lit; "the lit areas of objects and of the medium boundary";
* stages 4 and 5: the planes before E, and at A the bounds
  (`realtime.methods.published.biri2006.crossings`).

Gamma_m is evaluated at the vertices of planes and surfaces, each with the x_n of its own ray,
"computed on the fly". The ray of a vertex may miss the medium, and the paper does not say what x_n
is then. On a ray that touches a sphere, x_n is the foot of the sphere's middle: this foot is taken
for all rays that miss the medium, so that x_n is continuous. On the bounds, whose triangles must be
small, Gamma is evaluated at the point itself.

The exact form, ``media=exact``, has no Gamma beyond the medium: there it begins at A and keeps its
value from F on, with kinks at the bounds that no vertex knows of. Nodes that stand in for a
polynomial begin at A, too.

The transmittance between the medium and the camera is a factor of the ray; the
paper does not mention it.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import drjit as dr
import mitsuba as mi

from airlight.errors import InputError
from airlight.realtime.methods.interface.method import View
from airlight.realtime.methods.published.biri2006.crossings import Buffer, Entry, sum_crossings
from airlight.realtime.methods.published.biri2006.media import ConstantRays, gamma_in
from airlight.realtime.methods.published.biri2006.planes import NEARNESS, PaperPlanes
from airlight.realtime.methods.shadow_planes.sweep import RayPlanes
from airlight.realtime.rays import ray_geometry
from airlight.realtime.scene.lights import Light
from airlight.realtime.scene.media.bounded_rays import BoundedRays, Piece, camera_pieces
from airlight.realtime.scene.media.medium import Medium

RATIO = 1.5  #: of the distances of two rows from the light

#: Radiance of Gamma from the camera to points, as a function of them.
Gamma = Callable[[Any], Any]


def gamma_at(view: View, light: Light, point, *, kernel):
    """Return the radiance of Gamma from the camera to points [W/(m^2 sr)]."""
    offset = point - view.origin
    distance = dr.norm(offset)
    rays = view.medium.rays(view.origin, offset / distance)
    airlight = view.medium.lit(
        rays, light, ray_geometry(rays.origin, rays.direction, light), kernel
    )
    return airlight.radiance(airlight.gamma(distance))


def mesh_gamma(planes: PaperPlanes, light: Light, gamma: Gamma, *, rows: int, cone: bool = False):
    """Return the function (plane, ray, x) that interpolates Gamma on the meshes of the planes.

    `planes`, `light`, `gamma`: the planes of a light, and Gamma; `rows`: of each plane of an
    occluder; `cone`: whether planes of a cone are among them.
    """
    # Planes of a cone begin NEARNESS times as far from the light as the camera: they have as many
    # rows more as they need to come as far as the camera.
    further = math.ceil(-math.log(NEARNESS) / math.log(RATIO)) if cone else 0
    occluders_rows, rows = rows, rows + further
    index = planes.index
    Float, Vector = type(index.distance), type(light.position)
    # Gamma at all vertices: row by row of both ends of the edge of each plane. Rows that planes of
    # occluders do not have repeat their last one.
    lane = dr.arange(mi.UInt32, dr.width(planes.ends) // 6 * 2 * rows)
    row, end = lane % rows, lane // rows
    if further:
        row = dr.minimum(row, _last_row(planes, end // 2, occluders_rows, rows))
    corner = Vector(
        *(dr.gather(Float, planes.ends, end * 3 + k) for k in range(3))
    ) * RATIO ** Float(row)
    x_axis, y_axis, z_axis = (Vector(axis) for axis in index.axes)
    point = light.position + x_axis * corner.x + y_axis * corner.y + z_axis * corner.z
    values = gamma(point)
    dr.eval(values)
    Color = type(values)

    def at(number, ray, x):
        a, b = (
            [dr.gather(Float, planes.ends, (number * 2 + side) * 3 + k) for k in range(2)]
            for side in (0, 1)
        )
        # The crossing (x wx, x wy) in the plane of the projections of a and b.
        cross = dr.fma(a[0], b[1], -a[1] * b[0])
        p = x * dr.fma(ray.x, b[1], -ray.y * b[0]) / cross
        q = x * dr.fma(a[0], ray.y, -a[1] * ray.x) / cross
        # The point is (1 - t) u a + t u b. Rounding may bring it beside the plane; before the first
        # row and beyond the last one Gamma keeps its value there.
        p, q = dr.maximum(p, 0), dr.maximum(q, 0)
        u = dr.clip(p + q, 1, RATIO ** (rows - 1))
        if further:
            u = dr.minimum(u, RATIO ** Float(_last_row(planes, number, occluders_rows, rows)))
        t = dr.clip(q / dr.maximum(p + q, 1e-30), 0, 1)
        # The quadrilateral between the rows at near and far, and Gamma at its corners: a_k, a_k+1,
        # b_k, b_k+1.
        cell = dr.minimum(mi.UInt32(dr.log(u) * (1 / math.log(RATIO))), rows - 2)
        near = RATIO ** Float(cell)
        far = RATIO * near
        p, q = u * (1 - t), u * t
        corner = [
            dr.gather(Color, values, (number * 2 + side) * rows + cell + k)
            for side in (0, 1)
            for k in (0, 1)
        ]
        # Barycentric coordinates in the nearer triangle (a_k, b_k, a_k+1),
        # else in (a_k+1, b_k, b_k+1).
        of_b = q / near
        of_a_far = (p - near * (1 - of_b)) / (far - near)
        nearer = corner[0] * (1 - of_b - of_a_far) + corner[2] * of_b + corner[1] * of_a_far
        of_a = p / far
        of_b_far = (q - near * (1 - of_a)) / (far - near)
        farther = corner[1] * of_a + corner[2] * (1 - of_a - of_b_far) + corner[3] * of_b_far
        return dr.select(p / far + q / near <= 1, nearer, farther)

    return at


def _last_row(planes: PaperPlanes, plane, rows: int, rows_of_cone: int):
    """Return the last row of planes: planes of a cone begin where no occluder is."""
    # The first end of the edge says which: within 10 NEARNESS of the light there are rings alone.
    Float = type(planes.index.distance)
    first = [dr.gather(Float, planes.ends, plane * 6 + k) for k in range(3)]
    of_cone = sum(dr.square(part) for part in first) < dr.square(
        10 * NEARNESS * planes.index.distance
    )
    return dr.select(of_cone, mi.UInt32(rows_of_cone - 1), mi.UInt32(rows - 1))


def surface_gamma(triangle, gamma: Gamma, otherwise):
    """Return Gamma at visible triangles, interpolated between their vertices; `otherwise`
    where no triangle is visible.
    """
    corners, weights, hits = triangle
    total = sum(
        dr.select(hits, weight, 0) * gamma(corner) for corner, weight in zip(corners, weights)
    )
    return dr.select(hits, total, otherwise)


def visible_triangle(view: View):
    """Return the triangles that the rays of a view hit first.

    Returns `corners`: three positions [m]; `weights`: barycentric coordinates of the hit in them;
    `hits`: whether a triangle is hit.
    """
    # A sphere or the sky has no triangle: those lanes read no mesh.
    ray = mi.Ray3f(mi.Point3f(view.origin), mi.Vector3f(view.direction))
    hit = view.scene.ray_intersect_preliminary(ray, coherent=True)
    mesh = mi.MeshPtr(hit.shape)
    hits = hit.is_valid() & hit.shape.is_mesh()
    mesh = dr.select(hits, mesh, dr.zeros(mi.MeshPtr))
    face = mesh.face_indices(hit.prim_index, hits)
    corners = [
        type(view.direction)(mesh.vertex_position(vertex, hits))
        for vertex in (face.x, face.y, face.z)
    ]
    Float = type(view.direction.x)
    u, v = Float(hit.prim_uv.x), Float(hit.prim_uv.y)
    return corners, (1 - u - v, u, v), hits


def check_vertices(medium: Medium, lights: Sequence[Light]) -> None:
    """Refuse bounded media whose Gamma no vertices can have, and lights without a place: rows of
    vertices are counted from a light.

    Raises InputError for a medium around bounded ones, and for a directional light.
    """
    around = medium.bounded_media and not medium.clear
    if around or not all(light.w for light in lights):
        raise InputError(
            "evaluation=vertex: needs lights that have a place, and vacuum around bounded media; "
            "use evaluation=pixel"
        )


def sum_in_media(
    view: View,
    media: BoundedRays,
    planes: PaperPlanes,
    rays: RayPlanes,
    *,
    rows: int,
    cone: bool,
    order: str,
    buffer: Buffer | None,
    start,
):
    """Return the radiance of one light in all bounded media, with Gamma at vertices [W/(m^2 sr)].

    `view`, `media`: the frame, and its rays in the media, with the light; `planes`, `rays`: the
    planes and the rays; `rows`, `cone`: see `realtime.methods.published.biri2006.mesh.mesh_gamma`;
    `order`, `buffer`: see `realtime.methods.published.biri2006.crossings.sum_crossings`; `start`:
    the content of the buffer before, or 0.
    """
    triangle = visible_triangle(view)
    Color, total = type(view.medium.albedo), start
    for number in range(len(view.medium.bounded_media)):
        # The ray enters at A and ends at E, at the exit or at the surface before that; a ray that
        # misses the medium has both at 0, and no light.
        piece = media.pieces[number]
        end = dr.minimum(piece.end, view.distance)
        meets = dr.isfinite(piece.begin) & (end > piece.begin)
        begin, end = dr.select(meets, piece.begin, 0), dr.select(meets, end, 0)
        # The transmittance between the medium and the camera.
        factor = dr.select(
            meets, Color(*(dr.exp(-dr.select(meets, depth, 0)) for depth in piece.before)), 0
        )
        in_medium = replace(media, pieces=(_alone(media, piece, begin),))

        # Gamma_m at a point of the ray itself: on the bounds.
        def at(x, in_medium=in_medium, factor=factor, meets=meets):
            return dr.select(meets, factor * in_medium.radiance(gamma_in(in_medium, x)), 0)

        def at_vertex(point, number=number):
            return _vertex_gamma(view, media, number, point)

        # Stages 4 and 5: Gamma_m on the planes, between their vertices.
        on_planes = mesh_gamma(planes, media.light, at_vertex, rows=rows, cone=cone)

        def at_plane(plane, ray, x, on_planes=on_planes, factor=factor):
            return factor * on_planes(plane, ray, x)

        # Stage 3: at the surface, between the vertices of its triangle; at the exit, at the point.
        def at_end(x, at=at, at_vertex=at_vertex, piece=piece, factor=factor):
            exit_gamma = at(x)
            surface = surface_gamma(triangle, at_vertex, exit_gamma)
            on_triangle = triangle[2] & (view.distance < piece.end)
            return dr.select(on_triangle, factor * surface, exit_gamma)

        entry = Entry(begin, at(begin))
        gammas = at_plane, at_end
        total, _ = sum_crossings(
            planes, rays, end, gammas, order=order, buffer=buffer, start=total, entry=entry
        )
    return total


def _alone(media: BoundedRays, piece: Piece, begin) -> Piece:
    """Return a piece with vacuum before it; the published forms continue it without end."""
    no_depth = tuple(type(begin)(0) for _ in piece.before)
    end = piece.end if not isinstance(media, ConstantRays) else type(begin)(dr.inf)
    return replace(piece, begin=begin, end=end, before=no_depth)


def _vertex_gamma(view: View, media: BoundedRays, number: int, point) -> Any:
    """Return the radiance of Gamma of one medium up to points [W/(m^2 sr)]."""
    offset = point - view.origin
    distance = dr.norm(offset)
    direction = offset / distance
    rays = view.medium.rays(view.origin, direction)
    piece = camera_pieces(view.medium, rays)[number]
    # A ray that misses the medium has the foot of the medium's middle for x_n.
    begin = piece.begin
    if isinstance(media, ConstantRays):
        toward = view.medium.bounded_media[number].centre - view.origin
        begin = dr.select(dr.isfinite(begin), begin, dr.maximum(dr.dot(toward, direction), 0))
    geometry = ray_geometry(view.origin, direction, media.light)
    alone = _alone(media, piece, begin)
    in_medium = replace(media, rays=rays, geometry=geometry, pieces=(alone,))
    return in_medium.radiance(gamma_in(in_medium, distance))
