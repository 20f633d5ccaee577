# SPDX-License-Identifier: BSD-3-Clause
"""Shadow planes: volumetric shadows from silhouettes, without shadow rays.

The silhouette of every occluder, as the light sees it (`realtime.methods.shadow_planes.silhouettes`), extruded away
from the light, bounds what is in shadow. A camera ray crosses these planes, and between crossings it is lit or not as a
whole. With Gamma(x) the airlight of a lit ray from the camera to x (eq. 2), a ray with lit segments [a_i, b_i] has the
airlight

    L = sum_i Gamma(b_i) - Gamma(a_i)                                                      (section 4.2).

The paper evaluates Gamma on every plane and adds or subtracts it, with a stencil buffer to leave out planes that are
themselves in shadow. `order` chooses how that is decided:

* `exact` counts layers along each ray, from the camera on.
* `paper` draws all planes in one order, towards the camera by the cosine between the axis from light to camera and the
  middle of the edge (5.1.4), with the stencil rule of 5.1.5. (Section 5 has the front facing planes increment the
  stencil, section 5.1.5 has the back facing ones add: the latter is right.)
* `none` counts every plane: the artefact of Fig. 4.

`exact` with ``evaluation=pixel`` sums the segments, J(a_i, b_i), all positive: nothing cancels. ``sum=gamma`` takes the
difference of the two Gammas instead, as the paper does.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import drjit as dr
import mitsuba as mi

from airlight.realtime.errors import InputError
from airlight.realtime.methods.interface.method import Layers, Method, View, no_state
from airlight.realtime.methods.shadow_planes.plane_table import PlaneIndex, index_planes
from airlight.realtime.methods.shadow_planes.published_crossings import Buffer, reaches, sum_crossings
from airlight.realtime.methods.shadow_planes.published_mesh import (
    check_vertices,
    gamma_at,
    mesh_gamma,
    sum_in_media,
    surface_gamma,
    visible_triangle,
)
from airlight.realtime.methods.shadow_planes.silhouettes import components_in_view, cone_ring
from airlight.realtime.methods.shadow_planes.sweep import RayPlanes, ray_planes, sum_lit_intervals
from airlight.realtime.numerics.array_types import host_numbers, types_of
from airlight.realtime.parameters import parameter
from airlight.realtime.scene.camera import read_camera
from airlight.realtime.scene.lights import Light, host_position
from airlight.realtime.scene.media.bounded_rays import FORMS, BoundedRays
from airlight.realtime.scene.media.medium import LitRays
from airlight.realtime.scene.mesh_adjacency import Occluders, read_occluders, with_positions
from airlight.realtime.scene.read_scene import Scene


@dataclass(frozen=True)
class ShadowPlanes(Method):
    """The airlight between shadow planes.

    Valid for all lights and occluders that are triangle meshes, closed or not. Shadows are those of the triangles,
    exact to rounding, with order=exact. Bounded media have their own nodes, except with a polynomial kernel. With
    buffer=8bit the in-scattered radiance is what the buffer holds less the lit surfaces.

    References
    ----------
    Biri, Arques, Michelin 2006, *Real time rendering of atmospheric scattering and volumetric shadows*, Journal of
    WSCG 14.
    """

    name = "shadow-planes"
    summary = "silhouettes extruded to planes; lit segments between their crossings"
    source = "Biri, Arques, Michelin 2006"
    prepared_from = frozenset({"camera", "geometry", "light"})
    provides_visibility = True

    order: str = parameter(
        "exact", "how shadow within shadow is decided, see below", choices=("exact", "paper", "none")
    )
    evaluation: str = parameter(
        "pixel",
        "Gamma at every crossing, or at the vertices of a mesh of each plane and of the surfaces, interpolated, as "
        "published",
        choices=("pixel", "vertex"),
    )
    sum: str = parameter(
        "segments",
        "sums of J over lit segments, which are positive, or differences of Gamma, which cancel; differences only with "
        "order=exact and evaluation=pixel",
        choices=("segments", "gamma"),
    )
    buffer: str = parameter(
        "float",
        "the paper's frame buffer: 255 steps up to `white` for surfaces and all lights, rounded and clamped after each "
        "pass",
        choices=("float", "8bit"),
    )
    white: float = parameter(
        1.0, "the radiance that fills the 8-bit buffer; brighter values are cut off", above=0, unit="W/(m^2 sr)"
    )
    rows: int = parameter(
        16,
        "rows of the mesh of a plane, each 1.5 times as far from the light as the last; beyond the last Gamma is "
        "constant",
        least=2,
    )
    ambient: float = parameter(
        0.0,
        "radiance of a constant light field in the medium, the paper's stand-in for multiple scattering, which adds "
        "albedo ambient (1 - exp(-sigma_t x)); the reference has none",
        least=0,
        unit="W/(m^2 sr)",
    )
    media: str = parameter(
        "kernel",
        "bounded media: the true depth on both segments, or the constant R of section 4.2 as meant or as printed; "
        "`kernel` is `paper` with a polynomial kernel and otherwise `exact`, which asks no kernel",
        choices=("kernel", *FORMS),
    )
    cone: int = parameter(
        0,
        "edges of the pyramid of planes that bounds a spot, 32 in the paper; 0 is the cone itself, and planes bound no "
        "light",
        least=3,
        most=4096,
        also=(0,),
        wanted="0 for the cone itself, or 3 to 4096 edges",
    )

    def _check_together(self) -> None:
        if self.sum == "gamma" and not self.segments:
            raise InputError(
                "sum=gamma: needs order=exact, evaluation=pixel and buffer=float; the others add Gammas anyway"
            )

    @property
    def by_rays(self):
        """Gamma at vertices is that of the whole image."""
        return self.evaluation == "pixel"

    @property
    def casts_rays(self):
        """Rays say which triangle a surface is of."""
        return self.evaluation == "vertex"

    @property
    def at_once(self):
        """Ambient light and a buffer that rounds apply to the sum of all lights."""
        return self.buffer == "8bit" or self.ambient > 0

    @property
    def segments(self) -> bool:
        """Whether the lit segments of a ray are known, so that each can be integrated by itself."""
        return self.order == "exact" and self.evaluation == "pixel" and self.buffer == "float"

    def preparation(self, scene):
        """Read the occluders of a scene and return what finds the shadow planes of a frame.

        Raises InputError for occluders without triangles.
        """
        occluders = read_occluders(scene.geometry, scene.area_lights)
        return PlanePreparation(occluders, self.cone, self.order) if scene.features.shadows else no_state

    def check(self, scene):
        """Refuse bounded media that vertices cannot have."""
        if scene.features.bounded and self.evaluation == "vertex":
            check_vertices(scene.medium, scene.lights)

    def airlight(self, view, light, state, kernel):
        """Return the airlight of every ray between shadow planes, and whether the light reaches the visible surface."""
        if not view.features.shadows:
            airlight = view.lit_by(light, kernel, form=self.media)
            return airlight.radiance(airlight.gamma(view.distance)), True
        airlight, rays, cone = self._rays(view, light, state, kernel)
        if self.segments:
            value, reached = _segments(view, state, rays, airlight, differences=self.sum == "gamma")
        else:
            value, reached = self._drawn(view, state, rays, airlight, cone=cone)
        # Frames cast rays for the shadows of a light at infinity on surfaces.
        return value, reached if light.w else True

    def render(self, view, state, kernel):
        """Return the layers of every ray; see `airlight`."""
        if self.buffer == "8bit":
            return self._buffered(view, state, kernel)
        layers = super().render(view, state, kernel)
        if not self.ambient:
            return layers
        return replace(layers, in_scattered=layers.in_scattered + self._ambient_fog(view))

    def error_causes(self, size):
        """Return the causes of its errors, see `Method.error_causes`."""
        return (
            ("buffer", {"buffer": "float"}),
            ("resolution", {"evaluation": "pixel"}),
            ("order", {"order": "exact"}),
        )

    def _rays(self, view: View, light: Light, index: PlaneIndex, kernel) -> tuple[LitRays, RayPlanes, bool]:
        """Return the airlight of a light, the rays among its planes, and whether planes bound its cone."""
        cone = bool(self.cone and light.cone is not None and not light.varies)
        light = light.without_cone() if cone else light
        # In float64: next to the image of the light x and y vanish.
        aim = view.aim * dr.rcp(dr.norm(view.aim))
        x, y, z = (type(view.distance)(dr.dot(axis, aim)) for axis in index.axes)
        rays = ray_planes(index, x, y, z, ray_end=index.distance / view.distance)
        return view.lit_by(light, kernel, form=self.media), rays, cone

    def _ambient_fog(self, view: View):
        """Return the radiance of a constant light field in the media [W/(m^2 sr)]."""
        return self.ambient * view.medium.ambient(view, dr.minimum(view.distance, 1e30))

    def _buffered(self, view: View, state, kernel) -> Layers:
        """Return the 8-bit buffer after all passes, less the lit surfaces."""
        buffer, Color = Buffer(self.white), type(view.medium.albedo)
        total, surfaces = Color(0), Color(0)  # what the buffer holds, and what of that are surfaces
        lit = []
        for number, light in enumerate(view.lights):
            index = state[number] if view.features.shadows else None
            reached = True
            if index is not None:
                airlight, rays, cone = self._rays(view, light, index, kernel)
                reached = reaches(index, rays, view.distance) if light.w else mi.Bool(True)
            surface = Color(0) if view.surfaces is None else dr.select(reached, view.surfaces[number], 0)
            surfaces += surface
            total = buffer.stored(total + surface)
            if number == 0 and self.ambient:  # that of the first light is that of all
                total = buffer.stored(total + self._ambient_fog(view))
            if index is None:
                total = buffer.stored(total + self.airlight(view, light, None, kernel)[0])
            else:
                total, _ = self._drawn(view, index, rays, airlight, cone=cone, buffer=buffer, start=total)
            lit.append(reached if light.w else True)
        return Layers(total - surfaces, tuple(lit))

    def _drawn(
        self, view: View, index: PlaneIndex, rays: RayPlanes, airlight: LitRays, *, cone: bool, buffer=None, start=None
    ):
        """Add up the Gammas of one light, in a buffer or not, and say whether it reaches the surface."""
        if not isinstance(airlight, BoundedRays) or self.evaluation == "pixel":
            gammas = self._gammas(view, index, airlight, cone=cone)
            return sum_crossings(index, rays, view.distance, gammas, order=self.order, buffer=buffer, start=start)
        start = type(view.medium.albedo)(0) if start is None else start
        how = {"rows": self.rows, "cone": cone, "order": self.order, "buffer": buffer, "start": start}
        return sum_in_media(view, airlight, index, rays, **how), reaches(index, rays, view.distance)

    def _gammas(self, view: View, index: PlaneIndex, airlight: LitRays, *, cone: bool):
        """Return the functions that give the radiance of Gamma at a crossing, and at the surface."""

        def at(x):
            return airlight.radiance(airlight.gamma(x))

        if self.evaluation == "pixel":
            return lambda number, rays, x: at(x), at
        gamma = partial(gamma_at, view, airlight.light, kernel=airlight.kernel)
        return (
            mesh_gamma(index, airlight.light, gamma, rows=self.rows, cone=cone),
            lambda x: surface_gamma(visible_triangle(view), gamma, at(x)),
        )


@dataclass(frozen=True)
class PlanePreparation:
    """The occluders of a scene; called with the scene as it is now, returns the shadow planes of its lights."""

    occluders: Occluders
    cone: int = 0  #: edges of the cone of a spot; 0: no planes for it
    order: str = "exact"  #: in which rays go over planes

    def __call__(self, scene: Scene) -> tuple[PlaneIndex, ...]:
        """Return the planes of every light of a scene."""
        return self.start(scene)()

    @property
    def warnings(self) -> tuple[str, ...]:
        """Occluders that the planes count wrong in a paper's order; the exact order counts all right."""
        return () if self.order == "exact" else tuple(self.occluders.warnings)

    def start(self, scene: Scene) -> Callable[[], tuple[PlaneIndex, ...]]:
        """Read what the host needs of a scene, which waits for the device; return what then finds the planes."""
        here, camera = with_positions(self.occluders, scene.positions), read_camera(scene.camera)
        types, lights = types_of(type(scene.camera.origin.x)), []
        for light in scene.lights:
            ring = None
            if self.cone and light.cone is not None:
                axis, cosine = host_numbers(light.axis, light.cos_cutoff)
                ring = cone_ring(axis, float(cosine[0]), self.cone)
            lights.append((host_position(light), scene.source_shape(light), ring))

        def planes(position: Any, own: str | None, ring: Any) -> PlaneIndex:
            used = components_in_view(here, camera, position)
            if own is not None:  # the light's own shape casts no shadow in it
                used &= ~here.of_shape(own)
            return index_planes(here, position, camera.origin, used=used, types=types, order=self.order, ring=ring)

        return lambda: tuple(planes(*each) for each in lights)


def _segments(view: View, index: PlaneIndex, rays: RayPlanes, airlight: LitRays, *, differences: bool):
    """Sum the lit segments of one light."""

    def integral(a, b):
        return airlight.gamma(b) - airlight.gamma(a) if differences else airlight.airlight(a, b)

    zero = airlight.nothing(dr.width(view.distance))
    value, reached = sum_lit_intervals(index, rays, airlight.segment(view.distance), integral, zero)
    return airlight.radiance(value), reached
