# SPDX-License-Identifier: BSD-3-Clause
"""Table 2 and the times of section 6 of Biri, Arques, Michelin 2006 measured
again, at the published sizes.

*As published* has everything that the paper has at once: its polynomial, its order of the planes,
Gamma at vertices, a frame buffer of 8 bits, the cone of 32 planes about a spot. "A reasonable
intensity for the light source" leaves nothing to clamp: the buffer is full at the radiance that all
but one in a thousand pixels of the true frame stay below.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from airlight.realtime.frame.image import render_frame
from airlight.realtime.scene.read_scene import read_scene
from airlight.reference.quadrature.reference import reference_image
from airlight.validation.clock import time_in_turns
from airlight.validation.metrics.errors import error_metrics, known
from airlight.validation.papers.claims import Figures, Result, quartiles
from airlight.validation.scenes.loading import load_scene, resize
from airlight.validation.study.configuration import Parameters, configuration, prepared
from airlight.validation.study.frame_times import moved_light

_SECONDS = 0.1  # for each timing [s]

#: All that the paper has at once, beside its polynomial and the cone of a spot.
AS_PUBLISHED: Parameters = {
    "order": "paper",
    "evaluation": "vertex",
    "buffer": "8bit",
    "media": "paper",
}


@dataclass(frozen=True)
class Entry:
    """A line of the table: a scene that stands for one of the paper."""

    scene: str
    size: tuple[int, int] = (800, 600)  #: [pixels]
    cone: int = 0  #: edges of the paper's cone over the spot; 0 without one


#: The lines of the table by the names of their figures.
ENTRIES: Mapping[str, Entry] = {
    "sphere-spot 800": Entry("sphere-spot", cone=32),
    "sphere-spot 1024": Entry("sphere-spot", (1024, 768), cone=32),
    **{name: Entry(name) for name in ("two-pens", "three-media", "clutter", "hall")},
}


def biri_tables(*, scale: float = 1.0, seconds: float = _SECONDS) -> Figures:
    """Return rates as published and by our exact form, and the largest median error.

    All images have the published width and height times `scale`; each timing takes
    about so many `seconds`.
    """
    figures: dict[str, Result] = {}
    errors = []
    for name, entry in ENTRIES.items():
        # Frames of 320 x 240 are compared: the cache of the default report has these references.
        size, compared = _scaled(entry.size, scale), _scaled((320, 240), scale)
        loaded = load_scene(entry.scene, size).scene
        scene = read_scene(loaded)
        # From here on the scene has the smaller size, for the reference.
        resize(loaded, compared)
        reference = reference_image(loaded)
        whole = reference.airlight + reference.surface
        white = float(np.quantile(whole.max(axis=-1), 0.999))
        chosen = configuration(
            "shadow-planes-2006", "taylor", {**AS_PUBLISHED, "cone": entry.cone, "white": white}
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
