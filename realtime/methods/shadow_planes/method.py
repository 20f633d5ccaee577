# SPDX-License-Identifier: BSD-3-Clause
"""Shadow planes: volumetric shadows from silhouettes, without shadow rays.

The silhouette of every occluder, as the light sees it
(`realtime.methods.shadow_planes.silhouettes`), extruded away from the light, bounds what is in
shadow. A camera ray crosses these planes, and between crossings it is lit or not as a whole.
Counting layers from the camera on gives its lit segments [a_i, b_i], and its airlight is

    L = sum_i J(a_i, b_i),

a sum of positive terms. `realtime.methods.published.biri2006` has what the paper does otherwise.
"""

from dataclasses import dataclass

import drjit as dr

from airlight.realtime.methods.interface.method import Method, no_state
from airlight.realtime.methods.shadow_planes.plane_table import PlaneIndex, index_planes
from airlight.realtime.methods.shadow_planes.silhouettes import components_in_view
from airlight.realtime.methods.shadow_planes.sweep import ray_planes, sum_lit_intervals
from airlight.realtime.numerics.array_types import types_of
from airlight.realtime.scene.camera import read_camera
from airlight.realtime.scene.lights import host_position
from airlight.realtime.scene.mesh_adjacency import Occluders, read_occluders, with_positions
from airlight.realtime.scene.read_scene import Scene


@dataclass(frozen=True)
class ShadowPlanes(Method):
    """The airlight between shadow planes.

    Valid for all lights and occluders that are triangle meshes, closed or not. Shadows are those of
    the triangles, exact to rounding.

    References
    ----------
    Biri, Arques, Michelin 2006, *Real time rendering of atmospheric scattering and volumetric
    shadows*, Journal of WSCG 14.
    """

    name = "shadow-planes"
    summary = "silhouettes extruded to planes; lit segments between their crossings"
    source = "Biri, Arques, Michelin 2006"
    as_published = "shadow-planes-2006"
    prepared_from = frozenset({"camera", "geometry", "light"})
    provides_visibility = True
    by_rays = True

    def preparation(self, scene):
        """Read the occluders of a scene and return what finds the shadow planes of a frame.

        Raises InputError for occluders without triangles.
        """
        occluders = read_occluders(scene.geometry, scene.area_lights)
        return PlanePreparation(occluders) if scene.features.shadows else no_state

    def airlight(self, view, light, state, kernel):
        """Return the airlight of every ray between shadow planes, and whether the light
        reaches the visible surface.
        """
        rays = view.lit_by(light, kernel)
        if state is None:
            return rays.radiance(rays.gamma(view.distance)), True
        planes, nothing = (
            ray_planes(state, view.aim, view.distance),
            rays.nothing(dr.width(view.distance)),
        )
        total, reached = sum_lit_intervals(
            state, planes, rays.segment(view.distance), rays.airlight, nothing
        )
        # Frames cast rays for the shadows of a light at infinity on surfaces.
        return rays.radiance(total), reached if light.w else True


@dataclass(frozen=True)
class PlanePreparation:
    """The occluders of a scene; called with the scene as it is now, returns the
    shadow planes of its lights.
    """

    occluders: Occluders

    def __call__(self, scene: Scene) -> tuple[PlaneIndex, ...]:
        """Return the planes of every light of a scene, in the order of `View.lights`."""
        occluders, camera = (
            with_positions(self.occluders, scene.positions),
            read_camera(scene.camera),
        )
        types, states = types_of(type(scene.camera.origin.x)), []
        for light in scene.lights:
            position, shape = host_position(light), scene.source_shape(light)
            used = components_in_view(occluders, camera, position)
            if shape is not None:  # the light's shape casts no shadow in its own light
                used &= ~occluders.of_shape(shape)
            states.append(index_planes(occluders, position, camera.origin, used=used, types=types))
        return tuple(states)
