# SPDX-License-Identifier: BSD-3-Clause
"""The shapes of a scene: opaque ones, boundaries of media, and scenes of some of them."""

import mitsuba as mi
import numpy as np

from airlight.errors import InputError


def sorted_shapes(scene: "mi.Scene") -> "tuple[list[mi.Shape], list[mi.Shape]]":
    """Return the opaque shapes and the shapes that bound a medium; all others take no part."""
    opaque, boundaries = [], []
    for shape in scene.shapes():
        inside, outside = shape.interior_medium(), shape.exterior_medium()
        # A surface stops light; a shape of material `null` is the boundary of a medium or nothing.
        # The estimators have no third kind of shape.
        null = shape.bsdf().class_name() == "Null"
        if not null and mi.has_flag(shape.bsdf().flags(), mi.BSDFFlags.Null):
            raise InputError(
                f"shape '{shape.id()}' is partly transparent; expected opaque surfaces, or "
                "material 'null'"
            )
        if not null and (inside is not None or outside is not None):
            raise InputError(
                f"shape '{shape.id()}' bounds a medium and has a {shape.bsdf().class_name()} "
                "material; expected the material 'null' on it, and no media on other shapes"
            )
        if not null:
            opaque.append(shape)
        elif inside is not None:
            boundaries.append(shape)
        elif outside is not None:
            raise InputError(
                f"shape '{shape.id()}' is a hole in a medium; expected media inside of convex "
                "bounds"
            )
    return opaque, boundaries


def metre_of(scene: "mi.Scene") -> float:
    """Return 1 m, or the size of a smaller scene, for steps of rays off surfaces [m]; 1 m without
    shapes.
    """
    box = scene.bbox()
    return min(1.0, float(np.linalg.norm(np.ravel(box.max) - np.ravel(box.min))))


def scene_of(shapes: "list[mi.Shape]", whole: "mi.Scene") -> "mi.Scene":
    """Return a scene of some of the shapes of `whole`, or `whole` itself if these are all of its
    shapes.
    """
    return whole if len(shapes) == len(whole.shapes()) else scene_from(shapes)


def scene_from(shapes: "list[mi.Shape]") -> "mi.Scene":
    """Return a scene of some shapes, which keep their names if these can be keys of a dictionary of
    Mitsuba.
    """
    # The key of a shape becomes its name, in the whole scene too.
    names = {shape.id() for shape in shapes}
    are_keys = len(names) == len(shapes) and not any("." in name or not name for name in names)
    return mi.load_dict(
        {"type": "scene"}
        | {
            shape.id() if are_keys else f"shape{number}": shape
            for number, shape in enumerate(shapes)
        }
    )
