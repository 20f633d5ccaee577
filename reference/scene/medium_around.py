# SPDX-License-Identifier: BSD-3-Clause
"""The medium around the camera: homogeneous, height fog, a density grid, or a vacuum."""

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from airlight.errors import InputError
from airlight.reference.scene.convex_bounds import holds, in_surface, read_bounds
from airlight.reference.scene.homogeneous_medium import (
    VACUUM,
    BoundedMedium,
    ReferenceMedium,
    read_medium,
    read_scattering,
)
from airlight.reference.scene.varying import (
    GridMedium,
    VaryingMedium,
    is_grid,
    is_height_fog,
    read_grid,
    read_height_fog,
)

Array = NDArray[np.float64]


def read_ambient(
    sensor: "mi.Sensor",
    origin: Array,
    media: tuple[BoundedMedium, ...],
    boundaries: "list[mi.Shape]",
) -> ReferenceMedium | VaryingMedium:
    """Return the medium around all bounds; refuse a camera or a shape that names another."""
    camera_medium = sensor.get_medium()
    # The camera may be in one of the bounded media: the medium around is then the exterior of that
    # shape.
    ambient = camera_medium
    for medium, shape in zip(media, boundaries, strict=True):
        if in_surface(medium.bounds, origin):
            raise InputError(
                f"the camera is in the surface of shape '{medium.name}'; move it off, inside or "
                "outside"
            )
        if holds(medium.bounds, origin):
            if camera_medium != medium.plugin:
                raise InputError(
                    f"the camera is inside of shape '{medium.name}', but references another medium "
                    "or none; reference that shape's interior medium in the sensor"
                )
            ambient = shape.exterior_medium()
    # All bounded media lie in one and the same medium.
    for medium, shape in zip(media, boundaries, strict=True):
        if shape.exterior_medium() != ambient:
            raise InputError(
                f"the exterior medium of shape '{medium.name}' is not what surrounds the others or "
                "the camera; expected the medium that the camera references as exterior of all "
                "shapes, or none at all"
            )
    if is_height_fog(ambient) or is_grid(ambient):
        kind = "height fog" if is_height_fog(ambient) else "a density grid"
        # Height fog and grids are alone: bodies in them would need integrals of both.
        if media:
            raise InputError(
                f"shape '{media[0].name}' bounds a medium in {kind}; expected {kind} alone: remove "
                "the medium of the shape, or take a medium of type 'homogeneous' around it"
            )
        read_varying = read_height_fog if is_height_fog(ambient) else read_grid
        return read_varying(ambient, *read_scattering(ambient))
    if ambient is not None:
        return read_medium(ambient, "the medium")
    if not media:
        raise InputError(
            "the camera references no medium: it would be in a vacuum; reference the medium in the "
            "sensor"
        )
    return VACUUM


def grid_in_a_shape(
    sensor: "mi.Sensor", boundaries: "list[mi.Shape]", origin: Array
) -> GridMedium | None:
    """Return a density grid in vacuum if the scene's only boundary holds the whole box of the grid:
    the grid ends at its box, and the boundary bounds nothing.
    """
    shape = boundaries[0] if len(boundaries) == 1 else None
    if shape is None or shape.exterior_medium() is not None or not is_grid(shape.interior_medium()):
        return None
    camera_medium, inside = sensor.get_medium(), shape.interior_medium()
    grid = read_grid(inside, *read_scattering(inside))
    low, high = (
        np.array(corner, dtype=np.float64).ravel()
        for corner in (shape.bbox().min, shape.bbox().max)
    )
    # The shape may be smaller than the box by 1e-5 of a side: its numbers are rounded. The test of
    # the bounding box is quick; the shape itself must then hold all eight corners of the grid,
    # drawn in by 1e-5 on each side.
    fraction = 1e-5
    margin = fraction * (grid.high - grid.low)
    if np.any(low > grid.low + margin) or np.any(high < grid.high - margin):
        return None
    bounds, middle = read_bounds(shape), 0.5 * (grid.low + grid.high)
    corners = np.array(np.meshgrid(*zip(grid.low, grid.high, strict=True))).reshape(3, 8).T
    if not all(
        holds(bounds, middle + (1 - 2 * fraction) * (corner - middle)) for corner in corners
    ):
        return None
    # A camera in the shape must reference the grid's medium. A camera outside may reference it,
    # since the grid is vacuum beyond its box.
    if camera_medium not in ((inside,) if holds(bounds, origin) else (None, inside)):
        raise InputError(
            f"the camera references another medium than that of shape '{shape.id()}', a density "
            "grid, or is in the shape and references none; expected that medium"
        )
    return grid
