# SPDX-License-Identifier: BSD-3-Clause
"""Pictures of radiance and of errors, as 8-bit arrays and PNG files.

What is compared is linear up to white (`tone_mapped`): twice the radiance looks twice as bright, what is brighter than
white is cut off. What is only looked at, previews and the gallery, goes through the curve of `preview`, which keeps the
colours of lights and shows the dark of a room.
"""

import io
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from reference.storage.files import write_bytes
from reports.plotting.colour_maps import NOT_FINITE, signed_colours
from validation.metrics.colour import auto_exposure

Picture = NDArray[np.uint8]

ERROR_FLOOR, ERROR_CEILING = 1e-4, 1.0  #: relative errors where the scale of the error maps begins and ends


def exposure(reference: NDArray[np.float64]) -> float:
    """Return the factor that brings the 99th percentile of the finite values of a reference to 0.9; 1 for black."""
    return float(np.exp2(auto_exposure(reference)))


def tone_mapped(radiance: NDArray[np.float64], factor: float) -> Picture:
    """Return linear RGB, (height, width, 3), times a factor, clipped to 1 and encoded in sRGB.

    Pixels that are not finite become magenta.
    """
    import colour

    finite = np.all(np.isfinite(radiance), axis=-1)
    linear = np.clip(np.where(finite[..., None], radiance, 0) * factor, 0, 1)
    encoded = np.asarray(colour.cctf_encoding(linear, function="sRGB"))
    picture = np.round(255 * np.clip(encoded, 0, 1)).astype(np.uint8)
    picture[~finite] = NOT_FINITE
    return picture


@dataclass(frozen=True)
class ToneCurve:
    """x (1 + x/w^2) / (1 + x) of x, the radiance times an exposure, channel by channel: Reinhard et al. 2002, eq. 4."""

    exposure: float  #: of the radiance
    white: float  #: w, the x that becomes 1

    @property
    def words(self) -> str:
        """The curve with its numbers."""
        return (
            f"tone curve x (1 + x/{self.white:.3g}^2) / (1 + x), x = {self.exposure:.3g} times the radiance, then sRGB"
        )


def tone_curve(radiance: NDArray[np.floating]) -> ToneCurve:
    """Return the curve of previews that suits an image: its mean becomes 0.3, its 99.9th percentile white."""
    finite = radiance[np.all(np.isfinite(radiance), axis=-1)]
    mean = float(np.maximum(finite, 0).mean()) if finite.size else 0.0
    if not mean > 0:
        return ToneCurve(1.0, 1.0)
    factor = 0.3 / mean
    return ToneCurve(factor, max(1.0, factor * float(np.percentile(finite, 99.9))))


def preview(radiance: NDArray[np.float64], curve: ToneCurve) -> Picture:
    """Return linear RGB, (height, width, 3), through a tone curve, encoded in sRGB; what is not finite is magenta."""
    with np.errstate(invalid="ignore"):
        x = np.maximum(radiance * curve.exposure, 0)
        return tone_mapped(x * (1 + x / curve.white**2) / (1 + x), 1.0)


def error_map(reference: NDArray[np.float64], test: NDArray[np.float64]) -> Picture:
    """Return the signed relative error of images, (height, width, 3), in false colours: blue too dark, red too bright.

    The error of a pixel is its largest over the channels of (test - reference) / max(reference, 0.001 mean(reference)),
    on a scale that is white below 1e-4 and logarithmic from there to 1 on either side, the same for every method.
    """
    finite = np.isfinite(reference) & np.isfinite(test)
    mean = float(reference[finite].mean()) if finite.any() else 0.0
    with np.errstate(invalid="ignore", divide="ignore"):
        relative = (test - reference) / np.maximum(reference, 1e-3 * mean)
    # Equal values have no error, also where both are black and the mean is 0.
    relative = np.where(finite & (test != reference), relative, 0)
    worst = np.take_along_axis(relative, np.abs(relative).argmax(axis=-1)[..., None], axis=-1)[..., 0]
    decades = np.log10(ERROR_CEILING / ERROR_FLOOR)
    size = np.clip(np.log10(np.maximum(np.abs(worst), 1e-30) / ERROR_FLOOR) / decades, 0, 1)
    colours = signed_colours()
    middle = len(colours) // 2
    picture = colours[np.round(middle * (1 + np.sign(worst) * size)).astype(int)]
    picture[~np.all(finite, axis=-1)] = NOT_FINITE
    return picture


def error_scale() -> Picture:
    """Return the colour scale of `error_map` as a horizontal bar."""
    return np.repeat(np.repeat(signed_colours(), 2, axis=0)[None], 12, axis=0)


def png_bytes(picture: Picture) -> bytes:
    """Return a picture as a PNG file."""
    from PIL import Image

    buffer = io.BytesIO()
    Image.fromarray(picture).save(buffer, format="PNG")  # `optimize` saves 3 % and takes six times as long
    return buffer.getvalue()


def write_png(path: Path | str, picture: Picture) -> None:
    """Write a picture, whole or not at all."""
    write_bytes(path, png_bytes(picture))
