# SPDX-License-Identifier: BSD-3-Clause
"""The arrays of a view that a shader is given, in the order of OpenGL's images: the
first row is the lowest.

A ray that meets nothing ends all the same: at the foot of the farthest light and 20/sigma_t behind
it, where e^-20 = 2e-9 of its light is left. Its distance is negative in the array, and `Ray.hit`
false.
"""

from collections.abc import Sequence
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from airlight.errors import InputError
from airlight.realtime.methods.interface.method import View
from airlight.realtime.numerics.array_types import host_numbers
from airlight.realtime.scene.camera import read_camera
from airlight.realtime.scene.lights import Light
from airlight.realtime.scene.media.medium import OPTICAL_REACH, Homogeneous, Medium
from airlight.realtime.scene.phase import HenyeyGreenstein, Isotropic, Rayleigh, Tabulated
from airlight.realtime.scene.read_scene import Scene
from airlight.realtime.shadow_maps.shadow_map import ShadowMap

Array = NDArray[np.float32]

_LIGHT = np.dtype(
    [
        *[("position", "f4", 3), ("kind", "i4"), ("axis", "f4", 3), ("cos_cutoff", "f4")],
        *[("intensity", "f4", 3), ("cos_beam", "f4"), ("across", "f4", 3), ("map", "i4")],
        *[("up", "f4", 3), ("sin_cutoff", "f4"), ("transition", "f4"), ("room", "f4", 3)],
    ]
)  # as `Light` of the prelude lies in a buffer of std430


def check_scene(scene: Scene, name: str) -> None:
    """Refuse a scene that no shader is given, by `InputError`: what is in the way stands first."""
    medium = scene.medium
    wanted = f"{name} renders point and spot lights in one homogeneous medium without bounds"
    if medium.bounded_media or not isinstance(medium, Homogeneous):
        what = (
            "has bounds"
            if medium.bounded_media or medium.clouds
            else f"is {medium.summary.partition(':')[0]}"
        )
        raise InputError(
            f"the medium {what}: {wanted}; use ray-march, or write the method in Python"
        )
    check_ends(medium, wanted)
    # The text of every other phase function would read an empty table, which is black.
    if not isinstance(medium.phase, Isotropic | Rayleigh | HenyeyGreenstein | Tabulated):
        raise InputError(
            f"the phase function is {medium.phase.name!r}: {wanted}, whose phase function is "
            "isotropic, rayleigh, hg or a table; use ray-march, or write the method in Python"
        )
    if scene.area_lights:
        raise InputError(
            f"the scene has area lights: {wanted}; use soft-shafts, or write the method in Python"
        )
    # The faces of all maps are layers of one texture: one of a spot, six of a point light.
    most = 2048  # layers of a texture, which every OpenGL has
    layers = sum(1 if light.axis is not None else 6 for light in scene.lights)
    if layers > most:
        raise InputError(
            f"the scene has {len(scene.lights)} lights, whose maps have {layers} faces: expected "
            f"{most}"
        )


def check_ends(medium: Medium, wanted: str) -> None:
    """Refuse a medium in which rays that meet nothing have no end, by `InputError`; the
    extinction may change from frame to frame.
    """
    # They end where little of their light is left: never, in a vacuum.
    if medium.vacuum:
        raise InputError(
            f"nothing is extinguished in a channel, so that rays have no end: {wanted} of sigma_t "
            "above 0"
        )


def ray_arrays(view: View, *, surfaces: bool) -> dict[str, Array]:
    """Return the textures of rays, and where asked for of the visible surfaces."""
    height, width = view.camera.height, view.camera.width
    pixel = np.array(view.pixel)

    def image(values: Any) -> Array:
        # A view may have some of the pixels, in any order; the others stay black. OpenGL's first
        # row is the lowest.
        lanes = np.zeros((height * width, 4), dtype=np.float32)
        for channel, each in enumerate(values):
            lanes[pixel, channel] = np.array(each, dtype=np.float32)
        return np.ascontiguousarray(lanes.reshape(height, width, 4)[::-1])

    medium: Any = view.medium
    # The foot of the farthest light ahead, and OPTICAL_REACH optical depths behind it; the sign of
    # the distance says that the ray meets nothing.
    reach = dr.full(type(view.distance), 0, len(pixel))
    for light in view.lights:
        reach = dr.maximum(reach, dr.dot(light.position - view.origin, view.direction))
    end = reach + OPTICAL_REACH / medium.least_extinction()
    arrays = {
        "texture al_rays": image(
            [*view.direction, dr.select(dr.isfinite(view.distance), view.distance, -end)]
        )
    }
    if surfaces:
        normal, albedo = _surfaces(view, len(pixel))
        arrays |= {"texture g_normal": image(normal), "texture g_albedo": image(albedo)}
    return arrays


def _surfaces(view: View, lanes: int) -> tuple[Any, Any]:
    """Return the unit normals of the visible surfaces, towards the camera, and
    what they reflect diffusely.
    """
    if not view.features.surfaces:
        return dr.zeros(mi.Vector3f, lanes), dr.zeros(mi.Color3f, lanes)
    # The view has distances alone: the ray is cast again for what it meets.
    ray = mi.Ray3f(mi.Point3f(view.origin), mi.Vector3f(view.direction))
    met = view.scene.ray_intersect(ray)
    normal = mi.Vector3f(met.sh_frame.n)
    normal = dr.select(dr.dot(normal, ray.d) > 0, -normal, normal)
    hit = met.is_valid()
    albedo = mi.Color3f(met.bsdf().eval_diffuse_reflectance(met))
    return dr.select(hit, normal, 0), dr.select(hit, albedo, 0)


def map_array(maps: Sequence[ShadowMap]) -> Array:
    """Return the shadow maps of all lights, face by face, as layers of one texture; there
    is one without maps too.
    """
    # Where there is no surface a texel holds 1e18 m, whose square is finite in a shader.
    layers = [
        np.minimum(np.array(each.distance, dtype=np.float32), 1e18).reshape(
            -1, each.size + 1, each.size + 1
        )
        for each in maps
    ]
    return np.concatenate(layers or [np.zeros((1, 1, 1), dtype=np.float32)])


def light_array(lights: Sequence[Light], maps: Sequence[ShadowMap]) -> NDArray[Any]:
    """Return lights as a shader has them."""
    table, layer = np.zeros(len(lights), dtype=_LIGHT), 0
    for number, (row, light) in enumerate(zip(table, lights, strict=True)):
        row["position"], row["intensity"] = host_numbers(light.position, light.intensity)
        # POINT is 0 and SPOT 1 in the prelude; a light with the map -1 is visible from everywhere.
        row["kind"], row["map"] = light.cone is not None, -1
        if light.cone is not None:
            row["axis"], cos, square = (each if n == 0 else each[0] for n, each in enumerate(
                host_numbers(light.exact_axis, light.cone.cos, light.cone.square_sin)))  # fmt: skip
            row["cos_cutoff"], row["sin_cutoff"], row["cos_beam"] = cos, np.sqrt(square), cos
        # Without a beam the cone has a hard edge: cos_beam is cos_cutoff and the transition 0.
        if light.beam is not None:
            row["cos_beam"], row["transition"] = (
                each[0] for each in host_numbers(light.beam.cos, light.inverse_transition)
            )
        if maps:
            shadow_map = maps[number]
            row["map"] = layer
            layer += shadow_map.faces
            if shadow_map.projection.basis is not None:
                across, up, _ = host_numbers(*shadow_map.projection.basis)
                # Divided by their squared lengths: the dot product of a point with them, over that
                # with the axis, is then its place in [-1, 1].
                row["across"], row["up"] = across / (across @ across), up / (up @ up)
    return table


def uniforms(view: View) -> dict[str, Any]:
    """Return the rest of what every shader is given, by the names of the prelude."""
    camera, medium, phase = read_camera(view.camera), view.medium, view.medium.phase
    sigma_t, albedo = host_numbers(medium.colour(medium.sigma_t), medium.albedo)  # type: ignore[attr-defined]
    sigma_t = np.broadcast_to(sigma_t, 3)
    g = 0.0
    if isinstance(phase, HenyeyGreenstein):
        g = float(host_numbers(phase.g)[0][0])
    elif isinstance(phase, Tabulated):
        p, c = phase_table(phase), np.linspace(-1, 1, dr.width(phase.values))
        # c p is a parabola in each cell, for which Simpson's rule is exact: four times the value in
        # the middle is (c0 + c1)(p0 + p1).
        g = float(np.mean((c * p)[:-1] + (c * p)[1:] + (c[:-1] + c[1:]) * (p[:-1] + p[1:])) / 6)
    return {
        "resolution": [camera.width, camera.height],
        "medium.sigma_t": sigma_t.tolist(),
        "medium.sigma_s": (sigma_t * albedo).tolist(),
        "medium.g": g,
        "al_origin": camera.origin.tolist(),
        "al_forward": camera.forward.tolist(),
        "al_right": (-camera.left).tolist(),
        "al_up": camera.up.tolist(),
    }


def phase_table(phase: Any) -> Array:
    """Return the values of a phase function that is a table, nothing of another."""
    return (
        np.array(phase.values, dtype=np.float32)
        if isinstance(phase, Tabulated)
        else np.zeros(0, np.float32)
    )
