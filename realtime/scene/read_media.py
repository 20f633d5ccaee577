# SPDX-License-Identifier: BSD-3-Clause
"""Reading the media of a Mitsuba scene: what surrounds the camera, and what shapes bound.

A shape with the material `null` and an interior medium is the boundary of a medium: light passes
it, and nothing of it is visible. All of them lie in one medium, the camera's own or, for a camera
inside one of them, its exterior; none is a vacuum. In vacuum a boundary may be any closed mesh, a
cloud, and its medium may have a density from place to place.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from airlight.errors import InputError
from airlight.realtime.numerics.array_types import ArrayTypes, aligned_array
from airlight.realtime.scene.closed_mesh import (
    Bounds,
    ClosedMesh,
    encloses,
    holds,
    mean_distance,
    plane_neighbours,
    radial_planes,
    read_bounds,
    touches,
)
from airlight.realtime.scene.density import (
    DensityGrid,
    along_the_axes,
    density_on_device,
    read_cloud_density,
    read_density,
)
from airlight.realtime.scene.media.bounded import BoundedMedia, Clouds
from airlight.realtime.scene.media.density_grid import GridMedium
from airlight.realtime.scene.media.facet_paths import BoundedMedium
from airlight.realtime.scene.media.height_fog import HeightFog, Layer
from airlight.realtime.scene.media.medium import Homogeneous, Medium
from airlight.realtime.scene.mesh_adjacency import scene_of
from airlight.realtime.scene.phase import HenyeyGreenstein, Isotropic, Phase, named_phase, tabulated
from airlight.realtime.transforms import host_matrix

_PHASES = {
    "IsotropicPhaseFunction": "isotropic",
    "HGPhaseFunction": "hg",
    "RayleighPhaseFunction": "rayleigh",
    "TabulatedPhaseFunction": "tabulated",
}


def sort_shapes(scene):
    """Return the opaque shapes of a scene and the shapes that bound a medium.

    Raises InputError for a shape that is transparent or bounds a medium in a way that no method
    can render, with its name.
    """
    # Any other shape is refused by name, with the reason.
    opaque, boundaries = [], []
    for shape in scene.shapes():
        bsdf, name = shape.bsdf(), shape.id()
        if shape.is_emitter() and bsdf.class_name() == "Null":
            continue  # light and nothing else: `realtime.area_lights.shape` says what it must be
        # An opaque shape has no media on its sides, and a transparent one has one inside of it.
        bounds = shape.interior_medium() is not None or shape.exterior_medium() is not None
        if bsdf.class_name() != "Null":
            if bounds:
                raise InputError(
                    f"shape '{name}' bounds a medium and has a {bsdf.class_name()} material; "
                    "expected the material "
                    "'null' on it, and no media on other shapes"
                )
            if mi.has_flag(bsdf.flags(), mi.BSDFFlags.Null):
                raise InputError(
                    f"shape '{name}' is partly transparent; expected opaque surfaces or material "
                    "'null'"
                )
            opaque.append(shape)
        elif shape.interior_medium() is not None:
            boundaries.append(shape)
        elif bounds:
            raise InputError(
                f"shape '{name}' is a hole in a medium; expected media inside of closed bounds"
            )
        else:
            raise InputError(
                f"shape '{name}' is transparent and bounds no medium; expected opaque surfaces: "
                "remove it"
            )
    return opaque, boundaries


def opaque_scene(scene, opaque):
    """Return the scene itself where all shapes are opaque and lights few, else one of opaque
    shapes, under their names.

    A call of a recorded function goes over all lights of the scene in it: 512 took 20 ms.
    """
    few = 4  # lights of a scene that every call may go over
    if len(opaque) == len(scene.shapes()) and len(scene.emitters()) <= few:
        return scene
    return scene_of(opaque)


def read_medium(sensor, boundaries, types: ArrayTypes) -> Medium:
    """Return the medium of a scene with the bounded media in it.

    It has `clouds` in vacuum, whatever the bounds, and `bounded_media` only where all bounds are
    convex and all media homogeneous.

    Parameters
    ----------
    sensor
        Mitsuba's sensor.
    boundaries
        The shapes that bound media.
    types
        Array types to compute with.

    Raises
    ------
    InputError
        For media that no method can render, with the name of what is in the way.
    """
    # One medium without bounds, around the camera: height fog, a grid, or the same everywhere.
    if not boundaries:
        if sensor.get_medium() is None:
            raise InputError(
                "the camera references no medium: it would be in a vacuum; declare the medium with "
                "an id and put "
                '<ref name="medium" id="..."/> inside the sensor'
            )
        if _is_height_fog(sensor.get_medium()):
            return _height_fog(sensor.get_medium(), types)
        if not sensor.get_medium().is_homogeneous() and "sigma_t.data" in mi.traverse(
            sensor.get_medium()
        ):
            return _grid_medium(sensor.get_medium(), types)
        return _homogeneous(sensor.get_medium(), types)
    for shape in boundaries:
        for medium in (shape.interior_medium(), shape.exterior_medium()):
            if _is_height_fog(medium):
                raise InputError(
                    f"shape '{shape.id()}' bounds a medium in height fog, or height fog; expected "
                    "height fog alone, in "
                    "the sensor: remove the medium of the shape"
                )

    # Convex bounds of homogeneous media are half spaces, which rays are clipped to. One concave
    # shape, or one medium with a density, makes all of them clouds within meshes.
    shapes = [read_bounds(shape) for shape in boundaries]
    bounds = [convex for convex, _ in shapes if convex is not None]
    uneven = [shape.id() for shape in boundaries if not shape.interior_medium().is_homogeneous()]
    all_convex = len(bounds) == len(boundaries) and not uneven
    meshes = () if all_convex else _closed_meshes(shapes, uneven)

    # All bounded media lie in one, or in vacuum; clouds lie in vacuum.
    around = _surrounding(sensor, boundaries, meshes or bounds)
    if around is not None and not all_convex:
        raise InputError(
            f"shape '{_first_cloud(shapes, uneven)}' bounds a medium within another one and is not "
            "convex, or that "
            "medium is not homogeneous; expected vacuum around it: remove the exterior medium, and "
            "the camera's"
        )

    # The medium inside of each boundary, with the grid of its density if it has one.
    grids = [
        read_cloud_density(shape.interior_medium(), meshes[number])
        if meshes and meshes[number].name in uneven
        else None
        for number, shape in enumerate(boundaries)
    ]
    media = [
        _filling(shape.interior_medium(), grid, types)
        for shape, grid in zip(boundaries, grids, strict=True)
    ]

    # If one medium is coloured, all have three extinctions; vacuum is a medium without any.
    ambient = _clear(types) if around is None else _homogeneous(around, types)
    channels = max(len(medium.sigma_t) for medium in [ambient, *media])
    media = [_in_channels(medium, channels) for medium in media]
    bounded_media = (
        tuple(
            make_bounded_medium(medium, own_bounds, types)
            for medium, own_bounds in zip(media, bounds)
        )
        if all_convex
        else ()
    )
    # In vacuum all of them are clouds as well, for methods that render clouds.
    clouds = _clouds(media, boundaries, types) if around is None else None
    if clouds is not None and uneven:
        clouds = replace(clouds, density=density_on_device(grids, types))
    ambient = _in_channels(ambient, channels)
    surrounding = ambient.sigma_t, ambient.albedo, ambient.phase
    return BoundedMedia(*surrounding, bounded_media, clear=around is None, clouds=clouds)


def _closed_meshes(
    shapes: Sequence[tuple[Bounds | None, ClosedMesh | None]], uneven: Sequence[str]
) -> tuple[ClosedMesh, ...]:
    """Return the meshes of shapes; one shape at least is not convex, or is named in `uneven`."""
    # Rays are cast at clouds as meshes: a sphere has none.
    for bounds, mesh in shapes:
        if mesh is None and bounds is not None:
            cloud = _first_cloud(shapes, uneven)
            flaw = "bounds a heterogeneous medium" if cloud in uneven else "is not convex"
            raise InputError(
                f"shape '{bounds.name}' is a sphere, and shape '{cloud}' {flaw}; expected meshes "
                "for all of them: "
                "replace the sphere by a mesh"
            )
    return tuple(mesh for _, mesh in shapes if mesh is not None)


def _first_cloud(
    shapes: Sequence[tuple[Bounds | None, ClosedMesh | None]], uneven: Sequence[str]
) -> str:
    concave = (mesh.name for bounds, mesh in shapes if bounds is None and mesh is not None)
    return next(iter((*concave, *uneven)))


def _clouds(media: list[Homogeneous], boundaries, types: ArrayTypes) -> Clouds:
    """Return bounded media as tables with an entry for each; equal phase functions are one."""
    # A cloud has the number of its phase function: several clouds may share one.
    keys = [_phase_key(shape.interior_medium().phase_function()) for shape in boundaries]
    distinct = list(dict.fromkeys(keys))
    # By channel one extinction for each cloud, and by colour one albedo.
    sigma_t = tuple(
        types.scalar([float(medium.sigma_t[channel][0]) for medium in media])
        for channel in range(len(media[0].sigma_t))
    )
    albedos = np.stack(
        [np.array(medium.albedo, dtype=np.float64).ravel() for medium in media], axis=1
    )
    albedo = types.color(*(aligned_array(types.scalar, column) for column in albedos))
    number = mi.UInt32([distinct.index(key) for key in keys])
    dr.make_opaque(sigma_t, albedo, number)
    return Clouds(sigma_t, albedo, tuple(media[keys.index(key)].phase for key in distinct), number)


def _phase_key(phase) -> tuple[Any, ...]:
    """Return a key that equal phase functions share."""
    parameters = mi.traverse(phase)
    names = sorted(parameters.keys())
    return phase.class_name(), *(
        np.array(parameters[name], dtype=np.float64).tobytes() for name in names
    )


def _surrounding(sensor, boundaries, bounds: Sequence[Bounds | ClosedMesh]):
    """Return the Mitsuba medium around the bounded ones, or None; refuse a camera or
    boundary that says otherwise.
    """
    camera = host_matrix(sensor.world_transform())[:3, 3]
    around = sensor.get_medium()
    # The medium around is the camera's, or the exterior one of the boundary that the camera is in.
    for shape, own_bounds in zip(boundaries, bounds):
        if isinstance(own_bounds, Bounds) and touches(own_bounds, camera):
            raise InputError(
                f"the camera is in the surface of shape '{own_bounds.name}'; move it off, inside "
                "or outside"
            )
        inside = (
            encloses(own_bounds, camera)
            if isinstance(own_bounds, ClosedMesh)
            else holds(own_bounds, camera)
        )
        if inside:
            if sensor.get_medium() != shape.interior_medium():
                raise InputError(
                    f"the camera is inside of shape '{own_bounds.name}', but references another "
                    "medium or none; "
                    "reference that shape's interior medium in the sensor"
                )
            around = shape.exterior_medium()
    # Every boundary has the same medium outside.
    for shape, own_bounds in zip(boundaries, bounds):
        if shape.exterior_medium() != around:
            raise InputError(
                f"the exterior medium of shape '{own_bounds.name}' is not what surrounds the "
                "camera or the others; "
                "expected one medium around all bounded media, or none at all"
            )
    return around


def make_bounded_medium(medium: Homogeneous, bounds: Bounds, types: ArrayTypes) -> BoundedMedium:
    """Return a medium within bounds."""
    centre = types.vector(*(float(c) for c in bounds.centre))
    radius, distance = (
        dr.opaque(types.scalar, value) for value in (bounds.radius, mean_distance(bounds))
    )
    dr.make_opaque(centre)
    bounded_medium = BoundedMedium(medium, None, len(bounds.offsets), centre, radius, distance)
    if bounds.is_sphere:
        return bounded_medium
    # Half spaces about the centre of the body, from which paths are computed: normal and distance
    # side by side.
    distances = bounds.offsets - bounds.normals @ bounds.centre
    rows = np.column_stack([bounds.normals, distances])
    # For walks from facet to facet: the numbers of neighbours, their planes once more beside each
    # other, and where walks begin.
    table = plane_neighbours(bounds)
    neighbours = aligned_array(mi.UInt32, table.ravel().astype(np.uint32))
    starts = aligned_array(mi.UInt32, radial_planes(bounds))
    planes, beside = (aligned_array(types.scalar, part.ravel()) for part in (rows, rows[table]))
    dr.eval(neighbours, planes, beside, starts)
    return replace(
        bounded_medium,
        planes=planes,
        neighbours=neighbours,
        beside=beside,
        sides=table.shape[1],
        starts=starts,
    )


def _clear(types: ArrayTypes) -> Homogeneous:
    # Vacuum as a medium without extinction.
    albedo = types.color(0.0)
    dr.make_opaque(albedo)
    return Homogeneous((dr.opaque(types.scalar, 0.0),), albedo, Isotropic())


def _in_channels(medium: Homogeneous, channels: int) -> Homogeneous:
    """Return a grey medium with its extinction repeated: media of one scene have equally many."""
    if len(medium.sigma_t) == channels:
        return medium
    (grey,) = medium.sigma_t
    # Each channel has its own array: a recorded frame tells arrays that are one
    # from arrays that are equal.
    return replace(
        medium, sigma_t=tuple(dr.opaque(type(grey), float(grey[0])) for _ in range(channels))
    )


def _filling(medium, grid: DensityGrid | None, types: ArrayTypes) -> Homogeneous:
    """Return the medium of a boundary, one with a grid by its largest extinction."""
    if grid is None:
        return _homogeneous(medium, types)
    largest, phase = (
        dr.opaque(types.scalar, grid.largest),
        _read_phase(medium.phase_function(), types),
    )
    return Homogeneous((largest,), _constant_albedo(medium, types), phase)


def _constant_albedo(medium, types: ArrayTypes, extinguishes: Any = True):
    """Return the albedo of a medium, a colour that is the same everywhere; 0 where nothing
    `extinguishes`: such a channel needs no transport.
    """
    _require_constant(medium, "albedo")
    albedo = np.broadcast_to(
        np.array(mi.traverse(medium)["albedo.value.value"], dtype=np.float64).reshape(-1), 3
    )
    albedo = np.where(extinguishes, albedo, 0)
    _check_albedo(albedo)
    color = types.color(*(float(value) for value in albedo))
    dr.make_opaque(color)
    return color


def _require_constant(medium, *coefficients: str) -> None:
    """Refuse coefficients that are not the same everywhere: Mitsuba calls a medium
    homogeneous by its extinction.
    """
    for name in coefficients:
        if not any(key.startswith(f"{name}.value.") for key in mi.traverse(medium).keys()):  # noqa: SIM118 - of pairs
            raise InputError(
                f"medium '{medium.id()}': its {name} differs from place to place; expected one "
                "number or one 'rgb'"
            )


def _check_albedo(albedo) -> None:
    if not np.all((albedo >= 0) & (albedo <= 1 + 1e-6)):
        raise InputError(
            f"the medium's albedo is {np.round(albedo, 6).tolist()}; expected values from 0 to 1"
        )


def _check_coefficient(name: str, values) -> None:
    if not np.all(np.isfinite(values) & (values >= 0)):
        given = np.asarray(values).tolist()
        raise InputError(
            f"the medium's {name} is {given}; expected finite values of 0 or more [1/m]"
        )


def _is_height_fog(medium) -> bool:
    return medium is not None and "sigma_t.H_1" in mi.traverse(medium)


def _height_fog(medium, types: ArrayTypes) -> HeightFog:
    """Read a medium whose extinction is a volume of type `heightfog`, which
    answers for its numbers.
    """
    # Mitsuba multiplies the extinctions of the volume by the medium's scale.
    parameters = mi.traverse(medium)
    scale = float(parameters["scale"])
    for name in ("sigma_0", "sigma_1", "sigma_2"):
        _check_coefficient(f"scale times {name}", scale * float(parameters[f"sigma_t.{name}"][0]))

    def number(name: str, factor: float = 1.0):
        return dr.opaque(types.scalar, factor * float(parameters[f"sigma_t.{name}"][0]))

    # Layers without extinction are left out: they cost an exponential each.
    layers = tuple(
        Layer(number(f"sigma_{i}", scale), number(f"z_{i}"), number(f"H_{i}"))
        for i in "12"
        if float(parameters[f"sigma_t.sigma_{i}"][0]) > 0
    )
    color = _constant_albedo(medium, types)
    up = types.vector(*(float(each) for each in np.array(parameters["sigma_t.up"]).ravel()))
    dr.make_opaque(up)
    clamped = bool(parameters["sigma_t.clamped"][0])
    ends, phase = (number("floor"), number("cap")), _read_phase(medium.phase_function(), types)
    return HeightFog(layers, number("sigma_0", scale), clamped, *ends, up, color, phase)


def _grid_medium(medium, types: ArrayTypes) -> GridMedium:
    """Read a grid around the camera, in a box along the axes of coordinates."""
    name = f"medium '{medium.id()}'"
    albedo, grid = _constant_albedo(medium, types), along_the_axes(read_density(medium, name), name)
    # Along the axes the transform to the unit cube is u = side x + constant: u = 0 is the low
    # corner of the box, and 1/side its width.
    sides = np.diag(grid.to_grid)
    corner = -grid.to_grid[:, 3] / sides
    low, high = (
        types.vector(*(float(each) for each in end)) for end in (corner, corner + 1 / sides)
    )
    dr.make_opaque(low, high)
    density, largest = density_on_device([grid], types), dr.opaque(types.scalar, grid.largest)
    return GridMedium(
        density, largest, low, high, albedo, _read_phase(medium.phase_function(), types)
    )


def _homogeneous(medium, types: ArrayTypes) -> Homogeneous:
    if not medium.is_homogeneous():
        raise InputError("the medium is heterogeneous; expected a medium of type 'homogeneous'")
    _require_constant(medium, "sigma_t")
    _, _, sigma_t = medium.get_scattering_coefficients(dr.zeros(mi.MediumInteraction3f))
    extinction = np.array(sigma_t, dtype=np.float64).reshape(-1)
    _check_coefficient("sigma_t", extinction)
    # Grey media compute with one extinction instead of three.
    grey = extinction[0] == extinction[1] == extinction[2]
    sigma = tuple(
        dr.opaque(types.scalar, float(value)) for value in (extinction[:1] if grey else extinction)
    )
    phase = _read_phase(medium.phase_function(), types)
    return Homogeneous(sigma, _constant_albedo(medium, types, extinction > 0), phase)


def _read_phase(phase, types: ArrayTypes) -> Phase:
    name = _PHASES.get(phase.class_name())
    if name is None:
        raise InputError(
            f"the phase function is a {phase.class_name()}; expected one of isotropic, hg, "
            "rayleigh, tabphase"
        )
    # Isotropic and Rayleigh functions have no parameters; the other two have them read and checked.
    parameters = mi.traverse(phase)
    if name == "hg":
        g = float(parameters["g"][0])
        if not abs(g) < 1:
            raise InputError(
                f"the phase function's g is {g:g}; expected a mean cosine between -1 and 1"
            )
        return HenyeyGreenstein(dr.opaque(types.scalar, g))
    if name == "tabulated":
        values = np.array(parameters["values"], dtype=np.float64)
        # The mean over the sphere is half the integral over the cosine: the trapezoidal rule
        # is exact on linear pieces.
        mean = (values.sum() - 0.5 * (values[0] + values[-1])) / (len(values) - 1)
        return tabulated(aligned_array(types.scalar, values / mean))
    return named_phase(name)
