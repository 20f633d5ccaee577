# SPDX-License-Identifier: BSD-3-Clause
"""The results of a scene, data and files, as they are kept."""

from dataclasses import replace

import numpy as np

from reference.storage.exr import Image, write_exr
from reference.storage.files import temporary_folder
from reports.data.serialize import image_data, measurement_data, truth_data
from reports.machine.environment import stamped
from reports.plotting.pictures import error_map, exposure, png_bytes, tone_mapped
from validation.comparison.engine_images import EngineImage, ImageMeasurement, image_flip, measure_image
from validation.estimates.images import layered_truth
from validation.metrics.flip import Flip
from validation.study.results import Computed
from validation.study.run import Measurement, layered_frame
from validation.study.scene import SceneStudy


def truth_result(study: SceneStudy) -> Computed:
    """Return the data and the files of the truth."""
    truth = study.truth
    light = truth.airlight + truth.surface
    factor = exposure(light)
    files = {
        "exr": _exr_bytes(layered_truth(study.name, truth)),
        "picture": png_bytes(tone_mapped(light, factor)),
        "airlight": png_bytes(tone_mapped(truth.airlight, factor)),
    }
    return {"truth": truth_data(truth), "exposure": factor}, files


def measured_result(study: SceneStudy, measured: Measurement, factor: float) -> Computed:
    """Return the data and the files of a configuration; `factor` is the exposure of the pictures."""
    data, frame = measurement_data(measured), measured.frame
    if frame is None:
        return data, {}
    image = layered_frame(study.name, measured.configuration, frame)
    airlight = np.asarray(frame.airlight, dtype=np.float64)
    files = {
        "exr": _exr_bytes(_with_flip(image, measured.flip)),
        "picture": png_bytes(tone_mapped(airlight + frame.surface, factor)),
        "error": png_bytes(error_map(study.truth.airlight, airlight)),
    }
    return data, files


def judged_result(study: SceneStudy, shown: EngineImage, factor: float) -> Computed:
    """Return the data and the files of an image from elsewhere; `factor` is the exposure of the pictures."""
    measured = measure_image(shown, study.truth_of, surfaces=study.scene.features.surfaces)
    if study.effort.flip != "none":
        measured = replace(measured, flip=image_flip(measured))
    test = np.asarray(measured.image.layers[measured.layer], dtype=np.float64)
    files = {
        "exr": _exr_bytes(_with_flip(_named(study, measured), measured.flip)),
        "picture": png_bytes(tone_mapped(measured.light, factor)),
        "error": png_bytes(error_map(measured.expected, test)),
    }
    return image_data(measured), files


def _named(study: SceneStudy, measured: ImageMeasurement) -> Image:
    attributes = {"airlight:scene": study.name, "airlight:image": measured.shown.path.name}
    return replace(measured.image, attributes=attributes)


def _with_flip(image: Image, flip: Flip | None) -> Image:
    """Return an image with its map of HDR-FLIP as a grey layer."""
    if flip is None or flip.error_map is None:
        return image
    return replace(image, layers=dict(image.layers) | {"flip": np.repeat(flip.error_map[:, :, None], 3, axis=2)})


def _exr_bytes(image: Image) -> bytes:
    """Return the file of an image: OpenEXR writes to a path alone."""
    with temporary_folder() as folder:
        path = folder / "image.exr"
        write_exr(path, stamped(image), finite=False)  # somebody's, which the report judges
        return path.read_bytes()
