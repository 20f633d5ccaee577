# SPDX-License-Identifier: BSD-3-Clause
"""Table 2 and the times of section 6 of Biri, Arques, Michelin 2006 measured
again, at the published sizes.

*As published* has everything that the paper has at once: its polynomial, its order of the planes,
Gamma at vertices, a frame buffer of 8 bits, the cone of 32 planes about a spot. "A reasonable
intensity for the light source" leaves nothing to clamp: the buffer is full at the radiance that all
but one in a thousand pixels of the true frame stay below.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from airlight.realtime.frame.image import render_frame
from airlight.realtime.scene.read_scene import read_scene
from airlight.reference.quadrature.reference import reference_image
from airlight.validation.clock import time_in_turns
from airlight.validation.metrics.errors import error_metrics, known
from airlight.validation.papers.claims import quartiles
from airlight.validation.scenes.loading import load_scene, resize
from airlight.validation.study.configuration import configuration, prepared
from airlight.validation.study.frame_times import moved_light

_SECONDS = 0.1  # for each timing [s]

#: All that the paper has at once, beside its polynomial and the cone of a spot.
AS_PUBLISHED: Mapping[str, Any] = {
    "order": "paper",
    "evaluation": "vertex",
    "buffer": "8bit",
    "media": "paper",
}

#: By the name of its figures a scene that stands for one of the paper, its size [pixels], and the
#: edges of the paper's cone over the spot, 0 where there is none.
ENTRIES: Mapping[str, tuple[str, tuple[int, int], int]] = {
    "sphere-spot 800": ("sphere-spot", (800, 600), 32),
    "sphere-spot 1024": ("sphere-spot", (1024, 768), 32),
    "two-pens": ("two-pens", (800, 600), 0),
    "three-media": ("three-media", (800, 600), 0),
    "clutter": ("clutter", (800, 600), 0),
    "hall": ("hall", (800, 600), 0),
}


def biri_tables(*, scale: float = 1.0, seconds: float = _SECONDS) -> dict[str, Any]:
    """Return rates as published and by our exact form, and the largest median error.

    All images have the published width and height times `scale`; each timing takes
    about so many `seconds`.
    """
    figures: dict[str, Any] = {}
    errors = []
    for name, (scene_name, full, cone) in ENTRIES.items():
        # Frames of 320 x 240 are compared: the default report keeps these references.
        size, compared = _scaled(full, scale), _scaled((320, 240), scale)
        loaded = load_scene(scene_name, size).scene
        scene = read_scene(loaded)
        # From here on the scene has the smaller size, for the reference.
        resize(loaded, compared)
        reference = reference_image(loaded)
        whole = reference.airlight + reference.surface
        white = float(np.quantile(whole.max(axis=-1), 0.999))
        chosen = configuration(
            "shadow-planes-2006", "taylor", {**AS_PUBLISHED, "cone": cone, "white": white}
        )
        frame = render_frame(prepared(read_scene(loaded), chosen))
        errors.append(known(error_metrics(whole, frame.airlight + frame.surface).p50))
        forms = chosen, configuration("shadow-planes", "exact")
        works = [moved_light(prepared(scene, form)) for form in forms]
        # Times are of the published size, in turns.
        published, ours = time_in_turns(works, seconds=2 * seconds, least=3)
        rates = {"": published.rate, "ours ": ours.rate}
        figures |= {f"{name} {whose}fps": quartiles(rate) for whose, rate in rates.items()}
    return figures | {"median error": max(errors)}


def _scaled(size: tuple[int, int], scale: float) -> tuple[int, int]:
    """Return a size times a scale, in whole tiles of four pixels."""
    width, height = (max(16, 4 * round(scale * side / 4)) for side in size)
    return width, height
