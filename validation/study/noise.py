# SPDX-License-Identifier: BSD-3-Clause
"""Methods that draw random numbers: independent runs of one frame against its reference, bias apart from noise.

Methods that draw none are rendered once, and stand beside them: all of their error is bias.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from analytic.errors import InputError
from realtime.frame.renderer import render_frame
from realtime.scene.read_scene import read_scene
from validation.arrays import Array, Counted
from validation.estimates.quadrature import reference_image
from validation.motion.noise import Noise, measure_noise
from validation.study.configuration import Configuration, prepared
from validation.study.frame_times import brief_times

_SURE = 2.0  # standard errors, below which the mean of the runs is not told from the reference


@dataclass(frozen=True)
class MethodNoise:
    """The noise of independent renders by a method."""

    label: str
    noise: Noise
    reference: Array = field(repr=False)  #: (height, width, 3) [W/(m^2 sr)]
    mean: Array = field(
        repr=False
    )  #: of the runs; the reference where it is within two standard errors, (height, width, 3)
    deviation: Array = field(repr=False)  #: of a run, (height, width, 3) [W/(m^2 sr)]


def method_noise(
    scene: Any,
    configurations: Sequence[Configuration],
    *,
    runs: int = 16,
    progress: Counted | None = None,
) -> list[MethodNoise]:
    """Return the noise of each configuration's airlight.

    `scene`: the `mi.Scene`, at its own size; `runs`: of a method that draws random numbers, at least two. The time of a
    frame is a median while nothing moves. Raises InputError for fewer runs and a dark reference.
    """
    if runs < 2:
        raise InputError(f"runs: got {runs}, expected at least two")
    read, reference = read_scene(scene), reference_image(scene).airlight
    found = []
    for number, chosen in enumerate(configurations):
        renderer = prepared(read, chosen)
        count = runs if renderer.method.noisy else 1
        images = []
        for run in range(count):
            if progress is not None:
                progress(number * runs + run, len(configurations) * runs, chosen.label)
            images.append(np.asarray(render_frame(replace(renderer, run=run)).airlight, dtype=np.float64))
        seconds = brief_times(renderer)[0].frame.median_ms / 1e3
        if all(np.array_equal(each, images[0]) for each in images[1:]):
            images = images[:1]
        mean, deviation = np.mean(images, axis=0), np.std(images, axis=0, ddof=min(1, len(images) - 1))
        told = np.abs(mean - reference) > _SURE / math.sqrt(count) * deviation
        noise, shown = measure_noise(reference, images, seconds), np.where(told, mean, reference)
        found.append(MethodNoise(chosen.label, noise, reference, shown, deviation))
    return found
