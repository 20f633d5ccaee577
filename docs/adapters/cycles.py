#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Blender's Cycles, by the module `bpy`. See README.md.

    airlight capture cycles sphere-spot --size 160x120 -o x.exr --set samples=64

Its image has noise. `blender.py` finds `bpy`; the image is drawn by the processor.
"""

import sys
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent))

from blender import Engine, run, take

_CENTRE = 0.01  #: the least width of a filter that Cycles takes [pixels]
#: Settings of the engine by their names in Blender's Python. Its denoisers are none of them: they
#: take all light, and not that of the fog alone. Steps through volumes change nothing here.
SETTINGS: dict[str, Any] = {
    "samples": 1024,
    "seed": 1,
    # Values at pixel centres: means over areas cost a reference many rays a pixel.
    "pixel_filter_type": "GAUSSIAN",
    "filter_width": _CENTRE,  # of other filters than BOX, whose width is a pixel
    "max_bounces": 0,  # after the first scattering or reflection
    "diffuse_bounces": 0,
    "volume_bounces": 0,
    "sample_clamp_direct": 0.0,
    "sample_clamp_indirect": 0.0,
    "light_sampling_threshold": 0.0,
    "use_light_tree": True,
    "use_adaptive_sampling": False,
    "adaptive_threshold": 0.01,
    "volume_biased": False,
}


def set_up(scene: Any, described: dict[str, Any], settings: dict[str, Any]) -> dict[str, Any]:
    """Set up a scene of `bpy`, and return the settings as they are."""
    scene.cycles.device = "CPU"
    take(scene.cycles, settings)
    return settings


def model(settings: dict[str, Any]) -> str | None:
    """Return the equation as `airlight compare --model` takes it; None where no term says it."""
    single = settings["max_bounces"] == 0
    single |= settings["diffuse_bounces"] == settings["volume_bounces"] == 0
    return "physical" if single and settings["sample_clamp_direct"] == 0 else None


def pixel(settings: dict[str, Any]) -> str | None:
    """Return what the values of pixels are; None for filters that are neither a box nor narrow."""
    if settings["pixel_filter_type"] == "BOX":
        return "area"
    return "centre" if settings["filter_width"] <= _CENTRE else None


ENGINE = Engine(
    name="Cycles",
    key="CYCLES",
    settings=SETTINGS,
    phases=("isotropic", "hg", "rayleigh"),
    set_up=set_up,
    model=model,
    pixel=pixel,
    device=lambda: "CPU",
)

if __name__ == "__main__":
    run(ENGINE)
