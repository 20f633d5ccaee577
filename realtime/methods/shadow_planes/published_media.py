# SPDX-License-Identifier: BSD-3-Clause
"""Shadow planes in bounded media, medium by medium, with Gamma at vertices (Biri 2006, sections 4.2 and 5.2).

"When several participating media exist, stages 3 to 5 need to be computed for each one of them." In the medium m, which
a ray enters at A and leaves at F, with the end E at F or at the surface before that,

    L_m = sum over lit [a, b] in [A, E] of Gamma_m(b) - Gamma_m(a),

where Gamma_m(P) integrates from the camera in the paper, with the exponent continued before A, and Gamma_m(A) is
subtracted where the ray enters (4.2). Before A the exponent grows, so that Gamma_m is a multiple of what is to be left
of it, and so is the error of its interpolation. Here all Gamma_m begin at A, and Gamma_m(A) is 0: without vertices and
rounding that is the same. The passes are

* stage 3: add Gamma_m(E) if E is lit; "the lit areas of objects and of the medium boundary";
* stages 4 and 5: the planes before E, and at A the bounds (`realtime.methods.shadow_planes.published_crossings`).

Gamma_m is evaluated at the vertices of planes and surfaces, each with the x_n of its own ray, "computed on the fly".
The ray of a vertex may miss the medium. The paper does not say what x_n is then; for a sphere x_n is the foot of its
middle on a ray that touches it, so this is taken, which is continuous there. On the bounds, whose triangles must be
small, Gamma is that of the point itself.

The exact form, ``media=exact``, has no Gamma beyond the medium: there it begins at A and keeps its value from F on,
with kinks at the bounds that no vertex knows of. Nodes that stand in for a polynomial begin at A, too.

The transmittance between the medium and the camera is a factor of the ray; the paper does not mention it.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import drjit as dr

from realtime.errors import InputError
from realtime.methods.interface.method import View
from realtime.methods.shadow_planes.plane_table import PlaneIndex
from realtime.methods.shadow_planes.published_crossings import Buffer, Entry, sum_crossings
from realtime.methods.shadow_planes.published_mesh import mesh_gamma, surface_gamma, visible_triangle
from realtime.methods.shadow_planes.sweep import RayPlanes
from realtime.rays import ray_geometry
from realtime.scene.lights import Light
from realtime.scene.media.bounded_rays import BoundedRays, Piece, camera_pieces
from realtime.scene.media.medium import Medium


def check_vertices(medium: Medium, lights: Sequence[Light]) -> None:
    """Refuse bounded media whose Gamma no vertices can have.

    Raises InputError for a medium around them, and for a directional light.
    """
    if not medium.clear or not all(light.w for light in lights):
        raise InputError(
            "evaluation=vertex: wanted bounded media in vacuum, and lights that have a place; use evaluation=pixel"
        )


def sum_in_media(
    view: View,
    media: BoundedRays,
    index: PlaneIndex,
    rays: RayPlanes,
    *,
    rows: int,
    cone: bool,
    order: str,
    buffer: Buffer | None,
    start,
):
    """Return the radiance of one light in all bounded media, with Gamma at vertices [W/(m^2 sr)].

    `view`, `media`: the frame, and its rays in the media, with the light; `index`, `rays`: the planes and the rays;
    `rows`, `cone`: see `realtime.methods.shadow_planes.published_mesh.mesh_gamma`; `order`, `buffer`: see
    `realtime.methods.shadow_planes.published_crossings.sum_crossings`; `start`: what is in the buffer before, or 0.
    """
    triangle = visible_triangle(view)
    Color, total = type(view.medium.albedo), start
    for number in range(len(view.medium.bounded_media)):
        piece = media.pieces[number]
        end = dr.minimum(piece.end, view.distance)
        meets = dr.isfinite(piece.begin) & (end > piece.begin)
        begin, end = dr.select(meets, piece.begin, 0), dr.select(meets, end, 0)
        factor = dr.select(meets, Color(*(dr.exp(-dr.select(meets, depth, 0)) for depth in piece.before)), 0)
        own = replace(media, pieces=(_alone(media, piece, begin),))

        def at(x, own=own, factor=factor, meets=meets):
            return dr.select(meets, factor * own.radiance(own.published_gamma(x)), 0)

        def at_vertex(point, number=number):
            return _vertex_gamma(view, media, number, point)

        on_planes = mesh_gamma(index, media.light, at_vertex, rows=rows, cone=cone)

        def at_plane(plane, ray, x, on_planes=on_planes, factor=factor):
            return factor * on_planes(plane, ray, x)

        def at_end(x, at=at, at_vertex=at_vertex, piece=piece, factor=factor):
            exit_gamma = at(x)
            surface = surface_gamma(triangle, at_vertex, exit_gamma)
            on_triangle = triangle[2] & (view.distance < piece.end)
            return dr.select(on_triangle, factor * surface, exit_gamma)

        entry = Entry(begin, at(begin))
        gammas = at_plane, at_end
        total, _ = sum_crossings(index, rays, end, gammas, order=order, buffer=buffer, start=total, entry=entry)
    return total


def _alone(media: BoundedRays, piece: Piece, begin) -> Piece:
    """Return a piece without what absorbs before it; the published forms continue it without end."""
    none = tuple(type(begin)(0) for _ in piece.before)
    end = piece.end if media.form == "exact" else type(begin)(dr.inf)
    return replace(piece, begin=begin, end=end, before=none)


def _vertex_gamma(view: View, media: BoundedRays, number: int, point) -> Any:
    """Return the radiance of Gamma of one medium up to points [W/(m^2 sr)]."""
    offset = point - view.origin
    distance = dr.norm(offset)
    direction = offset / distance
    rays = view.medium.rays(view.origin, direction)
    piece = camera_pieces(view.medium, rays)[number]
    begin = piece.begin
    if media.form != "exact":
        toward = view.medium.bounded_media[number].centre - view.origin
        begin = dr.select(dr.isfinite(begin), begin, dr.maximum(dr.dot(toward, direction), 0))
    geometry = ray_geometry(view.origin, direction, media.light)
    own = replace(media, rays=rays, geometry=geometry, pieces=(_alone(media, piece, begin),))
    return own.radiance(own.published_gamma(distance))
