# SPDX-License-Identifier: BSD-3-Clause
"""Parts that the built-in scenes share: meshes, materials, cameras and media for `mi.load_dict`."""

from collections.abc import Sequence
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import ArrayLike, NDArray

from analytic.errors import InputError
from analytic.phase import phase_from_words
from realtime.numerics.aligned import aligned_array

Vertices = NDArray[np.float64]  #: (vertices, 3) [m]
Faces = NDArray[np.int64]  #: (faces, 3), counter-clockwise as seen from outside
Mesh = tuple[Vertices, Faces]


def lathe(radius: ArrayLike, height: ArrayLike, sides: int) -> Mesh:
    """Return the closed surface of a profile turned about the z axis, 2 sides len(radius) triangles.

    Parameters
    ----------
    radius, height
        The profile from bottom to top, (n,) each [m]. Every radius is positive; fans close the ends.
    """
    radius, height = np.asarray(radius, dtype=np.float64), np.asarray(height, dtype=np.float64)
    angle = 2 * np.pi * np.arange(sides) / sides
    circle = np.stack([np.cos(angle), np.sin(angle), np.zeros(sides)], axis=1)
    return skin(radius[:, None, None] * circle + height[:, None, None] * np.array([0.0, 0.0, 1.0]))


def skin(rings: ArrayLike, *, ring_of_rings: bool = False) -> Mesh:
    """Return the closed surface through n rings of k points, 2 k n triangles with or without ends.

    Parameters
    ----------
    rings
        (n, k, 3) [m]. Each ring runs counter-clockwise as seen from the next ring.
    ring_of_rings
        Whether the last ring is joined to the first. Otherwise fans about the mean of a ring close both ends.
    """
    rings = np.asarray(rings, dtype=np.float64)
    count, sides = rings.shape[:2]
    i = np.arange(sides)
    j = (i + 1) % sides
    faces = []
    for ring in range(count if ring_of_rings else count - 1):
        low, high = ring * sides, (ring + 1) % count * sides
        faces += [np.stack([low + i, low + j, high + j], axis=1), np.stack([low + i, high + j, high + i], axis=1)]
    vertices = rings.reshape(-1, 3)
    if not ring_of_rings:
        first, last, end = count * sides, count * sides + 1, (count - 1) * sides
        faces += [
            np.stack([np.full(sides, first), j, i], axis=1),
            np.stack([np.full(sides, last), end + i, end + j], 1),
        ]
        vertices = np.concatenate([vertices, rings[[0, -1]].mean(axis=1)])
    return vertices, np.concatenate(faces)


def grid(corner: Sequence[float], across: Sequence[float], up: Sequence[float], cells: tuple[int, int]) -> Mesh:
    """Return an open rectangle of 2 cells[0] cells[1] triangles; its normal is across x up.

    Parameters
    ----------
    corner, across, up
        A corner and the two edges that start there, (3,) each [m].
    cells
        Number of cells along `across` and along `up`, two triangles each.
    """
    n, m = cells
    u, v = np.meshgrid(np.arange(n + 1) / n, np.arange(m + 1) / m, indexing="ij")
    vertices = np.asarray(corner) + u.reshape(-1, 1) * np.asarray(across) + v.reshape(-1, 1) * np.asarray(up)
    i, j = (index.reshape(-1) for index in np.meshgrid(np.arange(n), np.arange(m), indexing="ij"))
    a, b, c, d = i * (m + 1) + j, (i + 1) * (m + 1) + j, (i + 1) * (m + 1) + j + 1, i * (m + 1) + j + 1
    return vertices, np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])


def rotation(axis: Sequence[float], degrees: float) -> NDArray[np.float64]:
    """Return the matrix, (3, 3), of a rotation about an axis through the origin by an angle [degrees] (Rodrigues)."""
    x, y, z = np.asarray(axis, dtype=np.float64) / np.linalg.norm(axis)
    skew = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    angle = np.deg2rad(degrees)
    return np.eye(3) + np.sin(angle) * skew + (1 - np.cos(angle)) * (skew @ skew)


def placed(mesh: Mesh, position: Sequence[float], turn: NDArray[np.float64] | None = None) -> Mesh:
    """Return a mesh turned about the origin by a matrix, (3, 3), then moved by `position`, (3,) [m]."""
    vertices, faces = mesh
    return (vertices if turn is None else vertices @ turn.T) + np.asarray(position), faces


def scaled(mesh: Mesh, factor: float | Sequence[float]) -> Mesh:
    """Return a mesh scaled about the origin, by one `factor` [1] or by one for each axis, (3,)."""
    vertices, faces = mesh
    return vertices * factor, faces


def joined(meshes: Sequence[Mesh]) -> Mesh:
    """Return several meshes as one, with the parts in the order given."""
    offsets = np.cumsum([0] + [len(vertices) for vertices, _ in meshes[:-1]])
    return (
        np.concatenate([vertices for vertices, _ in meshes]),
        np.concatenate([faces + offset for (_, faces), offset in zip(meshes, offsets)]),
    )


def mitsuba_mesh(name: str, mesh: Mesh, reflectance: Sequence[float]):
    """Return a Mitsuba mesh with flat shading and a two-sided diffuse material of RGB `reflectance` [1], 0 to 1."""
    diffuse = {"type": "diffuse", "reflectance": {"type": "rgb", "value": list(reflectance)}}
    return mesh_with_material(name, mesh, {"type": "twosided", "bsdf": diffuse})


def mesh_with_material(name: str, mesh: Mesh, material):
    """Return a Mitsuba mesh with flat shading and a `material`, a dictionary or Mitsuba's own."""
    return _mesh(name, mesh, {"mesh_bsdf": material})


def medium_boundary(name: str, mesh: Mesh, medium: Any, around: Any = None):
    """Return a Mitsuba mesh of the material `null` around a medium, the boundary of a bounded medium.

    Parameters
    ----------
    medium, around
        What is inside of it, and outside where that is no clear air: dictionaries or media of Mitsuba.
    """
    inside = medium | {"id": f"{name}-medium"} if isinstance(medium, dict) else medium
    outside = {} if around is None else {"exterior": around}
    return _mesh(name, mesh, {"mesh_bsdf": {"type": "null"}, "interior": inside} | outside)


def _mesh(name: str, mesh: Mesh, plugins: dict[str, Any]):
    properties = mi.Properties()
    for key, plugin in plugins.items():
        properties[key] = mi.load_dict(plugin) if isinstance(plugin, dict) else plugin
    vertices, faces = mesh
    result = mi.Mesh(name, vertex_count=len(vertices), face_count=len(faces), props=properties)
    parameters = mi.traverse(result)
    parameters["vertex_positions"] = aligned_array(mi.Float, vertices.astype(np.float32).ravel())
    parameters["faces"] = aligned_array(mi.UInt32, faces.astype(np.uint32).ravel())
    parameters.update()
    return result


def fog(
    sigma_t: float | Sequence[float], albedo: Sequence[float], phase: dict[str, Any] | None = None
) -> dict[str, Any]:
    """Return a homogeneous medium with the id 'fog'.

    Parameters
    ----------
    sigma_t
        Extinction, grey or RGB [1/m].
    phase
        Dictionary of the phase function; isotropic by default.
    """
    grey = isinstance(sigma_t, float)
    channels = [sigma_t] if isinstance(sigma_t, float) else list(sigma_t)
    scale = max(channels)
    return {
        "type": "homogeneous",
        "id": "fog",
        # Mitsuba wants rgb values in [0, 1], so the scale carries the magnitude.
        "sigma_t": 1.0 if grey else {"type": "rgb", "value": [value / scale for value in channels]},
        "scale": scale,
        "has_spectral_extinction": not grey,
        "albedo": {"type": "rgb", "value": list(albedo)},
        "phase": phase or {"type": "isotropic"},
    }


def tabulated_phase(words: str, values: int = 2001) -> dict[str, Any]:
    """Return any phase function as a table, which Mitsuba and both readers of scenes take; 'mie' has no other plugin.

    Each value is the mean of the function under the hat of its cosine: the table has the same mean, 1, is nowhere below
    0, and blurs a peak by a cell, which beside the forward direction is the angle acos(1 - 2/(values - 1)), 2.6 degrees
    for 2001 values and 0.8 for 20001. Mitsuba, truth and methods then agree on the table, blur included.

    Parameters
    ----------
    words
        The function, see `analytic.phase.phase_from_words`.
    values
        How many, at regularly spaced cosines; the truth of a scene takes a time in proportion.

    Raises
    ------
    InputError
        As `phase_from_words`, and for fewer than 2 values.
    """
    if values < 2:
        raise InputError(f"the table of '{words}' has {values} values; wanted at least 2")
    phase = phase_from_words(words)
    nodes, weights = np.polynomial.legendre.leggauss(32)
    t = 0.5 * (nodes + 1)
    cell = np.arange(values - 1)[:, None]
    up = (cell + t) / (values - 1)  # (1 + cos)/2
    down = (values - 2 - cell + (1 - t)) / (values - 1)
    p = phase.from_half(down, up)
    hats = np.zeros(values)
    hats[:-1] += 0.5 * p @ (weights * (1 - t))
    hats[1:] += 0.5 * p @ (weights * t)
    hats[[0, -1]] *= 2
    return {"type": "tabphase", "values": ", ".join(repr(float(value)) for value in hats)}


def point_light(position: Sequence[float], intensity: Sequence[float]) -> dict[str, Any]:
    """Return a point light at `position`, (3,) [m], with the RGB `intensity`, (3,) [W/sr]."""
    return {"type": "point", "position": list(position), "intensity": {"type": "rgb", "value": list(intensity)}}


def area_lamp(
    shape: str,
    position: Sequence[float],
    target: Sequence[float],
    size: float | tuple[float, float],
    radiance: Sequence[float],
) -> dict[str, Any]:
    """Return a black light with extent, of constant radiance.

    Parameters
    ----------
    shape
        'rectangle' or 'disk', which shine on one side, or 'sphere'.
    position, target
        Its middle and a point that it faces, (3,) each [m].
    size
        The radius, or half of both sides of a rectangle [m].
    radiance
        RGB, (3,) [W/(m^2 sr)].
    """
    across, up = size if isinstance(size, tuple) else (size, size)
    turned = mi.ScalarTransform4f().look_at(origin=list(position), target=list(target), up=[0, 0, 1])
    return {
        "type": shape,
        "to_world": turned @ mi.ScalarTransform4f().scale([across, up, min(across, up)]),
        "material": {"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.0, 0.0, 0.0]}},
        "emitter": {"type": "area", "radiance": {"type": "rgb", "value": list(radiance)}},
    }


def camera(
    origin: Sequence[float],
    target: Sequence[float],
    *,
    fov: float,
    size: tuple[int, int],
    in_fog: bool = True,
) -> dict[str, Any]:
    """Return a perspective sensor whose up is z.

    Parameters
    ----------
    origin, target
        Where the camera is and a point that it looks at, (3,) each [m].
    fov
        Horizontal field of view [degrees].
    size
        Width and height of the image [pixels].
    in_fog
        Whether the camera is in the medium with the id 'fog' or in clear air.
    """
    medium = {"medium": {"type": "ref", "id": "fog"}} if in_fog else {}
    return medium | {
        "type": "perspective",
        "fov": fov,
        "fov_axis": "x",
        "near_clip": 1e-5,
        "far_clip": 1e5,
        "to_world": mi.ScalarTransform4f().look_at(origin=list(origin), target=list(target), up=[0, 0, 1]),
        "film": {
            "type": "hdrfilm",
            "width": size[0],
            "height": size[1],
            "rfilter": {"type": "box"},
            "component_format": "float32",
        },
    }
