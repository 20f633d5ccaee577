# SPDX-License-Identifier: BSD-3-Clause
"""Places that a light reaches: nodes on lit parts of camera rays, and visible surface points.

On a piece of a ray in one medium, with w = asinh((x - foot)/height),

    dx / r^2 = dw / (height cosh w),      r = height cosh w,

and everything in the integrand of the airlight has its singularities at |Im w| >= pi/2, whatever
the phase function (`reference.quadrature.homogeneous` says why). With half a panel of the width 1.2
the ellipse of regularity has rho = 1.31 + sqrt(1 + 1.31^2) = 2.96, so eight Gauss-Legendre nodes
err by about rho^-16 = 3e-8, and four nodes on a panel of the width 0.6 (rho = 10.6) by 6e-9. The
extinction adds exp(-sigma_t height e^w), entire in w. Only a panel over which this factor falls by
many orders is hard, and the light beyond such a panel is small.

The path from a directional light is unbounded, so that only media with bounds attenuate it; between
the kinks of its lengths (`reference.quadrature.intervals`) the integrand is an exponential of a
linear function, and eight nodes are exact to rounding over up to four optical depths.

In height fog pieces end where the density has kinks too, and panels span four scale heights at
most, two under a directional light: over these the density changes smoothly. A light path out of
the fog has the length 0 here, as in homogeneous fog; its optical depth is the depth of a column,
which the fog knows.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from airlight.analytic.panels import equal_panels
from airlight.reference.quadrature.height_fog import fog_of
from airlight.reference.quadrature.homogeneous import by_medium, smooth_pieces
from airlight.reference.quadrature.integrate import profile_of
from airlight.reference.quadrature.intervals import (
    Pieces,
    Stretches,
    camera_segments,
    clipped,
    cut,
    cut_at,
    lit_stretches,
    whole,
)
from airlight.reference.quadrature.light_airlight import LitRays, sun_stretches
from airlight.reference.scene.directional_light import DirectionalLight
from airlight.reference.scene.point_light import ReferenceLight
from airlight.reference.scene.read import ReferenceScene
from airlight.reference.scene.varying import HeightMedium
from airlight.reference.visibility.distances import crossings
from airlight.reference.visibility.planes import falloff, rays_at
from airlight.validation.arrays import Array, Bools, Index

AROUND = 0  #: number of the medium without bounds; the media with bounds count on from there

# Widest panel, and widest interval that few nodes serve: in w before a light at a place, in optical
# depths of the scene's own extinction before a directional light.
_PANEL, _SHORT = 2.4, 0.6
_DEEP, _SHALLOW = 4.0, 0.5
_MOST = 64  # panels of a piece
# nodes on a panel and on a short one: of a light, of a sample of an area light
_OF_ONE, _OF_MANY = (8, 4), (4, 2)


@dataclass(frozen=True)
class Places:
    """Places that a light reaches, of intensity 1; (n,) unless it says otherwise."""

    ray: Index  #: number of the ray
    x: Array  #: distance from the camera [m]
    r: Array  #: distance from the light [m]; 1 for a directional light
    towards: Array  #: unit vector from the light to the place, (n, 3); 0 for a directional light
    camera: Array  #: length in each medium between camera and place, (n, media) [m]
    light: Array  #: length in each medium between light and place, (n, media) [m]
    medium: Index  #: number of the medium that scatters there; of surfaces nothing, (0,)
    cosine: Array  #: of the scattering angle; of surfaces nothing, (0,)
    #: For a node, the length of ray that it stands for times the profile of the light, (n, 1) [m];
    #: for a surface, the radiance to the camera without attenuation, (n, 3) [W/(m^2 sr)].
    value: Array

    @staticmethod
    def joined(parts: "Sequence[Places]") -> "Places":
        """Join places of several lights, or of several samples of one."""
        return Places(
            *(np.concatenate([getattr(part, f.name) for part in parts]) for f in fields(Places))
        )

    @property
    def is_surface(self) -> bool:
        """Whether these are surface points."""
        return self.value.shape[1] == 3


def no_places(media: int, *, surface: bool) -> Places:
    """Return an empty record, for lights that reach nothing."""
    none, empty, vectors, lengths = (
        np.empty(0, np.int64),
        np.empty(0),
        np.empty((0, 3)),
        np.empty((0, media)),
    )
    return Places(
        none,
        empty,
        empty,
        vectors,
        lengths,
        lengths,
        none,
        empty,
        np.empty((0, 3 if surface else 1)),
    )


def point_nodes(
    reference: ReferenceScene,
    light: ReferenceLight,
    reach: LitRays,
    ends: tuple[Array, Array] | None = None,
    corners: Sequence[float] = (),
) -> Places:
    """Return the nodes of a point or spot light, or of a sample of an area light.

    `reach`: which parts of the rays it reaches; `ends`: distances between which rays have nodes,
    (rays,) each [m]; all by default; `corners`: distances from the light at which panels end [m].
    """
    # Lit stretches are cut where the medium changes, so that a piece lies in one medium.
    rays = reach.rays
    stretches = clipped(lit_stretches(light, rays, reach.lit), *(ends or ()))
    for distance in corners:
        stretches = cut_at(rays, stretches, distance)
    if reference.media:
        pieces = smooth_pieces(
            reference, rays, camera_segments(reference, reach.distance), stretches
        )
    else:
        pieces = _unbounded(reference, stretches, light.position)
    # The reference counts media with bounds from 0 and calls what surrounds them -1.
    ray, x0, x1, medium = pieces.ray, pieces.x0, pieces.x1, pieces.medium + 1
    # `foot_gap` is the distance between a piece and the foot point of the light, 0 where the piece
    # contains it.
    foot, s0, s1 = rays.foot[ray], x0 - rays.foot[ray], x1 - rays.foot[ray]
    foot_gap = np.where(s0 > 0, s0, np.where(s1 < 0, -s1, 0.0))
    # A height of 0 has no w. A light beside a piece may as well be 1e-15 of its distance above the
    # ray; a ray below 1e-290 m meets the light.
    height = np.maximum(rays.height[ray], np.maximum(1e-15 * foot_gap, 1e-290))
    start = np.arcsinh(s0 / height)
    width = np.arcsinh(s1 / height) - start
    if isinstance(reference.medium, HeightMedium):
        # In height fog the integrand has to be smooth in w and in the density: pieces become panels
        # in w first, and then parts of panels that span four of the least scale heights at most.
        piece, start, width = equal_panels(
            np.arange(len(ray)), start, width, np.maximum(np.ceil(width / _PANEL), 1)
        )
        low, high = (foot[piece] + height[piece] * np.sinh(w) for w in (start, start + width))
        span = _scale_heights(reference.medium, *_heights(reference, ray[piece], low, high)) / 4.0
        number, start, width = equal_panels(
            np.arange(len(piece)), start, width, np.clip(np.ceil(span), 1, _MOST)
        )
        piece = piece[number]
        ray, foot, height, medium = ray[piece], foot[piece], height[piece], medium[piece]
    # A light whose profile is a cosine is one of many samples of an area light.
    orders = _OF_MANY if light.cosine else _OF_ONE
    owner, w, weight = panel_nodes(start, width, orders=orders)
    # tanh w is the cosine of the angle between light path and ray, and minus that of scattering;
    # a node stands for the length of ray dx = height cosh w dw = r dw.
    ray, foot, height = ray[owner], foot[owner], height[owner]
    sine, r = np.tanh(w), height * np.cosh(w)
    x = foot + height * np.sinh(w)
    direction, normal = rays.direction[ray], rays.normal[ray]
    along = profile_of(light, rays)
    profile = 1.0 if along is None else along(x[:, None], ray)[:, 0]
    towards = sine[:, None] * direction + (1 / np.cosh(w))[:, None] * normal
    camera, segment = (
        lengths(reference, reference.origin, direction, x),
        lengths(reference, light.position, towards, r),
    )
    return Places(
        ray, x, r, towards, camera, segment, medium[owner], -sine, (weight * r * profile)[:, None]
    )


def parallel_nodes(
    reference: ReferenceScene,
    light: DirectionalLight,
    reach: LitRays,
    ends: tuple[Array, Array] | None = None,
) -> Places:
    """Return the nodes of a directional light on the lit parts of all rays, see `point_nodes`."""
    rays = reach.rays
    stretches = clipped(sun_stretches(reference, reach), *(ends or ()))
    if isinstance(reference.medium, HeightMedium):
        pieces, depth = _before_sun(reference, light, stretches)
    else:
        pieces = smooth_pieces(
            reference, rays, camera_segments(reference, reach.distance), stretches
        )
        # The first piece of every long stretch is halved towards its beginning: what is left of the
        # light beyond four depths falls over further and further lengths.
        sigma_t = max(
            float(medium.sigma_t.max()) for medium in (reference.medium, *reference.media)
        )
        while np.any(long := pieces.first & ((pieces.x1 - pieces.x0) * sigma_t > _DEEP)):
            pieces = cut(pieces, (pieces.ray[long], 0.5 * (pieces.x0 + pieces.x1)[long]))
        depth = (pieces.x1 - pieces.x0) * by_medium(reference, "sigma_t", pieces.medium).max(axis=1)
    # The depth of a piece says how many panels it has; in x these panels are equally long.
    width, depth = pieces.x1 - pieces.x0, np.maximum(depth, 1e-300)
    owner, place, weight = panel_nodes(np.zeros(len(width)), depth, most=_DEEP, short=_SHALLOW)
    place, weight, ray = place / depth[owner], weight / depth[owner], pieces.ray[owner]
    x, direction = pieces.x0[owner] + width[owner] * place, reference.direction[ray]
    point, unbounded = reference.origin + x[:, None] * direction, np.full(len(x), np.inf)
    # The light path goes from the node against the light without end; a distance of 1 and no
    # direction from the light stand in the record for what a directional light does not have.
    segment = lengths(reference, point, np.broadcast_to(-light.direction, point.shape), unbounded)
    camera, medium = lengths(reference, reference.origin, direction, x), pieces.medium[owner] + 1
    value = (weight * width[owner])[:, None]
    return Places(
        ray, x, np.ones_like(x), 0 * direction, camera, segment, medium, rays.foot[ray], value
    )


def surface_points(
    reference: ReferenceScene,
    light: ReferenceLight | DirectionalLight,
    distance: Array,
    reflected: Array,
    lit: Bools,
) -> Places:
    """Return the visible surface points that a light reaches: L = f(w_i, w_o) cos I profile / r^2.

    `distance`: of the surfaces along the rays, (rays,) [m]; `reflected`: f cos, (rays, 3) [1/sr];
    `lit`: which of them the light reaches, (rays,).
    """
    # Points that reflect nothing towards the camera cost paths and add nothing.
    ray = np.flatnonzero(lit & np.any(reflected > 0, axis=1))
    direction, x = reference.direction[ray], distance[ray]
    point = reference.origin + x[:, None] * direction
    if isinstance(light, DirectionalLight):
        # Irradiance does not fall with the distance, which is 1 by convention.
        r, towards, value = np.ones(len(ray)), np.zeros_like(point), reflected[ray]
        way = np.broadcast_to(-light.direction, point.shape)
        segment = lengths(reference, point, way, np.full(len(ray), np.inf))
    else:
        # A surface that touches the light has no direction from it; `tiny` keeps the vector finite.
        way = point - light.position
        r = np.maximum(np.linalg.norm(way, axis=1), np.finfo(float).tiny)
        towards = way / r[:, None]
        segment = lengths(reference, light.position, towards, r)
        value = reflected[ray] * (_profile(light, towards) / r**2)[:, None]
    camera, none = lengths(reference, reference.origin, direction, x), np.empty(0)
    return Places(ray, x, r, towards, camera, segment, none.astype(np.int64), none, value)


def panel_nodes(
    start: Array,
    width: Array,
    *,
    most: float = _PANEL,
    short: float = _SHORT,
    orders: tuple[int, int] = _OF_ONE,
) -> tuple[Index, Array, Array]:
    """Return Gauss-Legendre nodes on intervals.

    `start`, `width`: of the intervals, (n,), in any variable; `most`, `short`: widest panel, and
    the widest interval that few nodes serve; `orders`: how many nodes a panel has, and how many are
    few.

    Returns
    -------
    owner, place, weight
        Number of the interval, variable and weight of each node, (nodes,) each; sorted by interval.
    """
    # Short intervals first, then all others: `chosen` are the numbers of the intervals of either
    # kind. Both orders of nodes are in the result.
    few = width <= short
    owners, places, weights = [], [], []
    for chosen, order in ((np.flatnonzero(few), orders[1]), (np.flatnonzero(~few), orders[0])):
        count = np.maximum(np.ceil(width[chosen] / most), 1)
        owner, begin, size = equal_panels(chosen, start[chosen], width[chosen], count)
        node, weight = np.polynomial.legendre.leggauss(order)
        owners.append(np.repeat(owner, order))
        places.append((begin[:, None] + 0.5 * size[:, None] * (1 + node)).ravel())
        weights.append((0.5 * size[:, None] * weight).ravel())
    # A stable order keeps the nodes of an interval ascending.
    owner = np.concatenate(owners)
    by_owner = np.argsort(owner, kind="stable")
    return owner[by_owner], np.concatenate(places)[by_owner], np.concatenate(weights)[by_owner]


def lengths(reference: ReferenceScene, origin: Array, direction: Array, reach: Array) -> Array:
    """Return the length of straight lines in each medium, the medium without bounds first,
    (n, media) [m].

    `origin`, `direction`: of the lines, (3,) or (n, 3) [m], and (n, 3); `reach`: how long they are,
    (n,) [m]; for an unbounded line the length in the medium without bounds is given as 0.
    """
    # The medium without bounds has what the media with bounds leave of the line.
    inside = []
    for medium in reference.media:
        enter, leave = crossings(medium.bounds, origin, direction)
        inside.append(np.maximum(np.minimum(leave, reach) - np.maximum(enter, 0.0), 0.0))
    around = np.where(np.isfinite(reach), reach, 0.0) - sum(inside)
    # For an unbounded line the rest is negative, and 0 by the same maximum.
    return np.stack([np.maximum(around, 0.0), *inside], axis=1)


def _unbounded(reference: ReferenceScene, stretches: Stretches, place: Array) -> Pieces:
    """Return lit stretches in a medium without bounds, cut at the heights at which the density
    of height fog has kinks.

    `place`: an unbounded ray is followed from its foot point from there until little light is left.
    """
    # `sigma_t` [1/m] decides how far an unbounded ray is followed: in height fog the largest
    # density at the heights of light, camera and bases of layers; elsewhere the extinction itself.
    medium, (ray, x0, x1), direction = reference.medium, stretches, reference.direction
    kinks = np.empty(0, np.int64), np.empty(0)
    if not isinstance(medium, HeightMedium):
        sigma_t = medium.sigma_t
    else:
        fog, up = fog_of(medium), medium.up
        heights: list[float] = [
            float(place @ up),
            float(reference.origin @ up),
            *(layer.base for layer in fog.layers),
        ]
        sigma_t = np.array([fog.density(np.clip(heights, fog.floor, fog.cap)).max()])
        # Where rays pass the heights of kinks: a horizontal ray never does, and divides by 0.
        with np.errstate(divide="ignore", invalid="ignore"):
            x = (np.array(fog.kinks)[:, None] - reference.origin @ up) / (direction @ up)
        number, row = np.nonzero(np.isfinite(x) & (x > 0))
        kinks = row, x[number, row]
    # After the optical depth 40, e^-40 = 4e-18 of the light is left. The fog that is tried may be
    # thinner than the scene's: rays are long enough down to a thirtieth of its extinction. Where
    # the scene's own equation attenuates less, they are longer, up to a million times.
    least = 1 / 30 * np.clip(reference.model.camera_scale, 1e-6, 1.0)
    far = 40.0 / (least * sigma_t[sigma_t > 0].min()) if np.any(sigma_t > 0) else 0.0
    foot = np.sum((place - reference.origin) * direction[ray], axis=1)
    pieces = whole((ray, x0, np.where(np.isinf(x1), np.maximum(x0, foot) + far, x1)))
    return cut(pieces, kinks) if len(ray) and len(kinks[0]) else pieces


def _heights(reference: ReferenceScene, ray: Index, *distances: Array) -> list[Array]:
    """Return the heights at distances along rays [m]."""
    assert isinstance(reference.medium, HeightMedium)
    up = reference.medium.up
    start, rise = reference.origin @ up, reference.direction[ray] @ up
    return [start + x * rise for x in distances]


def _scale_heights(medium: HeightMedium, low: Array, high: Array) -> Array:
    """Return how many of the least scale height lie between two heights, in the fog [1]."""
    least = min((scale_height for *_, scale_height in medium.layers), default=np.inf)
    low, high = (np.clip(z, medium.floor, medium.cap) for z in (low, high))
    return np.asarray(np.abs(high - low) / least)


def _before_sun(
    reference: ReferenceScene, light: DirectionalLight, stretches: Stretches
) -> tuple[Pieces, Array]:
    """Return pieces of lit stretches in height fog, and how long each is in
    optical depths and in height.
    """
    medium = reference.medium
    assert isinstance(medium, HeightMedium)
    # `mu` is the sine of the light's height over the horizon.
    fog, mu = fog_of(medium), float(-light.direction @ medium.up)
    pieces = _unbounded(reference, stretches, reference.origin)
    # The first piece of every stretch is halved towards its beginning eight times: dense fog ends
    # within the first part.
    for _ in range(8):
        first = pieces.first
        middle = 0.5 * (pieces.x0 + pieces.x1)[first]
        pieces = cut(pieces, (pieces.ray[first], middle))
    # Pieces above or below the fog have no density and need no nodes.
    (middle,) = _heights(reference, pieces.ray, 0.5 * (pieces.x0 + pieces.x1))
    pieces = pieces[np.isfinite(fog.log_density(middle))]
    low, high = _heights(reference, pieces.ray, pieces.x0, pieces.x1)
    # Where the ray climbs by dz, the light path to it changes by dz/mu: the exponent of a node
    # changes with the depth of both paths. A panel of four depths spans two scale heights at most.
    # (An equation without light paths may have a sun below the horizon.)
    steep = 1 + np.abs(reference.direction[pieces.ray] @ medium.up) / mu if mu > 0 else 1.0
    depth = steep * fog.optical_depth(low, high, pieces.x1 - pieces.x0)
    return pieces, np.minimum(
        np.maximum(depth, 2 * _scale_heights(medium, low, high)), _MOST * _DEEP
    )


def _profile(light: ReferenceLight, direction: Array) -> Array:
    """Return the profile of a light in directions away from it, (n,): on a ray
    along each, straight ahead.
    """
    if light.axis is None:
        return np.ones(len(direction))
    # The fall-off of a spot is a function of the angle along a ray. A ray from the light along the
    # direction itself has its points at the angle pi/2.
    inside = np.arccos(np.clip(direction @ light.axis, -1.0, 1.0)) <= light.cutoff
    straight = np.full((len(direction), 1), 0.5 * np.pi)
    return (
        inside * falloff(straight, rays_at(light.position, direction, light.position), light)[:, 0]
    )
