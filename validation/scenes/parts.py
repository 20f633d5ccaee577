# SPDX-License-Identifier: BSD-3-Clause
"""The parts of scenes, for `mi.load_dict`: shapes of meshes, media, phase
functions, lights and cameras.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import mitsuba as mi
import numpy as np

from airlight.analytic.phase import phase_from_words
from airlight.errors import InputError
from airlight.realtime.numerics.array_types import aligned_array
from airlight.validation.scenes.meshes import Mesh

#: The dictionary of a Mitsuba plugin, as `mi.load_dict` takes it: 'type' has the name of the
#: plugin, and other keys its properties (numbers, words, lists of numbers, transforms) and the
#: plugins within it, as such dictionaries or as Mitsuba's own objects.
Plugin = dict[str, object]


def mitsuba_mesh(name: str, mesh: Mesh, reflectance: Sequence[float]) -> mi.Mesh:
    """Return a Mitsuba mesh with flat shading and a two-sided diffuse material of RGB
    `reflectance` [1], 0 to 1.
    """
    diffuse = {"type": "diffuse", "reflectance": {"type": "rgb", "value": list(reflectance)}}
    return mesh_with_material(name, mesh, {"type": "twosided", "bsdf": diffuse})


def mesh_with_material(name: str, mesh: Mesh, material: Plugin | mi.BSDF) -> mi.Mesh:
    """Return a Mitsuba mesh with flat shading and a `material`."""
    return _mesh(name, mesh, {"mesh_bsdf": material})


def medium_boundary(
    name: str, mesh: Mesh, medium: Plugin | mi.Medium, around: mi.Medium | None = None
) -> mi.Mesh:
    """Return a Mitsuba mesh of the material `null` that bounds a medium.

    `around`: the medium outside; None for vacuum.
    """
    # A medium of a dictionary gets an id, so that messages and changes can name it.
    inside = medium | {"id": f"{name}-medium"} if isinstance(medium, dict) else medium
    plugins: Plugin = {"mesh_bsdf": {"type": "null"}, "interior": inside}
    return _mesh(name, mesh, plugins if around is None else plugins | {"exterior": around})


def _mesh(name: str, mesh: Mesh, plugins: Plugin) -> mi.Mesh:
    properties = mi.Properties()
    for key, plugin in plugins.items():
        properties[key] = mi.load_dict(plugin) if isinstance(plugin, dict) else plugin
    vertices, faces = mesh
    result = mi.Mesh(name, vertex_count=len(vertices), face_count=len(faces), props=properties)
    # Aligned arrays: kernels are compiled for the alignment of what they read.
    parameters = mi.traverse(result)
    parameters["vertex_positions"] = aligned_array(mi.Float, vertices.astype(np.float32).ravel())
    parameters["faces"] = aligned_array(mi.UInt32, faces.astype(np.uint32).ravel())
    parameters.update()
    return result


def fog(
    sigma_t: float | Sequence[float], albedo: Sequence[float], phase: Plugin | None = None
) -> Plugin:
    """Return a homogeneous medium with the id 'fog', of grey or RGB extinction
    [1/m], isotropic by default.
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


def height_fog(
    layers: Sequence[Sequence[float]],
    floor: float,
    cap: float,
    *,
    albedo: Sequence[float],
    phase: Plugin,
    clamped: bool = False,
) -> Plugin:
    """Return height fog with the id 'fog': one or two layers of extinction [1/m],
    base and scale height [m].

    `floor` and `cap` are the heights where it ends [m]; `clamped` layers are constant below their
    bases.
    """
    numbers = {
        f"{name}_{i}": value
        for i, layer in enumerate(layers, 1)
        for name, value in zip(("sigma", "z", "H"), layer)
    }
    # Only the height of the box counts: the volume widens it.
    box = mi.ScalarTransform4f().translate([0, 0, floor]).scale([1, 1, cap - floor])
    return {
        "type": "heterogeneous",
        "id": "fog",
        "sigma_t": {"type": "heightfog", "to_world": box, "clamped": clamped} | numbers,
        "has_spectral_extinction": False,  # see `validation.scenes.files.media.grey_densities`
        "albedo": {"type": "rgb", "value": list(albedo)},
        "phase": phase,
    }


def phase_function(words: str, values: int) -> Plugin:
    """Return a phase function from words such as 'hg:0.37'; a table of so many `values` where
    Mitsuba has no other plugin.
    """
    name, _, number = words.partition(":")
    if name == "hg":
        return {"type": "hg", "g": float(number)}
    return {"type": name} if name in ("isotropic", "rayleigh") else tabulated_phase(words, values)


def tabulated_phase(words: str, values: int = 2001) -> Plugin:
    """Return any phase function as a table, which Mitsuba and both readers of scenes take.

    Each value is the mean of the function under the hat of its cosine: the table has the same mean,
    1, is nowhere below 0, and blurs a peak by a cell, which beside the forward direction is the
    angle acos(1 - 2/(values - 1)), 2.6 degrees for 2001 values and 0.8 for 20001. Mitsuba,
    reference and methods then agree on the table, blur included.

    The words are those of `analytic.phase.phase_from_words`, the values lie at regularly spaced
    cosines; the reference of a scene takes a time in proportion to their number.
    """
    if values < 2:
        raise InputError(f"the table of '{words}' has {values} values; expected at least 2")
    phase = phase_from_words(words)
    nodes, weights = np.polynomial.legendre.leggauss(32)
    # Gauss-Legendre nodes within each cell between two cosines. Each value is the integral of the
    # function times its hat: rising over the cell before, falling over the cell after.
    t = 0.5 * (nodes + 1)
    cell = np.arange(values - 1)[:, None]
    # (1 + cos)/2 and (1 - cos)/2 are each computed without cancellation: a narrow peak needs the
    # digits of 1 - cos near the forward direction.
    up = (cell + t) / (values - 1)  # (1 + cos)/2
    down = (values - 2 - cell + (1 - t)) / (values - 1)
    p = phase.from_half(down, up)
    hats = np.zeros(values)
    hats[:-1] += 0.5 * p @ (weights * (1 - t))
    hats[1:] += 0.5 * p @ (weights * t)
    # The hats at both ends have one side only, half the area.
    hats[[0, -1]] *= 2
    return {"type": "tabphase", "values": ", ".join(repr(float(value)) for value in hats)}


def light(type: str, colour: Sequence[float], **properties: Any) -> Plugin:
    """Return a light of a type and a colour, RGB, by the keys of a scene's table.

    'point' and 'spot' have an intensity [W/sr], a 'sun' an irradiance [W/m^2]; 'rectangle', 'disk',
    'sphere' and 'sky' a radiance [W/(m^2 sr)]. All but sun and sky need a `position`, (3,) [m]; all
    but these and points a `target`, (3,) [m]. A spot needs the half angles `cutoff` and `beam`
    [degrees], and perhaps `up`; a sun the `direction` of its light; others the `size` as of
    `area_lamp`, and `opaque`, which is false for a light that only shines.
    """
    match type:
        case "point":
            return point_light(properties["position"], colour)
        case "spot":
            return spot_light(colour, **properties)
        case "sun":
            return sun(properties["direction"], colour)
        case "sky":
            return sky(colour)
    lamp = area_lamp(type, properties["position"], properties["target"], properties["size"], colour)
    return lamp if properties.get("opaque", True) else lamp | {"material": {"type": "null"}}


def spot_light(
    intensity: Sequence[float],
    *,
    position: Sequence[float],
    target: Sequence[float],
    cutoff: float,
    beam: float,
    up: Sequence[float] = (0, 0, 1),
) -> Plugin:
    """Return a spot at a `position` that shines at a `target`, (3,) each [m], with an RGB
    `intensity` [W/sr]; `cutoff` and `beam` are half angles [degrees].
    """
    aim = mi.ScalarTransform4f().look_at(origin=list(position), target=list(target), up=list(up))
    return {
        "type": "spot",
        "to_world": aim,
        "cutoff_angle": cutoff,
        "beam_width": beam,
        "intensity": {"type": "rgb", "value": list(intensity)},
    }


def point_light(position: Sequence[float], intensity: Sequence[float]) -> Plugin:
    """Return a point light at `position`, (3,) [m], with the RGB `intensity`, (3,) [W/sr]."""
    return {
        "type": "point",
        "position": list(position),
        "intensity": {"type": "rgb", "value": list(intensity)},
    }


def sun(direction: Sequence[float], irradiance: Sequence[float]) -> Plugin:
    """Return a directional light that travels in a `direction`, (3,), with an RGB
    `irradiance` across it [W/m^2].
    """
    return {
        "type": "directional",
        "direction": [float(part) for part in np.asarray(direction) / np.linalg.norm(direction)],
        "irradiance": {"type": "rgb", "value": list(irradiance)},
    }


def sky(radiance: Sequence[float]) -> Plugin:
    """Return a sky of constant RGB `radiance`, (3,) [W/(m^2 sr)]."""
    return {"type": "constant", "radiance": {"type": "rgb", "value": list(radiance)}}


def area_lamp(
    shape: str,
    position: Sequence[float],
    target: Sequence[float],
    size: float | Sequence[float],
    radiance: Sequence[float],
) -> Plugin:
    """Return a black area light of constant RGB radiance [W/(m^2 sr)].

    The `shape` is 'rectangle' or 'disk', which shine on one side, or 'sphere'. Its middle is at the
    `position`, and it faces the `target`, (3,) each [m]. The `size` is the radius [m], or half of
    each side of a rectangle, (2,) [m].
    """
    across, up = (size, size) if isinstance(size, float) else size
    turned = mi.ScalarTransform4f().look_at(
        origin=list(position), target=list(target), up=[0, 0, 1]
    )
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
) -> Plugin:
    """Return a perspective sensor at an origin that looks at a target, (3,) each [m]; its up is z.

    The field of view is horizontal [degrees], the size in pixels. The camera is in the
    medium 'fog' or in vacuum.
    """
    medium: Plugin = {"medium": {"type": "ref", "id": "fog"}} if in_fog else {}
    return medium | {
        "type": "perspective",
        "fov": fov,
        "fov_axis": "x",
        "near_clip": 1e-5,
        "far_clip": 1e5,
        "to_world": mi.ScalarTransform4f().look_at(
            origin=list(origin), target=list(target), up=[0, 0, 1]
        ),
        "film": {
            "type": "hdrfilm",
            "width": size[0],
            "height": size[1],
            "rfilter": {"type": "box"},
            "component_format": "float32",
        },
    }
