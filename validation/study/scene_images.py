# SPDX-License-Identifier: BSD-3-Clause
"""The rows of images from elsewhere in the study of a scene."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from airlight.reference.quadrature.reference import ReferenceInputs
from airlight.reference.scene.model import Model
from airlight.reference.storage.exr import TOTAL, Image, read_exr
from airlight.reference.storage.store import Inputs, stored
from airlight.validation.columns import record_of
from airlight.validation.study.configuration import Configuration
from airlight.validation.study.row import EquationError, Row
from airlight.validation.study.run import cell_row
from airlight.validation.study.scene import SceneStudy
from airlight.validation.study.scene_rows import Judged
from airlight.validation.timing import FrameTimes, Timing

if TYPE_CHECKING:  # what only reports of images need is imported there
    from airlight.validation.engine.images import EngineImage
    from airlight.validation.engine.model_errors import ModelErrors


@dataclass(frozen=True)
class ImageInputs(Inputs):
    """The inputs of the row of an image from elsewhere."""

    kind = "scene-image"
    reference: ReferenceInputs
    scene: str  #: its identity
    size: tuple[int, int]  #: [pixels]
    label: str
    path: Path  #: which counts by its name and its content
    times: tuple[Timing, str] | None
    model: Model  #: the equation by which it is judged


def image_row(study: SceneStudy, shown: EngineImage, model: Model | None) -> Judged:
    """Return the row of an image from elsewhere."""
    from airlight.validation.engine.images import captured_model, image_times

    model = model or captured_model(shown.path) or study.loaded.model
    # The key has the inputs of the reference: another reference gives another row.
    times = image_times(shown.path)
    inputs = ImageInputs(
        study.reference_inputs, study.identity, study.size, shown.label, shown.path, times, model
    )
    result = stored(inputs, lambda: _measured_image(study, shown, times, model), Judged)
    # Whether FLIP is asked for is no input of the row: the image for it is dropped here.
    whole = None if study.study.flip == "none" else result.value.whole
    return replace(
        result.value,
        row=replace(result.value.row, scene=study.path),
        whole=whole,
        results=(result,),
    )


def _measured_image(
    study: SceneStudy, shown: EngineImage, times: tuple[Timing, str] | None, model: Model
) -> Judged:
    """Return the row of an image with its layers."""
    from airlight.validation.engine.images import measure_image, notes_of
    from airlight.validation.engine.judge import references
    from airlight.validation.engine.observation import AIRLIGHT, SURFACE

    # An image of a model is judged by the reference of its own equation.
    loaded = replace(study.loaded, model=model)
    judged, layers, surface = measure_image(
        shown,
        loaded,
        study.reference_of if model.is_physical else references(loaded),
        surfaces=study.scene.features.surfaces,
    )
    row = replace(
        cell_row(study.cell(Configuration("image"))),
        label=shown.label,
        command=None,  # another program shows it
        note=notes_of(judged, times),
        kind="image",
        layer=judged.expected,
        pixel=judged.pixel,
        error=judged.comparison.metrics,
        model=None if judged.model is None else _equation_error(judged.model),
        surface_error=surface,
        times=None if times is None else FrameTimes(times[0]),
    )
    # FLIP compares all light. An image of the airlight alone has it only where the surfaces are
    # dark, or where it has a layer of them; one of surfaces alone has it nowhere. Pixels that a file
    # does not hold are black, and no error: such an image has none.
    reference, whole = judged.layers, None
    is_held = read_exr(shown.path).with_data() is None
    is_lit = AIRLIGHT in layers and (SURFACE in layers or not np.any(reference.surface > 0))
    if is_held and judged.expected == TOTAL:
        whole = judged.reference
    elif is_held and is_lit:
        whole = reference.airlight + reference.surface
    image = Image(
        layers, attributes={"airlight:scene": study.name, "airlight:image": shown.path.name}
    )
    return Judged(record_of(row, Row), image, judged.reference, whole)


def _equation_error(errors: ModelErrors) -> EquationError:
    """Return the errors of an equation and of an algorithm as columns of a row."""
    equation, total = errors.against_physics, errors.total
    # By blocks: one pixel beside a lamp outweighs all others in a root mean square of pixels.
    return EquationError(
        errors.name,
        errors.terms,
        errors.image.blocks,
        None if equation is None else equation.blocks,
        None if total is None else total.blocks,
        errors.correlation,
    )
