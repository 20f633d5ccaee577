# SPDX-License-Identifier: BSD-3-Clause
"""The shapes of a scene: opaque ones, boundaries of media, and scenes of some of them."""

from collections.abc import Sequence

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


def scene_from(parts: "Sequence[mi.Object]") -> "mi.Scene":
    """Return a scene of parts of another one, such as shapes, which keep their names."""
    names = [part.id() for part in parts]
    # Mitsuba names the parts of a dictionary by their keys: the old names are given back.
    scene = mi.load_dict(
        {"type": "scene"} | {f"part{number}": part for number, part in enumerate(parts)}
    )
    for part, name in zip(parts, names, strict=True):
        part.set_id(name)
    return scene
