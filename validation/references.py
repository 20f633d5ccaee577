# SPDX-License-Identifier: BSD-3-Clause
"""References as layered images, ready to be written."""

from collections.abc import Callable

from realtime.frame import Frame
from reference.batches import LARGEST_BATCH, LAYERS
from reference.exr import Image
from reference.quadrature import TruthImage
from validation.configurations import Configuration
from validation.load import LoadedScene
from validation.truth import truth_image, volpath_batches

Progress = Callable[[float, str], None]


def quadrature_reference(loaded: LoadedScene, *, progress: Progress | None = None) -> Image:
    """Return the quadrature truth of a scene; the layer `airlight_bound` bounds the error of `airlight`."""

    def tell(done: int, total: int, what: str) -> None:
        if progress is not None:
            progress(done / total, what)

    return layered_truth(loaded.name, truth_image(loaded.scene, progress=tell))


def layered_truth(name: str, truth: TruthImage) -> Image:
    """Return the quadrature truth of the scene of that name as layers."""
    layers = {"airlight": truth.airlight, "airlight_bound": truth.airlight_bound, "surface": truth.surface}
    return Image(layers, truth.distance, {"airlight:scene": name, "airlight:estimator": "quadrature"})


def layered_frame(name: str, chosen: Configuration, frame: Frame) -> Image:
    """Return a frame of the scene of that name as layers; the header says what rendered it."""
    attributes = {"airlight:scene": name, "airlight:method": chosen.method}
    attributes |= {"airlight:kernel": chosen.kernel} if chosen.kernel else {}
    attributes |= {f"airlight:{key}": str(value) for key, value in chosen.parameters}
    return Image({"airlight": frame.airlight, "surface": frame.surface}, frame.distance, attributes)


def volpath_reference(loaded: LoadedScene, *, samples: int, seed: int = 0, progress: Progress | None = None) -> Image:
    """Return volpath's mean with its standard errors.

    Parameters
    ----------
    loaded
        The scene.
    samples
        Samples a pixel, split into at least 32 batches of at most 256.
    seed
        Seed of the first batch.
    progress
        Called with (share done, what) after every batch.
    """
    batch = max(1, min(LARGEST_BATCH, samples // 32))
    count = max(2, -(-samples // batch))

    def tell(done: int, total: int, what: str) -> None:
        if progress is not None:
            progress(done / total, what)

    found = volpath_batches(loaded.scene, batches=count, samples=batch, first_seed=seed, progress=tell)
    distance = truth_distance(loaded)
    shape = (*distance.shape, 3)
    layers = {}
    for number, name in enumerate(LAYERS):
        layers[name] = found.mean[number].reshape(shape)
        layers[f"{name}_se"] = found.standard_error[number].reshape(shape)
    attributes: dict[str, str | int | float] = {
        "airlight:scene": loaded.name,
        "airlight:estimator": "volpath",
        "airlight:spp": batch * len(found.seeds),
        "airlight:batches": len(found.seeds),
        "airlight:seed": seed,
    }
    return Image(layers, distance, attributes)


def truth_distance(loaded: LoadedScene):
    """Return the distance to the visible surface at every pixel centre [m]."""
    from reference.scene import read_truth
    from reference.surface import surface_hits

    truth = read_truth(loaded.scene)
    return surface_hits(truth).distance.reshape(truth.height, truth.width)
