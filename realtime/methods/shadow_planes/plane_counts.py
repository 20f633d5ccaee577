# SPDX-License-Identifier: BSD-3-Clause
"""How many shadow planes the occluders of a scene have, and how many of them this camera needs."""

from dataclasses import dataclass

from realtime.methods.shadow_planes.plane_table import light_basis, shadow_planes
from realtime.methods.shadow_planes.silhouettes import components_in_view, silhouette
from realtime.scene.camera import HostCamera, read_camera
from realtime.scene.lights import Light, host_position
from realtime.scene.mesh_adjacency import Occluders, read_occluders, with_positions
from realtime.scene.read_scene import Scene


@dataclass(frozen=True)
class LightPlan:
    """The shadow planes of one light."""

    edges: int  #: silhouette edges of all occluders
    components: int  #: connected components whose shadow can be seen
    planes: int  #: planes of those parts: what a frame works with


@dataclass(frozen=True)
class OccluderPlan:
    """The occluders of a scene and, by light, their planes."""

    shapes: int
    components: int  #: connected components
    closed: int  #: of which without border
    triangles: int
    lights: tuple[LightPlan, ...]
    warnings: tuple[str, ...]  #: what is odd about the meshes, by name


def occluder_plan(scene: Scene) -> OccluderPlan:
    """Count the occluders of a scene and what its camera needs of them.

    Raises InputError for an occluder without triangles.
    """
    occluders = with_positions(read_occluders(scene.geometry, scene.area_lights), scene.positions)
    camera = read_camera(scene.camera)
    lights = tuple(_light_plan(occluders, camera, light, scene.source_shape(light)) for light in scene.lights)
    return OccluderPlan(
        shapes=len(occluders.shapes),
        components=len(occluders.closed),
        closed=int(occluders.closed.sum()),
        triangles=len(occluders.triangles),
        lights=lights,
        warnings=occluders.warnings,
    )


def describe_occluders(plan: OccluderPlan) -> dict[str, str]:
    """Return the plan in words, one entry for each decision."""
    if not plan.triangles:
        return {"occluders": "none: no silhouettes, no planes; one integral a ray and light"}
    words = {
        "shadows": "silhouettes and planes: no shadow rays",
        "occluders": f"{plan.shapes} shapes, {plan.triangles} triangles in {plan.components} parts, "
        f"{plan.closed} closed",
    }
    for number, light in enumerate(plan.lights):
        out = plan.components - light.components
        left = f"{out} parts left out, their shadows miss the view" if out else "every part's shadow can be seen"
        name = "planes" if len(plan.lights) == 1 else f"planes of light {number + 1}"
        words[name] = f"{light.planes} of {light.edges} silhouette edges; {left}"
    return words


def _light_plan(occluders: Occluders, camera: HostCamera, light: Light, own: str | None) -> LightPlan:
    position = host_position(light)
    used = components_in_view(occluders, camera, position)
    if own is not None:
        used &= ~occluders.of_shape(own)
    seen = silhouette(occluders, position, used=used)
    every = len(silhouette(occluders, position).edges)
    return LightPlan(
        every, int(used.sum()), len(shadow_planes(occluders, seen, light_basis(position, camera.origin)).first)
    )
