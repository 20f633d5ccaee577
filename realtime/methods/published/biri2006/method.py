# SPDX-License-Identifier: BSD-3-Clause
"""Shadow planes as published: Gamma on every plane, added or subtracted.

With Gamma(x) the airlight of a lit ray from the camera to x (eq. 2), a ray with lit segments
[a_i, b_i] has the airlight

    L = sum_i Gamma(b_i) - Gamma(a_i)                                        (section 4.2).

The paper evaluates Gamma on every plane, with a stencil buffer to leave out planes that are
themselves in shadow. `order` chooses how that is decided:

* `paper` draws all planes in one order, towards the camera by the cosine between the axis from
  light to camera and the middle of the edge (5.1.4), with the stencil rule of 5.1.5. (Section 5 has
  the front facing planes increment the stencil, section 5.1.5 has the back facing ones add: the
  latter is right.)
* `none` counts every plane: the artefact of Fig. 4.
* `exact` counts layers along each ray, from the camera on, as `shadow-planes` does. `shadow-planes`
  integrates each lit segment; here the ends of a segment are two Gammas, whose difference loses
  digits where the segment is short.

Each of the other parameters adds one thing that the paper has: a polynomial comes with the kernel
`taylor`.
"""

from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import drjit as dr

from airlight.errors import InputError
from airlight.realtime.methods.interface.method import Layers, Method, View, no_state
from airlight.realtime.methods.published.biri2006.crossings import Buffer, reaches, sum_crossings
from airlight.realtime.methods.published.biri2006.media import FORMS, constant_rays
from airlight.realtime.methods.published.biri2006.mesh import (
    check_vertices,
    gamma_at,
    mesh_gamma,
    sum_in_media,
    surface_gamma,
    visible_triangle,
)
from airlight.realtime.methods.published.biri2006.planes import PaperPlanes, cone_ring, paper_planes
from airlight.realtime.methods.shadow_planes.silhouettes import components_in_view
from airlight.realtime.methods.shadow_planes.sweep import RayPlanes, ray_planes, sum_lit_intervals
from airlight.realtime.numerics.array_types import host_numbers, types_of
from airlight.realtime.parameters import parameter
from airlight.realtime.scene.camera import read_camera
from airlight.realtime.scene.lights import Light, host_position
from airlight.realtime.scene.media.bounded_rays import BoundedRays
from airlight.realtime.scene.media.medium import LitRays
from airlight.realtime.scene.mesh_adjacency import Occluders, read_occluders, with_positions
from airlight.realtime.scene.read_scene import Scene


@dataclass(frozen=True)
class ShadowPlanes2006(Method):
    """The airlight between shadow planes, as published.

    Valid for all lights and occluders that are triangle meshes; occluders that are not closed are
    right with order=exact. With buffer=8bit the in-scattered radiance is what the buffer holds less
    the lit surfaces.

    References
    ----------
    Biri, Arques, Michelin 2006, *Real time rendering of atmospheric scattering and volumetric
    shadows*, Journal of WSCG 14.
    """

    name = "shadow-planes-2006"
    summary = "shadow planes as published: Gamma at each, with a stencil and a frame buffer"
    source = "Biri, Arques, Michelin 2006"
    prepared_from = frozenset({"camera", "geometry", "light"})
    provides_visibility = True

    order: str = parameter(
        "paper",
        "how shadow within shadow is decided, see below",
        choices=("paper", "none", "exact"),
    )
    evaluation: str = parameter(
        "pixel",
        "Gamma at every crossing, or at the vertices of a mesh of each plane and of the surfaces, "
        "interpolated, as published",
        choices=("pixel", "vertex"),
    )
    buffer: str = parameter(
        "float",
        "the paper's frame buffer: 255 steps up to `white` for surfaces and all lights, rounded "
        "and clamped after each pass",
        choices=("float", "8bit"),
    )
    white: float = parameter(
        1.0,
        "the radiance that fills the 8-bit buffer; brighter values are cut off",
        above=0,
        unit="W/(m^2 sr)",
    )
    rows: int = parameter(
        16,
        "rows of the mesh of a plane, each 1.5 times as far from the light as the last; beyond "
        "the last Gamma is constant",
        least=2,
        most=64,  # 1.5^64 = 2e11: beyond it float32 loses the squares of distances
    )
    ambient: float = parameter(
        0.0,
        "radiance of a constant light field in the medium, the paper's stand-in for multiple "
        "scattering, which adds albedo ambient (1 - exp(-sigma_t x)); the reference has none",
        least=0,
        unit="W/(m^2 sr)",
    )
    media: str = parameter(
        "exact",
        "bounded media: the true depth on both segments, or the constant R of section 4.2 as "
        "meant or as printed, by the polynomial of the kernel where it has one",
        choices=FORMS,
    )
    cone: int = parameter(
        0,
        "edges of the pyramid of planes that bounds a spot, 32 in the paper; 0 is the cone "
        "itself, and planes bound no light",
        least=3,
        most=4096,
        also=(0,),
        wanted="0 for the cone itself, or 3 to 4096 edges",
    )

    @property
    def by_rays(self):
        """Gamma at every crossing belongs to one ray; Gamma at vertices to the whole image."""
        return self.evaluation == "pixel"

    @property
    def casts_rays(self):
        """Rays say which triangle a surface is of."""
        return self.evaluation == "vertex"

    @property
    def at_once(self):
        """Ambient light and a buffer that rounds apply to the sum of all lights."""
        return self.buffer == "8bit" or self.ambient > 0

    def preparation(self, scene):
        """Read the occluders of a scene and return what finds the shadow planes of a frame.

        Raises InputError for occluders without triangles.
        """
        if not scene.features.shadows:
            return no_state
        occluders = read_occluders(scene.geometry, scene.area_lights)
        return PaperPreparation(occluders, self.cone, self.order)

    def check(self, scene):
        """Refuse media and lights that vertices cannot have, and a pyramid that is not drawn."""
        if self.evaluation == "vertex":
            check_vertices(scene.medium, scene.lights)
        spots = any(light.cone is not None for light in scene.lights)
        if self.cone and spots and not scene.features.shadows:
            raise InputError(
                f"cone: got {self.cone}, and no planes are drawn where nothing casts a shadow; use "
                "cone=0"
            )

    def airlight(self, view, light, state, kernel):
        """Return the airlight of every ray between shadow planes, and whether the light
        reaches the visible surface.
        """
        if state is None:
            # Nothing casts a shadow: the ray is lit up to the surface.
            rays = self._lit(view, light, kernel)
            return rays.radiance(rays.gamma(view.distance)), True
        value, reached = self._drawn(view, light, state, kernel)
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

    def _lit(self, view: View, light: Light, kernel) -> LitRays:
        """Return the rays with one light, in bounded media by the form that is asked for."""
        if self.media == "exact" or not view.medium.bounded_media:
            return view.lit_by(light, kernel)
        return constant_rays(view, light, kernel, self.media)

    def _ambient_fog(self, view: View):
        """Return the radiance of a constant light field in the media [W/(m^2 sr)]."""
        return self.ambient * view.medium.ambient(view, dr.minimum(view.distance, 1e30))

    def _buffered(self, view: View, state, kernel) -> Layers:
        """Return the 8-bit buffer after all passes, less the lit surfaces."""
        buffer, Color = Buffer(self.white), type(view.medium.albedo)
        total, surfaces = Color(0), Color(0)  # what the buffer holds, and what of that are surfaces
        lit: list[Any] = []
        for number, light in enumerate(view.lights):
            # Frames cast rays for the shadows of a light at infinity on surfaces.
            planes = state[number] if view.features.shadows else None
            reached = True
            if planes is not None and light.w:
                rays = ray_planes(planes.index, view.aim, view.distance)
                reached = reaches(planes.index, rays, view.distance)
            # The lit surfaces are drawn first.
            surface = (
                Color(0) if view.reflected is None else dr.select(reached, view.reflected(light), 0)
            )
            surfaces += surface
            total = buffer.stored(total + surface)
            # Ambient fog belongs to no light, and is drawn once.
            if number == 0 and self.ambient:
                total = buffer.stored(total + self._ambient_fog(view))
            # The airlight: up to the surfaces where nothing casts a shadow,
            # otherwise plane after plane.
            if planes is None:
                total = buffer.stored(total + self.airlight(view, light, None, kernel)[0])
            else:
                total, _ = self._drawn(view, light, planes, kernel, buffer=buffer, start=total)
            lit.append(reached)
        return Layers(total - surfaces, tuple(lit))

    def _drawn(
        self, view: View, light: Light, planes: PaperPlanes, kernel, *, buffer=None, start=None
    ):
        """Add up the Gammas of one light, in a buffer or not, and say
        whether it reaches the surface.
        """
        index = planes.index
        rays = ray_planes(index, view.aim, view.distance)
        # Planes bound a spot. They take the place of a cone in which the intensity does not fall.
        cone = bool(self.cone and light.cone is not None)
        bare = light.without_cone() if cone and not light.varies else light
        airlight = self._lit(view, bare, kernel)
        # Vertices in bounded media: medium by medium, each with a Gamma that begins where it does.
        if view.medium.bounded_media and self.evaluation == "vertex":
            start = type(view.medium.albedo)(0) if start is None else start
            assert isinstance(airlight, BoundedRays)
            total = sum_in_media(
                view,
                airlight,
                planes,
                rays,
                rows=self.rows,
                cone=cone,
                order=self.order,
                buffer=buffer,
                start=start,
            )
            return total, reaches(index, rays, view.distance)
        # Without a buffer that rounds in between, the ends of each lit segment are found first.
        if self.order == "exact" and self.evaluation == "pixel" and buffer is None:
            return _differences(view, planes, rays, airlight)
        gammas = self._gammas(view, planes, airlight, cone=cone)
        return sum_crossings(
            planes, rays, view.distance, gammas, order=self.order, buffer=buffer, start=start
        )

    def _gammas(self, view: View, planes: PaperPlanes, airlight: LitRays, *, cone: bool):
        """Return the functions that give the radiance of Gamma at a
        crossing, and at the surface.
        """

        def at(x):
            return airlight.radiance(airlight.gamma(x))

        # At every crossing itself, or between the vertices of the planes and of the surfaces.
        if self.evaluation == "pixel":
            return lambda number, rays, x: at(x), at
        gamma = partial(gamma_at, view, airlight.light, kernel=airlight.kernel)
        return (
            mesh_gamma(planes, airlight.light, gamma, rows=self.rows, cone=cone),
            lambda x: surface_gamma(visible_triangle(view), gamma, at(x)),
        )


def _differences(view: View, planes: PaperPlanes, rays: RayPlanes, airlight: LitRays):
    """Sum the differences of Gamma over the lit segments of one light,
    whatever the order of the list.
    """

    def difference(a, b):
        return airlight.gamma(b) - airlight.gamma(a)

    zero = airlight.nothing(dr.width(view.distance))
    total, reached = sum_lit_intervals(
        planes.index, rays, airlight.segment(view.distance), difference, zero
    )
    return airlight.radiance(total), reached


@dataclass(frozen=True)
class PaperPreparation:
    """The occluders of a scene; called with the scene as it is now, returns the
    shadow planes of its lights.
    """

    occluders: Occluders
    cone: int  #: edges of the cone of a spot; 0: no planes for it
    order: str  #: in which rays go over planes

    @property
    def warnings(self) -> tuple[str, ...]:
        """Occluders that the planes count wrong in a paper's order; the
        exact order counts all right.
        """
        return () if self.order == "exact" else tuple(self.occluders.warnings)

    def __call__(self, scene: Scene) -> tuple[PaperPlanes, ...]:
        """Return the planes of every light of a scene, in the order of `View.lights`."""
        occluders, camera = (
            with_positions(self.occluders, scene.positions),
            read_camera(scene.camera),
        )
        types, states = types_of(type(scene.camera.origin.x)), []
        for light in scene.lights:
            position, shape, ring = host_position(light), scene.source_shape(light), None
            used = components_in_view(occluders, camera, position)
            if shape is not None:  # the light's shape casts no shadow in its own light
                used &= ~occluders.of_shape(shape)
            # The cone of a spot as an occluder: a ring of edges close to the light.
            if self.cone and light.cone is not None:
                axis, cosine = host_numbers(light.axis, light.cos_cutoff)
                ring = cone_ring(axis, float(cosine[0]), self.cone)
            states.append(
                paper_planes(
                    occluders,
                    position,
                    camera.origin,
                    used=used,
                    types=types,
                    towards_camera=self.order == "paper",
                    ring=ring,
                )
            )
        return tuple(states)
