# SPDX-License-Identifier: BSD-3-Clause
"""Where the error of an image lies: beside a light, at edges, in rings around a light,
or in a part of the frame.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import binary_dilation, laplace, maximum_filter, minimum_filter

from airlight.reference.quadrature.surface import surface_hits
from airlight.reference.scene.read import ReferenceScene
from airlight.validation.arrays import Array, Bools
from airlight.validation.engine.prediction import Predictor
from airlight.validation.engine.search import Explanation

_BESIDE = 3.0  # pixels from a light
_PLACES = (("upper", "middle", "lower"), ("left", "middle", "right"))


@dataclass(frozen=True)
class ErrorPlace:
    """Where most of the squared error of an image lies."""

    pixels: int  #: the fewest that have `fraction` of it
    fraction: float
    #: column and row of the pixel with the largest error, from the upper left
    worst: tuple[int, int]
    kind: str  #: 'lamp', 'edge' or '' for neither
    relative_rmse_without: float  #: that of all other pixels; NaN by a black reference
    few: bool  #: whether they are less than a hundredth of the image

    @property
    def words(self) -> str:
        """Return a sentence."""
        kinds = {"lamp": "beside a light", "edge": "at edges of light and shadow"}
        if not self.few:
            where = f", most of them {kinds[self.kind]}" if self.kind else ""
            return (
                f"spread: {100 * self.fraction:.3g} % of the squared error in "
                f"{self.pixels} pixels{where}"
            )
        single = self.pixels == 1
        place = f"{kinds[self.kind]}, " if self.kind else ""
        at = "" if single else "the worst "
        words = (
            f"{100 * self.fraction:.3g} % of the squared error in {self.pixels} "
            f"pixel{'s' * (not single)} ({place}{at}"
            f"in column {self.worst[0]}, row {self.worst[1]})"
        )
        if math.isnan(self.relative_rmse_without):
            return words
        rest = f"{100 * self.relative_rmse_without:.3g} %"
        return f"{words}; without {'it' if single else 'them'} the relative rmse is {rest}"


def error_place(reference: Array, image: Array, light_pixels: Array) -> ErrorPlace | None:
    """Return where most of the squared error lies; None where there is no error.

    `reference`, `image`: radiance, (height, width, 3) [W/(m^2 sr)]; `light_pixels`: how far a light
    is, (height, width) [pixels].
    """
    # Pixels that are not compared, such as those that a mask leaves out, have no error, and count
    # in no mean.
    compared = np.all(np.isfinite(reference) & np.isfinite(image), axis=2)
    difference = np.where(compared[..., None], image - reference, 0.0)
    squared = (difference**2).sum(axis=2)
    total = float(squared.sum())
    if total == 0:
        return None
    # The fewest pixels that have nine tenths of the squared error: the largest errors come first.
    order = np.argsort(squared, axis=None)[::-1]
    below = np.cumsum(squared.reshape(-1)[order]) / total
    count = min(int(np.searchsorted(below, 0.9)) + 1, squared.size)
    chosen = np.zeros(squared.size, dtype=bool)
    chosen[order[:count]] = True
    rest = squared.reshape(-1)[~chosen & compared.ravel()]
    mean = float(reference[compared].mean())
    chosen = chosen.reshape(squared.shape)
    row, column = divmod(int(order[0]), squared.shape[1])
    # A kind of place is named where more than half of the pixels lie at it, a light before an edge.
    light = np.where(np.isfinite(reference), reference, 0.0).sum(axis=2)
    lamp, edge = (light_pixels[chosen] < _BESIDE).mean() > 0.5, at_edges(light)[chosen].mean() > 0.5
    kind = "lamp" if lamp else "edge" if edge else ""
    square = float(rest.mean()) / reference.shape[2] if len(rest) else 0.0
    rmse_without = math.sqrt(square) / mean if mean > 0 else math.nan
    # A hundredth of the pixels counts as few.
    return ErrorPlace(
        count,
        float(below[count - 1]),
        (column, row),
        kind,
        rmse_without,
        count <= max(1, 0.01 * np.count_nonzero(compared)),
    )


def at_edges(values: Array) -> Bools:
    """Return where the values of 3 x 3 neighbouring pixels differ by more than a factor of 1.5,
    (height, width).
    """
    return np.asarray(
        maximum_filter(values, 3, mode="nearest") > 1.5 * minimum_filter(values, 3, mode="nearest")
    )


def place_words(predictor: Predictor, explanation: Explanation) -> str:
    """Say where the error lies that an explanation leaves, such as 'at the edges of shapes'."""
    # Signed errors say whether they depend on an angle, their sizes where they lie, (m,) each.
    reference, (height, width) = predictor.reference, predictor.shape
    errors = explanation.errors.mean(axis=1)
    size = np.abs(explanation.errors).mean(axis=1)
    row, column = np.divmod(predictor.pixels, width)
    regions: list[tuple[str, Bools]] = []
    for words, angle in _angles(reference):
        # `step` is the usual angle between neighbouring pixels, by which pixels are measured; those
        # of a single column are neighbours up and down.
        pixel = angle.reshape(height, width)
        step = float(np.median(np.abs(np.diff(pixel, axis=1 if width > 1 else 0)))) or math.inf
        regions.append((f"beside {words}", (angle < 2 * _BESIDE * step)[predictor.pixels]))
    # One over the depth is linear in the image of a plane: what bends it is an outline.
    depth = surface_hits(reference).distance * (reference.direction @ predictor.view.axis)
    inverse = (1 / depth).reshape(height, width)
    outline = np.abs(laplace(inverse, mode="nearest")) > 0.05 * inverse.max()
    # Four pixels from an outline, less in small images: as far as low resolutions and filters carry
    # an error.
    wide = binary_dilation(outline, iterations=max(1, min(4, min(height, width) // 12) - 1))
    regions.append(("at the edges of shapes", wide[row, column]))
    # Relative errors are largest at an outline in the dark, errors of radiance beside a light: a
    # place counts by either of them.
    image, predicted = predictor.shown(explanation.guess), predictor.predicted(explanation.guess)
    amount = np.nan_to_num(np.abs(image - predicted).mean(axis=1))
    places = [words for words, mask in regions if _lies(size, mask) or _lies(amount, mask)]
    if places:
        return " and ".join(places)
    # Neither at lights nor at outlines: rings around a light, or a ninth of the image.
    for words, angle in _angles(reference):
        if _is_ringed(errors, angle[predictor.pixels]):
            return f"in rings around {words}"
    for high, vertical in enumerate(_PLACES[0]):
        for across, horizontal in enumerate(_PLACES[1]):
            mask = (3 * row // height == high) & (3 * column // width == across)
            if _lies(size, mask):
                return f"in the {vertical} {horizontal} of the image".replace(
                    "middle middle", "middle"
                )
    return "all over the image"


def _lies(size: Array, mask: Bools) -> bool:
    """Return whether the error lies in some pixels: most of it, or far more
    for a pixel than elsewhere.
    """
    # A place that is most of the image, or hardly any of it, is no place.
    if not 0.001 < mask.mean() < 0.7 or size.sum() <= 0:
        return False
    # The error of a pixel there is 1.7 times the error of others, and half of all errors lie there;
    # or it is four times as large, and a twentieth lies there.
    inside, outside = float(size[mask].mean()), float(size[~mask].mean())
    fraction = float(size[mask].sum() / size.sum())
    return inside > 1.7 * outside and (fraction > 0.5 or (inside > 4 * outside and fraction > 0.05))


def _angles(reference: ReferenceScene) -> list[tuple[str, Array]]:
    """Return the angle of every pixel to each light before the camera, (pixels,)
    [rad], and what it is called.
    """
    places = [light.position for light in reference.lights] + [
        light.centre for light in reference.area
    ]
    # A light more than 26 degrees outside of the image, behind the camera for instance, is no place
    # in it.
    angles = []
    for place in places:
        way = (place - reference.origin) / max(
            float(np.linalg.norm(place - reference.origin)), 1e-300
        )
        cosine = reference.direction @ way
        if cosine.max() > 0.9:
            angles.append(
                ("the light" if len(places) == 1 else "a light", np.arccos(np.clip(cosine, -1, 1)))
            )
    return angles


def _is_ringed(errors: Array, angle: Array) -> bool:
    """Return whether errors depend, for the most part, on the angle to a light."""
    # Rings of the same number of pixels, 64 if there are enough. The squared error of the means of
    # rings is what depends on the angle.
    order = np.argsort(angle)
    parts = np.array_split(errors[order], max(4, len(errors) // 64))
    smooth = sum(len(part) * float(part.mean()) ** 2 for part in parts)
    # An error that is the same in all rings is no ring. The rest must be half of the squared error.
    alike = len(errors) * float(errors.mean()) ** 2
    return smooth - alike > 0.5 * float(np.sum(errors**2))
