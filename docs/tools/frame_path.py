# SPDX-License-Identifier: BSD-3-Clause
"""The files of `realtime` that a frame passes: `python docs/tools/frame_path.py SCENE METHOD`.

Those in which a function runs from the loaded Mitsuba scene to the image, in the
order of their first call.
"""

import sys
from pathlib import Path

from airlight.realtime.frame.image import render_frame
from airlight.realtime.frame.renderer import frame_renderer
from airlight.realtime.kernels.registry import KERNELS
from airlight.realtime.methods.registry import find_method
from airlight.realtime.scene.read_scene import read_scene
from airlight.reports.machine.environment import activate
from airlight.validation.scenes.loading import load_scene

ROOT = Path(__file__).resolve().parents[2]


def files_of_frame(scene: str, method: str) -> list[str]:
    """Return the files, relative to the repository."""
    activate()
    loaded, passed = load_scene(scene, (64, 48)).scene, dict[str, None]()
    find_method(method)  # its files are loaded here: what runs while they are is no part of a frame
    sys.setprofile(
        lambda frame, event, _: (
            passed.setdefault(frame.f_code.co_filename) if event == "call" else None
        )
    )
    try:
        render_frame(
            frame_renderer(read_scene(loaded), find_method(method), kernel=KERNELS["exact"])
        )
    finally:
        sys.setprofile(None)
    paths = (Path(name).resolve() for name in passed)
    inside = (path.relative_to(ROOT).as_posix() for path in paths if path.is_relative_to(ROOT))
    return [name for name in inside if name.startswith("realtime/")]


if __name__ == "__main__":
    for number, name in enumerate(files_of_frame(*sys.argv[1:]), 1):
        print(number, name)
