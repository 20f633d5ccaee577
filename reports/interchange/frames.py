# SPDX-License-Identifier: BSD-3-Clause
"""The frames of an animation as numbered files, each whole or not at all."""

import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from reports.machine.progress import Progress

STAGES = (
    "surface",
    "shade",
    "cull",
    "render",
    "passes",
)  #: the frozen functions of a `FrameRenderer`


def check_ending(option: str, path: Path, ending: str, *, instead: str = "") -> None:
    """Refuse a file name that ends like another kind of file.

    Raises
    ------
    InputError
        If the name does not end in `ending`, such as '.exr'; `instead` is said after that.
    """
    from analytic.errors import InputError

    if path.suffix.lower() != ending:
        raise InputError(f"{option}: got {str(path)!r}, wanted a name that ends in {ending}{instead}")


def numbered(path: Path, number: int, frames: int) -> Path:
    """Return name-0001.exr for name.exr; the first frame has the number 1."""
    digits = max(4, len(str(frames)))
    return path.with_name(f"{path.stem}-{number:0{digits}d}{path.suffix}")


def write_frames(
    name: str, renderer, chosen, animation, *, frames: int, outputs: dict[str, Path | None], progress: Progress
) -> dict[str, Any]:
    """Render the frames of an animation, write them and return what they cost.

    Parameters
    ----------
    name, renderer, chosen
        The name of the scene, its frame renderer, and the configuration.
    animation
        What moves, a `validation.scenes.registry.Animation`.
    frames
        How many.
    outputs
        The paths that were asked for, as 'exr' and 'png'; frames get their number before the suffix.
    progress
        Called with the share done and what was written last.
    """
    import numpy as np

    from validation.scenes.animation import animate, moved_parts
    from validation.study.frame_times import timed_image

    cost: list[tuple[float, float]] = []
    kept = None
    curve = None  # all frames share that of the first, so that a lamp that fades looks it
    start = time.perf_counter()
    for number, scene in enumerate(animate(renderer.scene, animation, frames), 1):
        moved = 1e3 * (time.perf_counter() - start)
        frame, kept, render_ms = timed_image(renderer, scene, kept, **moved_parts(animation))
        cost.append((moved, render_ms))
        numbers = {kind: path and numbered(path, number, frames) for kind, path in outputs.items()}
        curve = write_frame(name, chosen, frame, outputs=numbers, curve=curve)
        del frame  # the next one needs its room
        progress(number / frames, f"frame {number} of {frames}")
        start = time.perf_counter()
    later = np.array(cost[1:] or cost)
    moved, rendered = (float(value) for value in np.median(later, axis=0))
    return {
        "frames": frames,
        "moves": list(animation.moves),
        "frame_ms": moved + rendered,
        "move_ms": moved,
        "render_ms": rendered,
        "recordings": {name: getattr(getattr(renderer, name), "n_recordings", 0) for name in STAGES},
        "files": [str(path) for path in _files(outputs, frames)],
    }


def write_frame(name: str, chosen, frame, *, outputs: dict[str, Path | None], curve=None, samples: int = 1):
    """Write a frame where it is wanted, as EXR and as PNG; return the tone curve of the picture, if there is one.

    Parameters
    ----------
    name, chosen, frame
        The name of the scene, the configuration, and the frame.
    outputs
        Paths or None, by 'exr' and 'png'.
    curve
        Of the picture, a `reports.plotting.pictures.ToneCurve`; by default one that suits it.
    samples
        Rays of each pixel, which the header of the EXR file names where they are several.
    """
    if outputs["exr"] is not None:
        from reference.storage.exr import write_exr
        from reports.machine.environment import stamped
        from validation.study.run import layered_frame

        image = layered_frame(name, chosen, frame)
        if samples > 1:
            made = {"airlight:pixel": "area", "airlight:samples": str(samples)}
            image = replace(image, attributes=dict(image.attributes) | made)
        write_exr(outputs["exr"], stamped(image))
    if outputs["png"] is not None:
        from reports.plotting.pictures import preview, tone_curve, write_png

        total = frame.airlight + frame.surface
        curve = tone_curve(total) if curve is None else curve
        write_png(outputs["png"], preview(total, curve))
    return curve


def _files(outputs: dict[str, Path | None], frames: int) -> Sequence[Path]:
    paths = [path for path in outputs.values() if path is not None]
    return [numbered(path, number, frames) for path in paths for number in range(1, frames + 1)]
