# SPDX-License-Identifier: BSD-3-Clause
"""Pictures of radiance and of errors, as 8-bit arrays and PNG files.

Pictures for comparison are linear up to white (`tone_mapped`): twice the radiance is shown twice as
bright, and values above white are cut off. Previews and the gallery go through the curve of
`preview`, which keeps the colours of lights and shows the dark of a room.

Equal steps of an error map look like equal steps of colour. The map of signed errors is made here:
dark blue, over white in the middle, to dark red. Each arm is a quadratic Bezier curve in CAM16-UCS
(Li et al. 2017), a space in which the distance of two colours is about how different they look,
walked in equal steps of length. The arms are as long as one another within a few per cent, so that
an error looks as large on either side. Values without a sign use viridis, HDR-FLIP uses magma, as
its authors do; both are even by construction (van der Walt and Smith 2015). The nearest ready-made
map with equally dark ends is colorcet's CET-D1A (Kovesi 2015): its steps differ by up to 34 % of
their mean in CAM16-UCS, the steps here by 5 %, and its middle is not white.
"""

import functools
import io
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from airlight.reference.storage.files import write_bytes
from airlight.validation.metrics.colour import auto_exposure
from airlight.validation.metrics.errors import FLOOR

Colours = NDArray[np.uint8]

#: Middle, control point and end of each arm's curve, in CAM16-UCS (J', a', b').
MIDDLE = (98.5, -1.87, -1.06)
BLUE = ((70.0, -14.0, -35.0), (22.0, -1.5, -22.0))
RED = ((70.0, 36.0, 24.0), (25.0, 29.0, 10.0))

NOT_FINITE = (255, 0, 255)  #: magenta, which no map contains


@functools.cache
def signed_colours(steps: int = 127) -> Colours:
    """Return the map of signed errors, (2 steps + 1, 3) in 8-bit sRGB: blue below, red
    above, white in the middle.
    """
    import colour

    # The blue arm runs backwards to the middle, which both arms have: it is taken once.
    lightness_and_hue = np.concatenate([_arm(BLUE, steps)[:0:-1], _arm(RED, steps)])
    # Both CAM16-UCS and the sRGB of colour-science scale XYZ to 1.
    linear = colour.XYZ_to_sRGB(colour.CAM16UCS_to_XYZ(lightness_and_hue))
    return np.round(255 * np.clip(linear, 0, 1)).astype(np.uint8)


@functools.cache
def unsigned_colours(name: str) -> Colours:
    """Return 256 colours of a map of matplotlib, (256, 3) in 8-bit sRGB."""
    import matplotlib

    return np.round(255 * matplotlib.colormaps[name](np.arange(256))[:, :3]).astype(np.uint8)


def _arm(points: tuple[tuple[float, float, float], ...], steps: int) -> NDArray[np.float64]:
    """Return a curve from the middle to its end in equal steps of length, (steps + 1, 3)."""
    middle, control, end = (np.array(point) for point in (MIDDLE, *points))
    # A quadratic Bezier curve, its length up to each point, and the points at equal steps of it.
    t = np.linspace(0, 1, 4097)[:, None]
    curve = (1 - t) ** 2 * middle + 2 * t * (1 - t) * control + t**2 * end
    length = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(curve, axis=0), axis=1))])
    wanted = np.linspace(0, length[-1], steps + 1)
    return np.stack([np.interp(wanted, length, curve[:, axis]) for axis in range(3)], axis=1)


Picture = NDArray[np.uint8]

#: relative errors where the scale of the error maps begins and ends
ERROR_FLOOR, ERROR_CEILING = 1e-4, 1.0


def exposure(reference: NDArray[np.float64]) -> float:
    """Return the factor that brings the 99th percentile of the finite values of a
    reference to 0.9; 1 for black.
    """
    return float(np.exp2(auto_exposure(reference)))


def tone_mapped(radiance: NDArray[np.float64], factor: float) -> Picture:
    """Return linear RGB, (height, width, 3), times a factor, clipped to 1 and encoded in sRGB.

    Pixels that are not finite become magenta.
    """
    import colour

    # One channel that is not finite makes the whole pixel magenta.
    finite = np.all(np.isfinite(radiance), axis=-1)
    linear = np.clip(np.where(finite[..., None], radiance, 0) * factor, 0, 1)
    encoded = np.asarray(colour.cctf_encoding(linear, function="sRGB"))
    picture = np.round(255 * np.clip(encoded, 0, 1)).astype(np.uint8)
    picture[~finite] = NOT_FINITE
    return picture


@dataclass(frozen=True)
class ToneCurve:
    """x (1 + x/w^2) / (1 + x) of x, the radiance times an exposure, channel by channel:
    Reinhard et al. 2002, eq. 4.
    """

    exposure: float  #: of the radiance
    white: float  #: w, the x that becomes 1

    @property
    def words(self) -> str:
        """The curve with its numbers."""
        return (
            f"tone curve x (1 + x/{self.white:.3g}^2) / (1 + x), "
            f"x = {self.exposure:.3g} times the radiance, then sRGB"
        )


def tone_curve(radiance: NDArray[np.floating]) -> ToneCurve:
    """Return the curve of previews that suits an image: its mean becomes 0.3, its
    99.9th percentile white.
    """
    finite = radiance[np.all(np.isfinite(radiance), axis=-1)]
    # A black image has no mean to bring to 0.3.
    mean = float(np.maximum(finite, 0).mean()) if finite.size else 0.0
    if not mean > 0:
        return ToneCurve(1.0, 1.0)
    factor = 0.3 / mean
    return ToneCurve(factor, max(1.0, factor * float(np.percentile(finite, 99.9))))


def preview(radiance: NDArray[np.float64], curve: ToneCurve) -> Picture:
    """Return linear RGB, (height, width, 3), through a tone curve, encoded in sRGB; what
    is not finite is magenta.
    """
    with np.errstate(invalid="ignore"):
        x = np.maximum(radiance * curve.exposure, 0)
        return tone_mapped(x * (1 + x / curve.white**2) / (1 + x), 1.0)


def relative_error(
    reference: NDArray[np.float64], test: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return (test - reference) / max(reference, 0.001 mean(reference)), not a number
    where an image is not finite.
    """
    finite = np.isfinite(reference) & np.isfinite(test)
    mean = float(reference[finite].mean()) if finite.any() else 0.0
    with np.errstate(invalid="ignore", divide="ignore"):
        relative = (test - reference) / np.maximum(reference, FLOOR * mean)
    # Equal values have no error, also where both are black and the mean is 0.
    return np.where(finite, np.where(test == reference, 0.0, relative), np.nan)


def error_map(reference: NDArray[np.float64], test: NDArray[np.float64]) -> Picture:
    """Return the signed relative error of images, (height, width, 3), in false colours: blue
    too dark, red too bright.

    The error of a pixel is the largest `relative_error` over its channels, on a scale that is white
    below 1e-4 and logarithmic from there to 1 on either side, the same for every method.
    """
    return error_colours(relative_error(reference, test))


def error_colours(relative: NDArray[np.float64]) -> Picture:
    """Return signed relative errors, (height, width, 3), in the false colours of `error_map`; what
    is not a number is magenta.
    """
    finite = ~np.isnan(relative)
    # The channel with the largest error decides, and keeps its sign.
    relative = np.where(finite, relative, 0)
    worst = np.take_along_axis(relative, np.abs(relative).argmax(axis=-1)[..., None], axis=-1)[
        ..., 0
    ]
    # From white at the floor to full colour at the ceiling, by the logarithm.
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
    """Return a picture as a PNG file, which says who made it."""
    from PIL import Image
    from PIL.PngImagePlugin import PngInfo

    buffer, said = io.BytesIO(), PngInfo()
    said.add_text("Software", "airlight")
    # `optimize` saves 3 % and takes six times as long
    Image.fromarray(picture).save(buffer, format="PNG", pnginfo=said)
    return buffer.getvalue()


def write_png(path: Path | str, picture: Picture) -> None:
    """Write a picture, whole or not at all."""
    write_bytes(path, png_bytes(picture))
