# SPDX-License-Identifier: BSD-3-Clause
"""The pictures of Biri 2006 and Billeter 2010 again, in our own scenes.

Fig. 1 of Biri 2006 is a triptych: a hall lit classically, with single scattering, and with
volumetric shadows. Fig. 1 of Billeter 2010 is a cathedral with two lights, which is not ours to
ship: `colonnade` has two lamps in its place. Fig. 8b there is a tessellation: here one face of the
colonnade's map, by our filter and by the plain Laplacian.
"""

from dataclasses import replace

import mitsuba as mi
import numpy as np

from airlight.realtime.frame.image import render_frame
from airlight.realtime.methods.published.billeter2010.mesh import THRESHOLD
from airlight.realtime.methods.published.billeter2010.tessellation import divide, edges, triangles
from airlight.realtime.scene.animate import thicker_medium
from airlight.realtime.scene.read_scene import Scene, read_scene
from airlight.realtime.shadow_maps.shadow_map import cast_shadow_map
from airlight.validation.arrays import Array
from airlight.validation.papers.light_volumes import corner_heights, plain_edges, quad_levels
from airlight.validation.scenes.loading import load_scene, resize
from airlight.validation.scenes.parts import point_light
from airlight.validation.scenes.registry import SCENES
from airlight.validation.study.configuration import configuration, prepared


def triptych(size: tuple[int, int]) -> dict[str, Array]:
    """Return the three images of Fig. 1 of Biri 2006 in `hall`, all light, each
    (height, width, 3) [W/(m^2 sr)].
    """
    scene = read_scene(load_scene("hall", size).scene)
    clear = replace(scene, medium=thicker_medium(scene.medium, 0.0))
    return {
        "lit classically": _all_light(clear, "unshadowed"),
        "single scattering": _all_light(scene, "unshadowed"),
        "with volumetric shadows": _all_light(scene, "shadow-planes"),
    }


def two_lights_image(size: tuple[int, int]) -> Array:
    """Return the hall with two lamps by light volumes with maps of 1024
    texels, all light [W/(m^2 sr)].
    """
    described = SCENES["colonnade"].build()
    described["lamp-2"] = point_light((-0.73, 3.31, 6.23), (97.0, 103.0, 111.0))
    scene = mi.load_dict(described)
    resize(scene, size)
    return _all_light(read_scene(scene), "light-volumes", map=1024)


def tessellations(size: int) -> dict[str, Array]:
    """Return by filter the side of the quads of one face of the colonnade's
    map, (size, size) [texels].
    """
    scene = read_scene(load_scene("colonnade", (64, 48)).scene)
    heights = corner_heights(cast_shadow_map(scene.geometry, scene.lights[0], size))
    ours = divide(edges(heights, THRESHOLD))
    # As many triangles as ours: the filters are compared at the same cost.
    plain = divide(plain_edges(heights, len(triangles(ours))))
    face = 1  # of the six, the one that sees the columns
    return {
        name: size / 2.0 ** quad_levels(divided)[face]
        for name, divided in (("ours", ours), ("plain", plain))
    }


def _all_light(scene: Scene, method: str, **values: int) -> Array:
    frame = render_frame(prepared(scene, configuration(method, "exact", values)))
    return np.asarray(frame.airlight, dtype=np.float64) + frame.surface
