# SPDX-License-Identifier: BSD-3-Clause
"""Which grid froxel fog needs, and what its history costs under a light that moves.

Errors of a grid are against the exact sum over the same light points, so that how many there are is not among them.

A ghost is the difference of frames with a history to the same frames without: it has nothing to do with the error of
the grid. The light moves for some frames and then rests. After it the ghost falls by the weight of the history in every
frame.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from realtime.frame.incremental import next_frame
from realtime.frame.renderer import frame_renderer, image_frame
from realtime.methods.registry import METHODS
from realtime.scene.read_scene import Scene
from validation.frames.decomposition import exact_sum
from validation.metrics.errors import Metrics, error_metrics
from validation.scenes.animation import animate
from validation.scenes.record import Animation

Array = NDArray[np.float64]
Grid = tuple[int, int, int]  #: froxels across, down and in depth

_STILL = {"camera_moved": False, "geometry_moved": False, "light_moved": False}


@dataclass(frozen=True)
class Ghost:
    """What a history leaves of a light that moved, frame by frame."""

    weight: float
    clamp: bool
    errors: tuple[float, ...]  #: RMS of the difference to the frame without history, over the mean of that


def grid_errors(scene: Scene, grids: Sequence[Grid], *, points: int, frames: int = 1) -> list[Metrics]:
    """Return the errors of the airlight by grid.

    Parameters
    ----------
    scene
        The scene.
    grids
        The sizes.
    points
        Of each light with extent.
    frames
        How many frames with moved samples are averaged, with a history of the weight 1 - 2/frames; 1: one alone.
    """
    exact = exact_sum(scene, replace(METHODS["froxel-fog"].light_points, points=points))
    history = {"jitter": "frames", "history": 1 - 2 / frames} if frames > 1 else {}
    errors = []
    for grid in grids:
        *_, last = _airlight([(scene, False)] * frames, _parameters(grid, points=points) | history)
        errors.append(error_metrics(exact, last))
    return errors


def ghosts(
    scene: Scene,
    animation: Animation,
    kinds: Sequence[tuple[float, bool]],
    *,
    grid: Grid,
    points: int,
    turn: float,
    frames: tuple[int, int],
) -> list[Ghost]:
    """Return the ghosts of a light that moves and then rests.

    Parameters
    ----------
    scene, animation
        The scene, and about what its lights circle.
    kinds
        Weights of the history, and whether it is cut off at what the neighbours hold.
    grid, points
        Of the froxels, and of each light with extent.
    turn
        By how much the light turns in a frame [rad].
    frames
        How many frames it moves, and how many it rests.
    """
    moving, resting = frames
    whole = round(2 * np.pi / turn)
    moved = replace(animation, moves=("light",))
    places = [now for now, _ in zip(animate(scene, moved, whole), range(moving + 1))]
    steps = [(now, number > 0) for number, now in enumerate(places)] + [(places[-1], False)] * resting
    alone = list(_airlight(steps, _parameters(grid, points=points)))
    measured = []
    for weight, clamp in kinds:
        history = {"history": weight, "clamp": "neighbours" if clamp else "none"}
        images = _airlight(steps, _parameters(grid, points=points) | history)
        errors = [
            float(np.sqrt(np.mean((image - without) ** 2)) / without.mean()) for image, without in zip(images, alone)
        ]
        measured.append(Ghost(weight, clamp, tuple(errors)))
    return measured


def _parameters(grid: Grid, *, points: int) -> dict[str, Any]:
    width, height, slices = grid
    return {"width": width, "height": height, "slices": slices, "points": points}


def _airlight(steps: Sequence[tuple[Scene, bool]], parameters: dict[str, Any]) -> Iterator[Array]:
    """Yield the airlight of frames that follow one another: scenes, and whether their light has moved."""
    renderer, cache = frame_renderer(steps[0][0], METHODS["froxel-fog"], **parameters), None
    for scene, light_moved in steps:
        stages, cache = next_frame(renderer, scene, cache, **(_STILL | {"light_moved": light_moved}))
        yield np.asarray(image_frame(replace(renderer, scene=scene), stages).airlight, dtype=np.float64)
