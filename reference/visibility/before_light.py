# SPDX-License-Identifier: BSD-3-Clause
"""The possible occluders of an area light.

A rectangle and a disk emit to one side, and a convex body shines on nothing that it hides itself: a light's own
shape therefore never shadows it, nor do shapes in or behind the plane of a rectangle or a disk. They are left out: in
float64 a shape in the plane would be in front of it or behind it by chance. Another mesh stays, a hair behind where
its light starts.
"""

from dataclasses import replace

import numpy as np

from reference.scene.area_light import ReferenceAreaLight
from reference.scene.read import ReferenceScene, scene_of
from reference.scene.shapes import Shapes, read_shapes

IN_PLANE = 1e-7  #: of the largest coordinate: what is closer to the plane of a light counts as in it; float32 corners


def before_light(reference: ReferenceScene, light: ReferenceAreaLight) -> tuple[ReferenceScene, Shapes]:
    """Return the scene and the shapes that can shadow a light.

    `reference`, `light`: the scene and one of its area lights.
    """
    shapes = reference.occluders.shapes()
    others = [shape for shape in shapes if shape != light.shape or light.shadows_itself]
    if len(others) < len(shapes):
        reference = replace(reference, occluders=scene_of(others, reference.scene))
    known = read_shapes(reference.occluders)
    if light.kind in ("rectangle", "disk"):
        largest = max(1.0, float(np.abs(known.triangles).max(initial=0)), float(np.abs(light.centre).max()))
        before = (known.triangles - light.centre) @ light.normal > IN_PLANE * largest
        known = replace(known, triangles=known.triangles[before.any(axis=1)])
    return reference, known
