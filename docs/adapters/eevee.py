#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Blender's EEVEE, by the module `bpy`. See README.md.

    airlight capture eevee sphere-spot --size 160x120 -o x.exr --set volumetric_samples=64

The scene is built as for Cycles (`docs/examples`); only what a rasteriser needs differs. No display
and no graphics card are needed: Mesa's llvmpipe is enough (Debian: libegl1 libgl1-mesa-dri). `bpy`
wants CPython 3.11, and lies in an environment of its own, which this program looks for and starts;
AIRLIGHT_CYCLES_PYTHON names the Python of another one.
"""

import json
import math
import os
import sys
import time
from pathlib import Path
from typing import Any, NoReturn

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
VERSION = "5.0.1"
WRONG, MISSING = 2, 3  # exit statuses, those of airlight

#: Settings of the engine by their names in Blender's Python.
SETTINGS: dict[str, Any] = {
    "taa_render_samples": 4,
    "volumetric_tile_size": "1",  # froxels as large as pixels
    "volumetric_samples": 128,
    "volumetric_sample_distribution": 0.5,  # 0 is uniform in depth, 1 exponential
    "use_volumetric_shadows": True,  # attenuates light on its way to the scattering point
    "volumetric_shadow_samples": 32,
    "volumetric_light_clamp": 0.0,
    "use_volume_custom_range": True,  # without it start and end are not used
    "volumetric_start": 0.02,
    "volumetric_end": 0.0,  # 0: behind the scene
    "cutoff_distance": 0.0,  # of lamps; 0: so far that its window takes nothing
    "use_raytracing": False,
    "use_shadows": True,
    "shadow_step_count": 16,
    "shadow_ray_count": 1,
    "light_threshold": 0.0,
}
OF_LIGHTS = "cutoff_distance"


def end(status: int, words: str) -> NoReturn:
    """End with a line on the error stream."""
    print(" ".join(words.split()), file=sys.stderr, flush=True)
    os._exit(status)


def find_bpy() -> None:
    """Start again with the Python that has `bpy`, where this one has not."""
    try:
        import bpy  # noqa: F401
    except ImportError:
        cache = os.environ.get("AIRLIGHT_CACHE_DIR") or os.path.expanduser("~/.cache/airlight")
        folder = Path(cache) / f"adapters-bpy-{VERSION}"
        python = folder / "bin" / "python"
        named = os.environ.get("AIRLIGHT_CYCLES_PYTHON") or str(python)
        if Path(named).exists() and sys.executable != named:
            os.execv(named, [named, *sys.argv])
        line = f"python3.11 -m venv {folder} && {python} -m pip install bpy=={VERSION}"
        end(MISSING, f"EEVEE: the module bpy is missing: `{line}`, which takes 1 GB")


def main(described_path: str, gltf: str, output: str, *words: str) -> None:
    """Render, and print what was set."""
    began = time.perf_counter()
    settings = SETTINGS | dict(setting(word) for word in words)
    find_bpy()
    # Blender prints on the output, which belongs to one line of JSON: that goes to the error stream.
    told = os.dup(1)
    os.dup2(2, 1)
    import bpy

    sys.path.insert(0, str(EXAMPLES))
    from render_cycles import assign, build, read

    described = json.loads(Path(described_path).read_text(encoding="utf-8"))["result"]
    properties = read(described_path)
    refuse(described, properties)
    properties["scene"]["render.engine"] = "BLENDER_EEVEE"
    # Values at pixel centres, without a filter.
    properties["scene"]["render.filter_size"] = 0.01
    build(properties, gltf)
    scene = bpy.context.scene
    far = farthest(described)
    settings["volumetric_end"] = settings["volumetric_end"] or far
    settings[OF_LIGHTS] = settings[OF_LIGHTS] or 100 * far
    # A rasteriser cannot take the clip planes of a path tracer: depth would have no precision left.
    assign(scene.camera.data, {"clip_start": 0.01, "clip_end": far})
    assign(scene.eevee, {name: value for name, value in settings.items() if name != OF_LIGHTS})
    for light in bpy.data.lights:
        own = {"use_shadow": True, "shadow_maximum_resolution": 0.001}
        own |= {"shadow_filter_radius": 0.0, "use_shadow_jitter": False}
        if light.type != "SUN":  # else a window ends each lamp where it is dim
            own |= {"use_custom_distance": True, OF_LIGHTS: settings[OF_LIGHTS]}
        assign(light, own)
    scene.view_layers[0].eevee.use_pass_volume_direct = True
    assign(scene.render.image_settings, properties["layered_image_settings"])
    scene.render.filepath, scene.render.use_file_extension = output, False
    bpy.ops.render.render(write_still=True)
    data = {
        "engine": "EEVEE",
        "version": bpy.app.version_string,
        "settings": settings,
        "seconds": round(time.perf_counter() - began, 3),
        "problems": [],
        "model": model(settings),
        "pixel": "centre",
        "layers": {"airlight": "ViewLayer.Volume Direct", "total": "ViewLayer.Combined"},
    }
    os.write(told, (json.dumps(data) + "\n").encode())
    sys.stdout.flush()
    os._exit(0)  # Blender's own end takes long, and prints


def setting(word: str) -> tuple[str, Any]:
    """Return a setting by its name, with the type that it has."""
    name, _, value = word.partition("=")
    if name == "edit":
        end(WRONG, "EEVEE: its shaders cannot be edited")
    if name not in SETTINGS:
        end(WRONG, f"EEVEE has no setting '{name}' here; it has {', '.join(SETTINGS)}")
    old = SETTINGS[name]
    try:
        return name, value.lower() in ("1", "true") if isinstance(old, bool) else type(old)(value)
    except ValueError:
        end(WRONG, f"{name}: got '{value}', expected a number")


def refuse(described: dict[str, Any], properties: dict[str, Any]) -> None:
    """End where the engine cannot have the scene."""
    parts = [*properties["lights"], *properties["media"].values()]
    parts += [*properties["materials"].values(), properties["world"] or {}]
    for part in parts:
        if "cannot" in part:
            end(WRONG, f"EEVEE is set up as Cycles: {part['cannot']}")
    if described["sky"]:
        end(WRONG, "EEVEE: the adapter brings no sky")
    for medium in [described["medium"] or {}, *described["bounded_media"]]:
        if medium.get("phase", {"name": "hg"})["name"] not in ("isotropic", "hg"):
            end(WRONG, "EEVEE: its phase function is Henyey-Greenstein's")


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
    thick = (
        8 / min((described["medium"] or {}).get("sigma_t", [0.0]))
        if described["medium"]
        else math.inf
    )
    return float(f"{min(thick, 1.01 * max([*corners, *lamps], default=100.0)):.6g}")


def model(settings: dict[str, Any]) -> str | None:
    """Return the equation as terms of `airlight compare --model`; None where no term says it."""
    if not settings["use_shadows"] or not settings["use_volume_custom_range"]:
        return None
    path = "" if settings["use_volumetric_shadows"] else "light-path=off,"
    ends = f"ends=planes:{settings['volumetric_start']:g}:{settings['volumetric_end']:g}"
    lamps = f"range=quartic:{settings[OF_LIGHTS]:g},spot=cosine-smooth"
    return f"{path}{lamps},{ends},surface.light-path=off"


if __name__ == "__main__":
    if len(sys.argv) < 4:
        end(WRONG, "expected eevee.py SCENE.json SCENE.glb OUT.exr NAME=VALUE...")
    main(*sys.argv[1:])
