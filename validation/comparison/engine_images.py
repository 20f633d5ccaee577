# SPDX-License-Identifier: BSD-3-Clause
"""Images that another renderer wrote, a game engine for instance: EXR files named by scene, judged against the truth.

A folder holds SCENE.exr, or SCENE.NAME.exr where several images of a scene are to be told apart. An image with a layer
`airlight` is judged by that; else its plain channels are judged against airlight plus surface. It is judged at its own
size, which all images of a scene must share, and by the truth that fits, at pixel centres or over their areas.
"""

import difflib
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from analytic.errors import InputError
from reference.quadrature.ray_values import TruthImage
from reference.storage.exr import NOTE, TOTAL, Image, read_exr
from validation.comparison.engine_layers import AIRLIGHT, SURFACE, expected_layer, judged_layer
from validation.comparison.engine_pixels import TruthOf, fit_pixel
from validation.metrics.errors import Metrics, error_metrics
from validation.metrics.flip import Flip, flip_hdr


@dataclass(frozen=True)
class EngineImage:
    """An image from elsewhere, and the scene that it claims to show."""

    scene: str  #: name of the scene
    label: str  #: NAME in its file's name, or the name of the folder
    path: Path


@dataclass(frozen=True)
class ImageMeasurement:
    """How wrong an image from elsewhere is."""

    shown: EngineImage
    image: Image  #: only the layers that were judged, named by what they hold
    layer: str  #: what `error` is of: 'airlight', 'surface', or 'total' for both together
    truth: TruthImage  #: of the scene, of the pixels that fit
    expected: NDArray[np.float64]  #: what `layer` was compared with, (height, width, 3) [W/(m^2 sr)]
    pixel: str  #: 'centre' or 'area': what a pixel of that truth is
    error: Metrics
    surface_error: Metrics | None  #: where the image has both layers
    note: str | None  #: what the reader of the file changed or left out
    flip: Flip | None = None

    @property
    def light(self) -> NDArray[np.float64]:
        """All light in the image, to look at (height, width, 3) [W/(m^2 sr)]."""
        return _light(self.image)


def find_images(folder: str | os.PathLike[str], scenes: Mapping[str, str]) -> dict[str, tuple[EngineImage, ...]]:
    """Return the images in a folder by the name of their scene.

    Parameters
    ----------
    folder
        Holds EXR files; other files are not looked at.
    scenes
        The scenes that files may name: a name, and what `validation.scenes.loading.load_scene` takes for it.

    Raises
    ------
    InputError
        If there is no such folder, no EXR file in it, or a file that names no scene.
    """
    place = Path(folder)
    if not place.is_dir():
        raise InputError(f"--images: got {folder}, wanted a folder with EXR files named by scene, such as open-fog.exr")
    files = sorted(path for path in place.iterdir() if path.suffix.lower() == ".exr" and not path.name.startswith("."))
    if not files:
        raise InputError(f"--images: the folder {folder} has no EXR file; wanted SCENE.exr or SCENE.NAME.exr in it")
    by_scene: dict[str, tuple[EngineImage, ...]] = {}
    for path in files:
        scene = _scene_of(path, scenes)
        label = path.stem[len(scene) + 1 :] or place.resolve().name or "image"
        by_scene[scene] = (*by_scene.get(scene, ()), EngineImage(scene, label, path))
    return by_scene


def images_size(images: tuple[EngineImage, ...]) -> tuple[int, int]:
    """Return the size of the images of one scene, (width, height).

    Raises
    ------
    InputError
        If two sizes differ, or a file cannot be read.
    """
    sizes = {image.path: judged_layer(read_exr(image.path), image.path).size for image in images}
    first = images[0]
    for path, size in sizes.items():
        if size != sizes[first.path]:
            wanted, got = (f"{width} x {height}" for width, height in (sizes[first.path], size))
            raise InputError(
                f"--images: {path} is {got} pixels and {first.path} {wanted}; render all images of a scene at one size"
            )
    return sizes[first.path]


def measure_image(shown: EngineImage, truth_of: TruthOf, *, surfaces: bool) -> ImageMeasurement:
    """Compare an image from elsewhere with the truth of its scene at its size.

    Parameters
    ----------
    truth_of
        Computes the quadrature truth for 'centre' or 'area'.
    surfaces
        Whether the scene has surfaces at all.

    Raises
    ------
    InputError
        If the file cannot be read, has none of the layers, or has another size than the truth.
    """
    image = read_exr(shown.path)
    judged = judged_layer(image, shown.path)
    layers = {judged.holds: judged.values}
    if judged.name == AIRLIGHT and SURFACE in image.layers:
        layers[SURFACE] = image.layers[SURFACE]
    fit = fit_pixel(judged, truth_of)
    expected = expected_layer(fit.truth, judged)
    error = error_metrics(expected, judged.values)
    surface = (
        error_metrics(fit.truth.surface, layers[SURFACE])
        if surfaces and AIRLIGHT in layers and SURFACE in layers
        else None
    )
    notes = [str(image.attributes[NOTE])] if NOTE in image.attributes else []
    notes += ["judged by the means over the areas of pixels, which fit"] if fit.pixel == "area" else []
    return ImageMeasurement(
        shown, Image(layers), judged.holds, fit.truth, expected, fit.pixel, error, surface, "; ".join(notes) or None
    )


def image_flip(measured: ImageMeasurement) -> Flip | None:
    """Return HDR-FLIP of all light, or of the airlight where an image has no more; None if it lacks the surface."""
    layers, truth = measured.image.layers, measured.truth
    if AIRLIGHT in layers and "surface" not in layers and np.any(truth.surface > 0):
        return None
    whole = measured.expected if measured.layer == TOTAL else truth.airlight + truth.surface
    return flip_hdr(whole, measured.light)


def _light(image: Image) -> NDArray[np.float64]:
    return np.sum([np.asarray(values, dtype=np.float64) for values in image.layers.values()], axis=0)


def _scene_of(path: Path, scenes: Mapping[str, str]) -> str:
    """Return the scene that a file names: the longest name that its own name begins with."""
    stem = path.stem
    names = [name for name in scenes if stem == name or stem.startswith(f"{name}.")]
    if names:
        return max(names, key=len)
    near = difflib.get_close_matches(stem.split(".")[0], scenes, n=1, cutoff=0.0)
    hint = f"; the nearest is {near[0]}" if near else ""
    raise InputError(
        f"--images: {path} names no scene, wanted SCENE.exr or SCENE.NAME.exr with one of {', '.join(scenes)}{hint}"
    )
