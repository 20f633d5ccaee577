# SPDX-License-Identifier: BSD-3-Clause
"""The layers of a reference, each with its error: proven, estimated or statistical."""

import math

import numpy as np

from airlight.reference.monte_carlo.batches import LAYERS
from airlight.reference.quadrature.image import ReferenceImage
from airlight.reference.quadrature.replicates import REPLICATES, standard_error
from airlight.reference.storage.exr import TOTAL
from airlight.validation.arrays import Array, Bools
from airlight.validation.statistics.estimate import INTERVAL, UNKNOWN, Estimate, Kind
from airlight.validation.statistics.samples import widened


def reference_layer(reference: ReferenceImage, layer: str, *, emitted: bool = True) -> Array:
    """Return 'airlight', 'surface' or 'total', (height, width, 3) [W/(m^2 sr)].

    A renderer shows the area lights that the camera sees: Mitsuba's integrators do unless
    `hide_emitters` is set, and so do those of Blender for an emitting mesh. `total` is therefore
    airlight, lit surface and `emitted` together. It is without `emitted` where a file has that as a
    layer beside it, as the files of `airlight reference` do, and for frames of our own methods,
    which show no light. Where a renderer hides its lights (Blender's light objects by default,
    `hide_emitters`), compare the layer `airlight`, or leave the lights out here.
    """
    if layer != TOTAL:
        return np.asarray(getattr(reference, layer))
    total = reference.airlight + reference.surface
    return total if reference.emitted is None or not emitted else total + reference.emitted


def reference_error(reference: ReferenceImage, layer: str, *, emitted: bool = True) -> Array | None:
    """Return the standard error of a layer, (height, width, 3) [W/(m^2 sr)]; None where nothing is
    sampled; `emitted`: see `reference_layer`.

    That of the total is the root of the sum of the variances of its parts. The parts share their
    positions and seeds; their covariance is left out. The emission of lights is exact along a ray;
    its mean over a pixel has a standard error.
    """
    if reference.airlight_se is None or reference.surface_se is None:
        return None
    if layer == TOTAL:
        both = np.hypot(reference.airlight_se, reference.surface_se)
        seen = reference.emitted_se if emitted else None
        return both if seen is None else np.hypot(both, seen)
    return np.asarray(getattr(reference, f"{layer}_se"))


def stated_error(reference: ReferenceImage, layer: str) -> tuple[Array, Kind] | None:
    """Return the error of a layer without that of samples, (height, width, 3) [W/(m^2 sr)], and its
    kind; None where it is not known.

    The error of the airlight is proven or estimated, the error of a surface is estimated, and those
    of the total add up.
    """
    if layer == "airlight":
        return reference.airlight_error, reference.airlight_kind
    if reference.surface_error is None:
        return None
    if layer == "surface":
        return reference.surface_error, "estimated"
    return reference.airlight_error + reference.surface_error, "estimated"


def known_to(reference: ReferenceImage, layer: str, *, emitted: bool = True) -> Estimate:
    """Return the mean of a layer, and the mean error of its pixels, where these
    are finite [W/(m^2 sr)]; `emitted`: see `reference_layer`.

    It is proven or estimated as `stated_error` says, and statistical where lights or positions are
    sampled: a standard error and the stated error together then.
    """
    values = reference_layer(reference, layer, emitted=emitted)
    sampled = reference_error(reference, layer, emitted=emitted)
    stated = stated_error(reference, layer)
    kind: Kind = "estimated" if stated is None else stated[1]
    errors = np.zeros_like(values) if stated is None else stated[0]
    if sampled is not None:
        kind, errors = "statistical", errors + sampled
    finite = np.isfinite(values) & np.isfinite(errors)
    if not finite.any():
        return UNKNOWN
    error = None if stated is None else float(errors[finite].mean())
    return Estimate(float(values[finite].mean()), error, kind)


def off_by(
    reference: ReferenceImage, layer: str, *, emitted: bool = True, mask: Bools | None = None
) -> tuple[float, float]:
    """Return by how much the mean of a layer may be off, and the root mean square of that of its
    values, both over the mean [1]; infinite where it is not known.

    Standard errors count twice, as in intervals of 95 %. Those of the channels of a pixel are
    dependent, and those of two pixels as far as the replicates of the image say: rays have samples
    of their own on area lights, and all the same ones of a sky. `emitted`: see `reference_layer`;
    `mask`: which pixels count, (height, width), all by default.
    """
    values = reference_layer(reference, layer, emitted=emitted)
    stated = stated_error(reference, layer)
    if stated is None:
        return math.inf, math.inf
    sampled = reference_error(reference, layer, emitted=emitted)
    drawn = np.zeros_like(values) if sampled is None else INTERVAL * sampled
    finite = np.isfinite(values + stated[0] + drawn)
    finite &= True if mask is None else np.asarray(mask, dtype=bool)[:, :, None]
    light = float(values[finite].sum())
    if not light > 0:
        return math.inf, math.inf
    apart = float(np.linalg.norm(np.where(finite, drawn, 0.0).sum(axis=2)))
    together = widened(shared_part(reference, layer), REPLICATES - 1.0)
    pooled = max(apart, together * float(drawn[finite].sum()))
    root = float(np.sqrt(((stated[0] + drawn)[finite] ** 2).mean()))
    return (float(stated[0][finite].sum()) + pooled) / light, root * int(finite.sum()) / light


def shared_part(reference: ReferenceImage, layer: str) -> float:
    """Return the standard error of the mean of a layer by its replicates, over the mean of those of
    its values [1]: 0 without any, about 1 where all have one error.
    """
    values, parts = reference_error(reference, layer, emitted=False), reference.replicate_means
    if values is None or parts is None or not np.any(values):
        return 0.0
    means = parts.sum(axis=0) if layer == TOTAL else parts[LAYERS.index(layer)]
    return float(standard_error(means.mean(axis=1))) / float(np.mean(values))


def known_words(estimate: Estimate) -> str:
    """Return how well a layer is known, in words."""
    relative = relative_error(estimate)
    if relative is None:
        return "its error is not known"
    return f"known to {relative:.2g} of its mean ({estimate.kind})"


def relative_error(estimate: Estimate) -> float | None:
    """Return an error over its value; None where one is not known, or the value is 0."""
    return (
        estimate.error / estimate.value if estimate.value and estimate.error is not None else None
    )
