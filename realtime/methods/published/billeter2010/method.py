# SPDX-License-Identifier: BSD-3-Clause
"""Light volumes as published: the boundary becomes triangles, each is drawn over
the pixels that it covers.

With Gamma(x) the airlight from the camera to x (eq. 1), the airlight of a ray is
the signed sum of eq. 3,

    L = sum_n s_n Gamma(min(x_n, x_visible)),    s_n = +1 where the ray leaves the light,
                                                 s_n = -1 where it enters the light,

in any order: terms are added up as they come (`realtime.methods.published.billeter2010.raster`).
The `static` mesh is the height field of the shadow map itself, an `adaptive` one has fewer
triangles where the map is flat (`realtime.methods.published.billeter2010.tessellation`).
`light-volumes` crosses the same height field ray by ray, without triangles.
"""

from dataclasses import dataclass

from airlight.errors import InputError
from airlight.realtime.methods.interface.method import Method
from airlight.realtime.methods.published.billeter2010.mesh import (
    THRESHOLD,
    memory_needed,
    volume_mesh,
)
from airlight.realtime.methods.published.billeter2010.raster import mesh_airlight
from airlight.realtime.parameters import parameter
from airlight.realtime.scene.lights import Light
from airlight.realtime.scene.media.medium import Homogeneous
from airlight.realtime.shadow_maps.projection import light_faces
from airlight.realtime.shadow_maps.shadow_map import (
    cast_shadow_map,
    check_maps,
    map_memory,
    map_size,
)


@dataclass(frozen=True)
class LightVolumes2010(Method):
    """The airlight in light volumes, as published.

    Valid in one medium without bounds, for point and spot lights and any shapes that rays can be
    cast against. Exact with respect to the shadow map: what it misses of the scene falls as the
    size of a texel.

    References
    ----------
    Billeter, Sintorn, Assarsson 2010, *Real time volumetric shadows using polygonal light volumes*,
    High Performance Graphics.
    """

    name = "light-volumes-2010"
    summary = "light volumes as published: the mesh of a shadow map, drawn with signs"
    source = "Billeter, Sintorn, Assarsson 2010"
    prepared_from = frozenset({"geometry", "light"})
    frozen = False  # crossings are counted on the way

    map: int = map_size(512, "texels on a side of a face of the shadow map, a power of two")
    tessellation: str = parameter(
        "static",
        "two triangles a texel, or larger ones where the map is flat",
        choices=("static", "adaptive"),
    )
    threshold: float = parameter(
        THRESHOLD,
        "for `adaptive`: allowed departure from the map, relative to the depth",
        above=0,
        wanted=f"a positive number, for instance {THRESHOLD:g}",
    )

    def check(self, scene):
        """Refuse media other than a homogeneous one without bounds, and more
        memory than the machine has.
        """
        if not isinstance(scene.medium, Homogeneous) or scene.medium.bounded_media:
            raise InputError(
                f"method {self.name}: expected one homogeneous medium that fills all space, and "
                "the scene has another; use light-volumes"
            )
        # Without shadows there is no map and no mesh.
        if scene.features.shadows:
            check_maps(
                scene.lights, self.map, sum(_memory_of(light, self.map) for light in scene.lights)
            )

    def prepare(self, scene, light):
        """Return the mesh of a light."""
        shadow_map = cast_shadow_map(scene.geometry, light, self.map)
        return volume_mesh(
            shadow_map, light, tessellation=self.tessellation, threshold=self.threshold
        )

    def airlight(self, view, light, state, kernel):
        """Return the airlight of every ray."""
        if state is not None:
            return mesh_airlight(view, light, state, kernel=kernel)
        # Nothing casts a shadow: the light volume is everything before the surface.
        rays = view.lit_by(light, kernel)
        return rays.radiance(rays.gamma(view.distance))

    def error_causes(self, size):
        """Return the causes of its errors, see `Method.error_causes`."""
        return (("map", None),)


def _memory_of(light: Light, size: int) -> int:
    """Return about how much the volume of a light takes, an upper bound
    where it is adaptive [bytes].
    """
    # The map, the mesh, and what drawing takes for each vertex: four doubles of the vertex as it
    # is, and four of it in the image.
    faces = light_faces(light)
    drawing = faces * (size + 1) ** 2 * (8 * 8)
    return map_memory(light, size) + memory_needed(faces, size) + drawing
