# SPDX-License-Identifier: BSD-3-Clause
"""The rays of some pixels, their lit intervals, and from both all
single-scattering paths of a scene.

The lit intervals depend on the place of a light and on the width of its cone. They do not depend on
its fall-off, the fog or the values: a view finds them once.
"""

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeVar, cast

import mitsuba as mi
import numpy as np
from scipy.spatial.transform import Rotation

from airlight.reference.quadrature.light_airlight import LitRays, lit_rays
from airlight.reference.quadrature.replicates import PointPlan, square_points
from airlight.reference.quadrature.shared_samples import shared_samples
from airlight.reference.quadrature.surface import surface_hits
from airlight.reference.scene.area_light import ReferenceAreaLight, is_area
from airlight.reference.scene.camera import camera_matrix, film_directions, pixel_centres
from airlight.reference.scene.device import as_rows, on_device, vectors
from airlight.reference.scene.directional_light import DirectionalLight, is_directional
from airlight.reference.scene.point_light import ReferenceLight
from airlight.reference.scene.read import ReferenceScene
from airlight.reference.scene.shapes import Shapes, read_shapes
from airlight.reference.scene.varying import HeightMedium
from airlight.reference.visibility.candidates import Ball
from airlight.reference.visibility.certificate import LitIntervals
from airlight.reference.visibility.distances import exact_distance
from airlight.reference.visibility.lit_intervals import before_light, obstacles
from airlight.validation.arrays import Array, Bools, Index
from airlight.validation.fog_model.places import (
    Places,
    lengths,
    no_places,
    parallel_nodes,
    point_nodes,
    surface_points,
)

Light = ReferenceLight | DirectionalLight
Value = TypeVar("Value")

SAMPLES = 16  #: of an area light


@dataclass(frozen=True)
class Ends:
    """Where the nodes of rays begin and end."""

    near: float = 0.0  #: before it there are none [m]
    far: float = np.inf  #: beyond it there are none [m]
    spherical: bool = False  #: whether both are distances from the camera, not planes before it
    #: 'ends': at the depth of the surface, taken for a distance; 'lookup': where the depth is the
    #: distance of the surface; '' at the surface
    end: str = ""
    faded: float = np.inf  #: depth beyond which there are none [m]
    corners: tuple[float, ...] = ()  #: distances from lamps at which nodes are parted [m]
    part: float = 1.0  #: of the distance of surfaces at which rays end [1]


@dataclass(frozen=True)
class Scenery:
    """The properties of a scene that decide the paths of light, besides its own; each
    combination has its own paths.
    """

    shadows: bool = True
    unshadowed: tuple[int, ...] = ()  #: numbers of lights of which nothing casts a shadow
    offset: tuple[float, float] = (0.0, 0.0)  #: shift of all rays, to the right and down [pixels]
    zoom: float = 1.0  #: factor on the distance of pixels from the middle of the image
    eye: tuple[float, float, float] = (0.0, 0.0, 0.0)  #: by how much the camera is moved [m]
    #: by how much it is turned: to the right, up, and clockwise about its axis [degrees]
    turned: tuple[float, float, float] = (0.0, 0.0, 0.0)
    #: by how much the first point and spot lights are moved [m]
    moved: tuple[tuple[float, float, float], ...] = ((0.0, 0.0, 0.0),)
    cone: float = 1.0  #: factor on the angles of spots
    #: how spots fall off: 'hard', 'smooth' from the axis on, one of `EDGES`, 'rim', or '' as in the
    #: scene
    edge: str = ""
    rim: float = 1.0  #: power of a rim, 1 - ((1 - cos)/(1 - cos of the cut-off))^power
    radius: float = 0.0  #: radius of the spheres that take the place of point lights [m]
    #: fraction of 1 - cos(cut-off) in which spots fall off smoothly, as Blender's do
    blend: float = 0.0

    def lights(self, reference: ReferenceScene) -> tuple[ReferenceLight, ...]:
        """Return the point and spot lights of a scene as this scenery has them."""
        lights = []
        for number, light in enumerate(reference.lights):
            # `moved` may be shorter than the list of lights: the others stay.
            if number < len(self.moved):
                light = replace(light, position=light.position + np.array(self.moved[number]))
            # Beam and cut-off are angles to the axis: a spot stays below a hemisphere.
            if light.axis is not None and self.cone != 1:
                cutoff, beam = (
                    min(angle * self.cone, 0.499 * np.pi) for angle in (light.cutoff, light.beam)
                )
                light = replace(light, cutoff=cutoff, beam=beam)
            # Mitsuba's spot falls off between beam and cut-off: a hard edge has no room for that, a
            # smooth one has all of the cone. The other edges are factors, see `_edged`.
            if light.axis is not None and self.edge in ("hard", "smooth"):
                light = replace(light, beam=light.cutoff if self.edge == "hard" else 0.0)
            lights.append(light)
        return tuple(lights)


SCENERY = Scenery()  #: as the scene has it

#: How spots fall off, by the fraction of the way from the cosine of the cut-off to the cosine of
#: the beam's edge.
EDGES: Mapping[str, Callable[[Array], Array]] = {
    "linear": lambda part: part,
    "square": lambda part: part**2,
    "smoothstep": lambda part: part * part * (3 - 2 * part),
}


@dataclass(frozen=True)
class View:
    """The rays of some pixels."""

    reference: ReferenceScene  #: the scene, with these rays in the place of its own
    pixels: Index  #: numbers of the pixels, row by row, ascending, (m,)
    ray_pixel: Index  #: the place in `pixels` of the pixel of each ray, (rays,)
    axis: Array  #: of the camera, unit, (3,)
    distance: Array  #: along the rays to the surfaces, (rays,) [m]
    interaction: "mi.SurfaceInteraction3f"  #: at the surfaces
    shapes: Shapes  #: that cast shadows
    length: Array  #: of the rays up to the surfaces in each medium, (rays, media) [m]
    #: shadow rays that find the lit parts of a ray, an end to half a step; 0: they are exact
    steps: int = 0
    #: what was computed of the view, by its key
    _cached: dict[Hashable, object] = field(default_factory=dict, repr=False)

    def ends(self, ends: Ends) -> tuple[Array, Array]:
        """Return the distances along the rays between which they have nodes (rays,) each [m]."""
        # Planes cut a ray at their depth over the cosine to the camera's axis.
        cosine = self.reference.direction @ self.axis
        along = np.ones_like(cosine) if ends.spherical else 1 / cosine
        last = np.minimum(ends.far * along, ends.faded / cosine)
        if ends.end or ends.part != 1:
            last = np.minimum(last, self.last(ends))
        return ends.near * along, last

    def last(self, ends: Ends | None) -> Array:
        """Return the distances at which rays end for their fog, (rays,) [m]."""
        if ends is None:
            return self.distance
        last = ends.part * self.distance
        if not ends.end:
            return last
        cosine = self.reference.direction @ self.axis
        return last * cosine if ends.end == "ends" else last / cosine

    def reach(
        self,
        light: Light,
        *,
        shadows: bool,
        area: ReferenceAreaLight | None,
        ends: Ends | None = None,
    ) -> LitRays:
        """Return which parts of the rays a light reaches; the shape of an area light
        does not shadow its samples.

        `ends`: of the fog, which may go on behind surfaces.
        """
        beyond = ends is not None and ends.end == "lookup"
        distance = self.last(ends) if beyond else self.distance

        def lit_parts() -> LitRays:
            # The shapes that can stand in the light: none without shadows; for the samples of an
            # area light neither its own shape nor what lies behind it.
            reference = self.reference
            shapes: Shapes | None = self.shapes
            empty = self._once("empty", lambda: mi.load_dict({"type": "scene"}))
            if not shadows:
                reference, shapes = replace(reference, occluders=empty), None
            elif area is not None:
                reference, shapes = self._once(
                    ("before", area.name), lambda: before_light(reference, area)
                )
            # Where exact intervals cost too much, shadow rays test the cone of the light.
            if self.steps and shadows and not isinstance(light, DirectionalLight):
                whole = lit_rays(replace(reference, occluders=empty), light, distance, checks=0)
                return self._tested(whole, light, reference.occluders)
            # Obstacles near the light paths of an area light are searched once for all its samples.
            near_shapes = None
            if area is not None and not isinstance(light, DirectionalLight):
                ball = Ball(area.centre, area.radius)
                near_shapes = self._once(
                    ("near", area.name, shadows, beyond),
                    lambda: obstacles(reference, ball, distance, shapes),
                )
            # Intervals by geometry stay as they are: random checks would only say how far to trust
            # them.
            return lit_rays(reference, light, distance, shapes=shapes, known=near_shapes, checks=0)

        key = "reach", _place_of(light), shadows, None if area is None else area.name, beyond
        return self._once(key, lit_parts)

    def _tested(self, reach: LitRays, light: ReferenceLight, occluders: "mi.Scene") -> LitRays:
        """Return the lit parts of rays by shadow rays from the middles of
        equal angles at the light.
        """
        rays, ray = reach.rays, reach.lit.ray
        if not len(ray):
            return reach
        # Every interval is divided into `steps` equal angles at the light. Shadow rays test their
        # middles, the odd ones of the 2 steps + 1 places; the even places are their ends.
        # A light with a cosine is one of many samples, which smooth its shadows together.
        low, high = (rays.theta(x, ray)[:, None] for x in (reach.lit.low, reach.lit.high))
        steps = self.steps // 4 if light.cosine else self.steps
        theta = low + (high - low) * np.arange(2 * steps + 1) / (2 * steps)
        x = rays.distance(theta, ray[:, None])
        # The ends of an interval keep all their digits.
        x[:, 0], x[:, -1] = reach.lit.low, reach.lit.high
        place = rays.origin + x[:, 1::2, None] * rays.direction[ray, None]
        way = (light.position - place).reshape(-1, 3)
        far = np.linalg.norm(way, axis=1)
        towards = way / np.maximum(far, np.finfo(float).tiny)[:, None]
        shadow_ray = mi.Ray3f(
            vectors(mi.Point3f, place.reshape(-1, 3)), vectors(mi.Vector3f, towards)
        )
        # The shadow ray ends a ten-thousandth of the way before the light.
        shadow_ray.maxt = on_device(mi.Float, (1 - 1e-4) * far)
        lit = ~np.array(occluders.ray_test(shadow_ray), dtype=bool).reshape(-1, steps)
        # A run of lit steps begins where the step before it is dark, and ends where the next one
        # is; beginnings and ends have the same order.
        beside = np.pad(lit, ((0, 0), (1, 1)))
        row, first = np.nonzero(lit & ~beside[:, :-2])
        last = np.nonzero(lit & ~beside[:, 2:])[1]
        return replace(reach, lit=LitIntervals(ray[row], x[row, 2 * first], x[row, 2 * last + 2]))

    def reflected(self, light: Light, *, shadows: bool) -> tuple[Array, Bools]:
        """Return f cos at the surfaces towards a light, (rays, 3), and which of
        them it reaches, (rays,).
        """

        def reflection() -> tuple[Array, Bools]:
            # A ray that meets nothing has its point at the camera, and is never lit.
            visible = np.isfinite(self.distance)
            point = (
                self.reference.origin
                + np.where(visible, self.distance, 0.0)[:, None] * self.reference.direction
            )
            facing = self.interaction.is_valid()
            if isinstance(light, DirectionalLight):
                towards = np.broadcast_to(-light.direction, point.shape)
                shadow_ray = self.interaction.spawn_ray(vectors(mi.Vector3f, towards))
            else:
                way = light.position - point
                towards = (
                    way / np.maximum(np.linalg.norm(way, axis=1), np.finfo(float).tiny)[:, None]
                )
                # An array, since a number would be a constant of a kernel, which each
                # light would compile again.
                place = np.broadcast_to(light.position, point.shape)
                shadow_ray = self.interaction.spawn_ray_to(vectors(mi.Point3f, place))
            # Mitsuba's BSDFs contain the cosine of the incident light.
            local = self.interaction.to_local(vectors(mi.Vector3f, towards))
            reflected = as_rows(
                self.interaction.bsdf().eval(mi.BSDFContext(), self.interaction, local, facing)
            )
            lit = visible & np.any(reflected > 0, axis=1)
            if shadows:
                lit &= ~np.array(self.reference.occluders.ray_test(shadow_ray, facing), dtype=bool)
            return reflected, lit

        return self._once(("surface", _place_of(light)[:2], shadows), reflection)

    def _once(self, key: Hashable, compute: Callable[[], Value]) -> Value:
        """Return what is computed of this view, from the second time on without computing it."""
        if key not in self._cached:
            self._cached[key] = compute()
        return cast(Value, self._cached[key])


def _place_of(light: Light) -> tuple[Hashable, ...]:
    """Return the properties that decide which parts of rays a light reaches."""
    if isinstance(light, DirectionalLight):
        return light.direction.tobytes(), None
    return (
        light.position.tobytes(),
        "near",
        None if light.axis is None else light.axis.tobytes(),
        light.cutoff,
    )


def view_of(
    reference: ReferenceScene,
    pixels: Index | None = None,
    scenery: Scenery = SCENERY,
    *,
    rays_per_side: int = 0,
    steps: int = 0,
) -> View:
    """Return the rays of some pixels.

    `pixels`: numbers of the pixels, row by row; all by default; `rays_per_side`: 0: one ray through
    the centre of each pixel. n: n x n rays, one through the middle of each cell of a grid, whose
    mean is that over the pixel; `steps`: see `View`.
    """
    size = reference.width, reference.height
    pixels = np.arange(size[0] * size[1]) if pixels is None else np.unique(pixels)
    # Places on the film [pixels], zoomed about its middle and shifted: the camera's rays through
    # them take the place of the scene's.
    positions, middle = _positions(pixel_centres(size)[pixels], rays_per_side), 0.5 * np.array(size)
    positions = middle + scenery.zoom * (positions - middle) + np.asarray(scenery.offset)
    sensor = reference.scene.sensors()[0]
    turn = _turn(camera_matrix(sensor)[:3, :3], scenery.turned)
    rays = replace(
        reference,
        origin=reference.origin + np.array(scenery.eye),
        direction=film_directions(sensor, positions, size) @ turn.T,
    )
    shapes, hits = read_shapes(reference.occluders), surface_hits(rays)
    distance = exact_distance(rays, hits.interaction, hits.distance, shapes)
    # `lengths` gives an unbounded line the length 0 in the medium without bounds.
    length = lengths(rays, rays.origin, rays.direction, distance)
    length[~np.isfinite(distance), 0] = np.inf
    owner = np.repeat(np.arange(len(pixels)), max(1, rays_per_side) ** 2)
    axis = turn @ camera_matrix(sensor)[:3, 2]
    return View(rays, pixels, owner, axis, distance, hits.interaction, shapes, length, steps)


def _turn(frame: Array, turned: tuple[float, float, float]) -> Array:
    """Return the turn of a camera with this frame, its columns left, up and ahead, (3, 3): to the
    right and up at once, then clockwise about its axis [degrees].
    """
    if not any(turned):
        return np.eye(3)
    left, up, ahead = frame.T
    # The axis of a turn to the right points down, that of one upwards to the right.
    right, upwards, clockwise = np.deg2rad(turned)
    aim = Rotation.from_rotvec(-right * up - upwards * left)
    return np.asarray((aim * Rotation.from_rotvec(clockwise * ahead)).as_matrix())


def _positions(centres: Array, rays_per_side: int) -> Array:
    """Return places on the film, the places of one pixel after another."""
    if not rays_per_side:
        return centres
    row, column = np.divmod(np.arange(rays_per_side**2), rays_per_side)
    cells = np.stack([column, row], axis=1)
    # Rays go through the middles of cells: where the image is smooth, random places would err by
    # its slope, the middles err by its curvature.
    return (centres[:, None, :] - 0.5 + (cells + 0.5) / rays_per_side).reshape(-1, 2)


@dataclass(frozen=True)
class LightPaths:
    """All paths from one light of the scene."""

    #: radiant intensity, irradiance or radiance times area, (3,): what multiplies the nodes
    intensity: Array
    nodes: Places
    surface: Places


def scattering_paths(
    view: View,
    scenery: Scenery = SCENERY,
    *,
    layers: Sequence[int] = (0, 1),
    ends: Ends | None = None,
    samples: int = SAMPLES,
) -> tuple[LightPaths, ...]:
    """Return all paths of a view, by light.

    `layers`: 0: airlight, 1: surfaces; `ends`: of a fog, between which rays have nodes; `samples`:
    how many stand for an area light.
    """
    reference = replace(view.reference, lights=scenery.lights(view.reference))
    between, corners = (None, ()) if ends is None else (view.ends(ends), ends.corners)
    # A directional light comes through a medium without bounds only where its density falls with
    # height, or where the scene's own equation does not attenuate it.
    far = (
        bool(reference.media)
        or isinstance(reference.medium, HeightMedium)
        or reference.model.light_scale == 0
    )
    paths = []
    # A source is one light of the scene; `source.lights` are the light points that stand for it.
    for number, source in enumerate(light_sources(reference, samples, scenery.radius)):
        shadows = scenery.shadows and number not in scenery.unshadowed
        nodes, points = (
            [no_places(len(reference.media) + 1, surface=surface)] for surface in (False, True)
        )
        for given in source.lights:
            light = _whole_within(given, scenery.blend) if scenery.blend else given
            # Which parts of rays a light reaches, their nodes, and another edge of a spot on these.
            if 0 in layers and (far or not isinstance(light, DirectionalLight)):
                reach = view.reach(light, shadows=shadows, area=source.area, ends=ends)
                if isinstance(light, DirectionalLight):
                    lit_nodes = parallel_nodes(reference, light, reach, between)
                else:
                    lit_nodes = point_nodes(reference, light, reach, between, corners)
                nodes.append(_edged(lit_nodes, light, source, scenery))
            if 1 in layers and reference.occluders.shapes():
                lit = surface_points(
                    reference, light, view.distance, *view.reflected(light, shadows=shadows)
                )
                points.append(_edged(lit, light, source, scenery))
        paths.append(
            LightPaths(np.asarray(source.intensity), Places.joined(nodes), Places.joined(points))
        )
    return tuple(paths)


@dataclass(frozen=True)
class Source:
    """A light of the scene."""

    name: str  #: its id
    intensity: Array  #: what multiplies the paths from it, (3,)
    lights: Sequence[Light]  #: that stand for it
    centre: Array | None = None  #: of a sphere, (3,) [m]
    area: ReferenceAreaLight | None = None  #: that has this extent in the scene


def light_sources(
    reference: ReferenceScene, samples: int = SAMPLES, radius: float = 0.0
) -> list[Source]:
    """Return the lights of a scene: point and spot lights, directional ones, then area lights.

    `samples`: how many stand for an area light; `radius`: of spheres that take the
    place of point lights [m].
    """
    # Names are read from Mitsuba's emitters; the reference lists the lights in the same order, but
    # each kind by itself.
    emitters = reference.scene.emitters()
    far_names = [emitter.id() for emitter in emitters if is_directional(emitter)]
    near_names = [
        emitter.id() for emitter in emitters if not is_directional(emitter) and not is_area(emitter)
    ]
    # A sphere in the place of a point light has 32 samples at least. Spots stay points.
    plan = PointPlan(most=samples)
    near = [
        _as_sphere(name, light, PointPlan(most=max(samples, 32)), radius)
        if radius > 0 and light.axis is None
        else Source(name, light.intensity, (light,))
        for name, light in zip(near_names, reference.lights, strict=True)
    ]
    far = [
        Source(name, light.irradiance, (light,))
        for name, light in zip(far_names, reference.directional, strict=True)
    ]
    # Each of N samples of an area light stands for radiance times area over N.
    wide = [
        Source(
            light.name,
            light.radiance * light.area / samples,
            shared_samples(light, square_points(plan, number, 0, light.kind)),
            light.centre if light.kind == "sphere" else None,
            light,
        )
        for number, light in enumerate(reference.area)
    ]
    return [*near, *far, *wide]


def _as_sphere(name: str, light: ReferenceLight, plan: PointPlan, radius: float) -> Source:
    """Return a sphere of a point light's intensity.

    Seen from anywhere, a sphere of the radiance L has the intensity L pi R^2; one of N points on it
    stands for the area 4 pi R^2/N, of the intensity L 4 pi R^2/N along its normal: four times that
    of the light over N.
    """
    wide = ReferenceAreaLight(
        "sphere", light.position, np.eye(3), np.full(2, radius), np.zeros(3), False, None
    )
    samples = shared_samples(wide, square_points(plan, 0, 0, "sphere"))
    return Source(name, 4 * light.intensity / plan.most, samples, light.position)


def _edged(places: Places, light: Light, source: Source, scenery: Scenery) -> Places:
    """Return places with another edge of a spot, and scaled so that the samples of a sphere
    send as much light as the sphere.
    """
    factor: Array | float = 1.0
    if scenery.edge == "rim":
        factor = _rim(scenery.rim, places.towards, light)
    elif edge := EDGES.get("smoothstep" if scenery.blend else scenery.edge):
        factor = _over_own_edge(edge, places.towards, light)
    if source.centre is not None and isinstance(light, ReferenceLight):
        # All samples together send `level` times the light of the sphere: it is divided out. Where
        # no sample sends, it is 0.
        level = _level(places, light, source, source.centre)
        factor = np.divide(factor, level, out=np.zeros_like(level), where=level > 0)
    return (
        places
        if np.ndim(factor) == 0
        else replace(places, value=places.value * np.asarray(factor)[:, None])
    )


def _level(places: Places, light: ReferenceLight, sphere: Source, centre: Array) -> Array:
    """Return the light of all samples of a sphere at places, as a multiple of the
    sphere's light there, (n,).

    At the distance r from its centre a sphere of the radius R and the radiance L has the solid
    angle 2 pi (1 - sqrt(1 - (R/r)^2)), and an area that faces it the irradiance pi L (R/r)^2. N
    samples with the normals n_i at the distances d_i along v_i stand for the area 4 pi R^2/N each,
    and give 4 pi R^2 L/N sum max(n_i.v_i, 0)/d_i^2, each times the cosine to the way from the
    centre on such an area. Sixteen samples are 10 % off.
    """
    # `place` is relative to the centre of the sphere, (n, 3); `starts` and `normals` are those of
    # the samples, (N, 3); d are the distances between places and samples, (n, N).
    samples = [each for each in sphere.lights if isinstance(each, ReferenceLight)]
    place = light.position - centre + places.r[:, None] * places.towards
    radius, r = float(np.linalg.norm(light.position - centre)), np.linalg.norm(place, axis=1)
    starts, normals = (
        np.stack(rows)
        for rows in ([e.position - centre for e in samples], [np.asarray(e.axis) for e in samples])
    )
    d = np.sqrt(
        np.maximum(r[:, None] ** 2 - 2 * place @ starts.T + radius**2, np.finfo(float).tiny)
    )
    # max(n_i.v_i, 0)/d_i^2 for every place and sample; v_i is (place - start)/d_i.
    sent = np.maximum(place @ normals.T - (starts * normals).sum(axis=1), 0) / d**3
    if places.is_surface:
        # An area that faces the centre sees each sample under the cosine between v_i and the way
        # from the centre; the sphere's irradiance over pi R^2 L is 1/r^2.
        whole = 1 / r**2
        sent *= (r[:, None] - (place / r[:, None]) @ starts.T) / d
    else:
        # The solid angle over pi R^2, written without a difference that far away is nothing.
        whole = 2 / (
            np.maximum(r, radius) ** 2 * (1 + np.sqrt(1 - np.minimum(radius / r, 1.0) ** 2))
        )
    return np.asarray(4 * sent.mean(axis=1) / whole)


def _whole_within(light: Light, blend: float) -> Light:
    """Return a spot whose full intensity ends where a spot of Blender's with this `spot_blend`
    begins to fall off: the nodes have a kink there.
    """
    if isinstance(light, DirectionalLight) or light.axis is None or light.cosine:
        return light
    return replace(
        light, beam=float(np.arccos(min(blend + (1 - blend) * np.cos(light.cutoff), 1.0)))
    )


def _rim(power: float, towards: Array, light: Light) -> Array:
    """Return a rim over the scene's own edge of a spot, (n,)."""
    if isinstance(light, DirectionalLight) or light.axis is None or light.cosine:
        return np.ones(len(towards))
    cosine = np.clip(towards @ light.axis, -1.0, 1.0)
    part = np.clip((1 - cosine) / (1 - np.cos(light.cutoff)), 0.0, 1.0)
    return np.asarray((1 - part**power) * _over_own_edge(np.ones_like, towards, light))


def _over_own_edge(edge: Callable[[Array], Array], towards: Array, light: Light) -> Array:
    """Return an edge over the scene's own edge between the same angles, which is linear in the
    angle, (n,).
    """
    if (
        isinstance(light, DirectionalLight)
        or light.axis is None
        or light.cosine
        or light.beam == light.cutoff
    ):
        return np.ones(len(towards))
    # `part` goes from 0 at the cut-off to 1 at the beam's edge, linear in the cosine; `linear` is
    # the fall-off that the places already have. Beyond the cut-off both are 0.
    cosine = np.clip(towards @ light.axis, -1.0, 1.0)
    part = np.clip(
        (cosine - np.cos(light.cutoff)) / (np.cos(light.beam) - np.cos(light.cutoff)), 0.0, 1.0
    )
    linear = np.clip((light.cutoff - np.arccos(cosine)) / (light.cutoff - light.beam), 0.0, 1.0)
    return np.divide(edge(part), linear, out=np.zeros(len(cosine)), where=linear > 0)
