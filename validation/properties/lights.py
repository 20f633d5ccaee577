# SPDX-License-Identifier: BSD-3-Clause
"""Silhouettes of a scene: how many edges turn into shadow planes, of all lights."""

import numpy as np

from realtime.errors import InputError
from realtime.methods.shadow_planes.silhouettes import silhouette
from realtime.scene.mesh_adjacency import read_casters
from realtime.scene.read_scene import Scene
from validation.properties.view import LightPlace


def caster_properties(scene: Scene, lights: list[LightPlace]) -> dict[str, float]:
    """Return what the shapes of a scene are, and the edges of their silhouettes as the lights see them.

    `triangles`, `shapes`, `plain_shapes` (those that are no meshes: shadow planes refuse them), `components` of meshes,
    the share of these that is `closed`, `silhouettes` of all lights together and `silhouettes_most` of one.
    """
    shapes = scene.geometry.shapes()
    lamps = {light.name for light in scene.area_lights}
    own = [shape for shape in shapes if shape.id() not in lamps]
    plain = sum(not shape.is_mesh() for shape in own)
    properties = {
        "shapes": float(len(own)),
        "plain_shapes": float(plain),
        "triangles": float(sum(shape.face_count() for shape in own if shape.is_mesh())),
        "components": 0.0,
        "closed": 1.0,
        "silhouettes": 0.0,
        "silhouettes_most": 0.0,
    }
    if plain or not own:
        return properties
    try:
        casters = read_casters(scene.geometry, scene.area_lights)
    except InputError:
        return properties
    counts = [
        len(silhouette(casters, np.append(light.place, 0.0 if light.kind == "directional" else 1.0)).edges)
        for light in lights
    ]
    return properties | {
        "components": float(len(casters.closed)),
        "closed": float(casters.closed.mean()) if len(casters.closed) else 1.0,
        "silhouettes": float(sum(counts)),
        "silhouettes_most": float(max(counts, default=0)),
    }
