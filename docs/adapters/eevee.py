#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Blender's EEVEE, by the module `bpy`. See README.md.

    airlight capture eevee sphere-spot --size 160x120 -o x.exr --set volumetric_samples=64

The scene is built as for Cycles; only what a rasteriser needs differs. No graphics card is needed:
Mesa's llvmpipe is enough (Debian: libegl1 libgl1-mesa-dri). `blender.py` finds `bpy`.
"""

import ctypes
import math
import sys
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent))

from blender import MISSING, Engine, end, run, take

#: Settings of the engine by their names in Blender's Python: those that come nearest to physics.
SETTINGS: dict[str, Any] = {
    "taa_render_samples": 1,
    "volumetric_tile_size": "1",  # froxels as large as pixels
    "volumetric_samples": 256,
    "volumetric_sample_distribution": 0.8,  # 0 is uniform in depth, 1 exponential
    "use_volumetric_shadows": True,  # attenuates light on its way to the scattering point
    "volumetric_shadow_samples": 128,
    "clamp_volume_direct": 0.0,
    "clamp_surface_direct": 0.0,
    "use_volume_custom_range": True,  # without it start and end are not used
    "volumetric_start": 0.02,
    "volumetric_end": 0.0,  # 0: behind the scene
    # The end of lamps, with a window that is 1 until far below it; things that are nearer to a lamp
    # than 1/4000 of it cast no shadow. 0: ten times as far as the volume ends.
    "cutoff_distance": 0.0,
    "use_raytracing": False,
    "use_shadows": True,
    "shadow_step_count": 16,
    "shadow_ray_count": 1,
    "light_threshold": 0.0,
}
OF_LIGHTS = "cutoff_distance"
_SURFACELESS = 0x31DD  # EGL's platform without a display, which Mesa has


def opengl() -> None:
    """End where there is no OpenGL: Blender itself would abort."""
    if not sys.platform.startswith("linux"):
        return
    pointer = ctypes.c_void_p
    try:
        egl = ctypes.CDLL("libEGL.so.1")
        egl.eglGetDisplay.restype = egl.eglGetPlatformDisplay.restype = pointer
        displays = [egl.eglGetPlatformDisplay(_SURFACELESS, None, None), egl.eglGetDisplay(None)]
        works = any(egl.eglInitialize(pointer(each), None, None) for each in displays)
    except (OSError, AttributeError):
        works = False
    if not works:
        line = "apt-get install -y libegl1 libgl1-mesa-dri"
        end(MISSING, f"EEVEE: there is no OpenGL here: `{line}` on Debian")


def set_up(scene: Any, described: dict[str, Any], settings: dict[str, Any]) -> dict[str, Any]:
    """Set up a scene of `bpy`, and return the settings as they are."""
    import bpy
    from render_cycles import assign

    far = farthest(described)
    made = settings | {
        "volumetric_end": settings["volumetric_end"] or far,
        OF_LIGHTS: settings[OF_LIGHTS] or float(f"{10 * far:.6g}"),
    }
    # Values at pixel centres, without a filter.
    scene.render.filter_size = 0.01
    # A rasteriser cannot take the clip planes of a path tracer: depth would have no precision left.
    assign(scene.camera.data, {"clip_start": 0.01, "clip_end": far})
    take(scene.eevee, {name: value for name, value in made.items() if name != OF_LIGHTS})
    for light in bpy.data.lights:
        own = {"use_shadow": True, "shadow_maximum_resolution": 0.001}
        assign(light, own | {"shadow_filter_radius": 0.0, "use_shadow_jitter": False})
        if light.type != "SUN":  # else a window ends each lamp where it is dim
            take(light, {"use_custom_distance": True, OF_LIGHTS: made[OF_LIGHTS]})
    return made


def farthest(described: dict[str, Any]) -> float:
    """Return where volume and view end [m]: behind the last mesh and four times the farthest lamp,
    or where fog lets exp(-8) through.
    """
    import bpy
    from mathutils import Vector

    place = Vector(described["camera"]["position"])
    corners = [
        (thing.matrix_world @ Vector(corner) - place).length
        for thing in bpy.data.objects
        if thing.type == "MESH"
        for corner in thing.bound_box
    ]
    lights = [light for light in described["lights"] if "position" in light]
    lamps = [4 * (Vector(light["position"]) - place).length for light in lights]
    least = min((described["medium"] or {}).get("sigma_t", [0.0]))
    thick = 8 / least if least > 0 else math.inf
    return float(f"{min(thick, 1.01 * max([*corners, *lamps], default=100.0)):.6g}")


def model(settings: dict[str, Any]) -> str | None:
    """Return the equation as terms of `airlight compare --model`; None where no term says it."""
    shadows = settings["use_shadows"] and not settings["use_raytracing"]
    clamped = settings["clamp_volume_direct"] > 0 or settings["clamp_surface_direct"] > 0
    if not shadows or clamped or not settings["use_volume_custom_range"]:
        return None
    path = "" if settings["use_volumetric_shadows"] else "light-path=off,"
    ends = f"ends=planes:{settings['volumetric_start']:g}:{settings['volumetric_end']:g}"
    lamps = f"range=quartic:{settings[OF_LIGHTS]:g},spot=cosine-smooth"
    return f"{path}{lamps},{ends},surface.light-path=off"


def device() -> str:
    """Return what drew the image."""
    import gpu

    return str(gpu.platform.renderer_get())


ENGINE = Engine(
    name="EEVEE",
    key="BLENDER_EEVEE",
    settings=SETTINGS,
    phases=("isotropic", "hg"),
    set_up=set_up,
    model=model,
    pixel=lambda settings: "centre",
    device=device,
    prepare=opengl,
)

if __name__ == "__main__":
    run(ENGINE)
