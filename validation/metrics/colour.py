# SPDX-License-Identifier: BSD-3-Clause
r"""How different two images look: CIEDE2000 and Delta E ITP, at a stated exposure and luminance.

Radiance has no colour until it is shown. Each image therefore goes through the same chain, as
linear RGB with the primaries and the white of sRGB:

    shown = radiance 2^exposure                       1 is white
    CIEDE2000:   clip to [0, 1] -> CIE XYZ -> CIE L*a*b* (D65, its white) -> Delta E_00
    Delta E ITP: times the luminance of white [cd/m^2], clip to [0, peak] -> BT.2020 -> IC_TC_P (PQ) -> Delta E_ITP

and the differences of two pixels follow from the last line of each. The clipping imitates a screen:
CIEDE2000 was fitted to surface colours and is not defined above white, nor PQ below 0. It is not
silent: pixels that it changed in either image are counted. A difference of 1 is about what a keen
eye just sees, in both formulae.

The exposure is in stops. It brings the 99th percentile of the reference to 0.9, as the pictures of
a report do; it depends on the reference alone, so that all tests against one reference are judged
at one exposure.

CIEDE2000: CIE 142-2001; Sharma, Wu and Dalal 2005 for its branches. Delta E ITP: ITU-R BT.2124-0,
annex 1; PQ and IC_TC_P: ITU-R BT.2100-2. White at 203 cd/m^2: ITU-R BT.2408-7. Both through
colour-science, whose import takes a second.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from airlight.validation.arrays import Array
from airlight.validation.columns import column
from airlight.validation.metrics.errors import colours, compared

WHITE_LUMINANCE = 203.0  #: luminance of white [cd/m^2], the reference white of BT.2408
PEAK_LUMINANCE = 1000.0  #: the brightest that the screen shows [cd/m^2]
PQ_PEAK = 10000.0  #: the brightest that PQ encodes [cd/m^2]


@dataclass(frozen=True)
class ColourDifference:
    """Colour difference of two images (see the module); none is known if no
    pixel is finite in both.
    """

    exposure: float = column("exposure", "stops", "the radiance was multiplied by 2 to this power")
    white_luminance: float = column("white", "cd/m^2", "of the screen of Delta E ITP")
    peak_luminance: float = column("peak", "cd/m^2", "of the screen of Delta E ITP")
    pixels: int = column("pixels", "pixels", "asked for")
    nonfinite: int = column(
        "not finite", "pixels", "left out because either image is NaN or infinite there"
    )
    clipped: int = column(
        "clipped", "pixels", "of which either image is outside [0, 1], which CIEDE2000 sees"
    )
    clipped_itp: int = column(
        "clipped, ITP", "pixels", "of which either image is outside what Delta E ITP sees"
    )
    ciede2000_mean: float | None = column("CIEDE2000", "1", "mean CIEDE2000")
    ciede2000_p99: float | None = column("CIEDE2000, p99", "1", "99 % quantile of CIEDE2000")
    ciede2000_max: float | None = column("CIEDE2000, largest", "1", "largest CIEDE2000")
    itp_mean: float | None = column("Delta E ITP", "1", "mean Delta E ITP")
    itp_p99: float | None = column("Delta E ITP, p99", "1", "99 % quantile of Delta E ITP")
    itp_max: float | None = column("Delta E ITP, largest", "1", "largest Delta E ITP")


def colour_difference(
    reference: ArrayLike, test: ArrayLike, *, mask: ArrayLike | None = None
) -> ColourDifference:
    """Return how different two images look (see the module).

    Radiances [W/(m^2 sr)] are (height, width), (height, width, 1) for grey or (height, width, 3).
    The mask, (height, width) of truth values, says which pixels to compare.
    """
    ref, tst, chosen = compared(reference, test, mask)
    ref, tst = colours(ref), colours(tst)
    finite = chosen & (np.isfinite(ref) & np.isfinite(tst)).all(axis=2)
    exposure = auto_exposure(ref[finite])
    shown = np.stack([ref[finite], tst[finite]]) * 2.0**exposure
    brightest = PEAK_LUMINANCE / WHITE_LUMINANCE
    surface, light = np.clip(shown, 0, 1), np.clip(shown, 0, brightest)
    de = ciede2000(*_lab(surface))
    itp = delta_e_itp(*_ictcp(light * WHITE_LUMINANCE))
    return ColourDifference(
        exposure=exposure,
        white_luminance=WHITE_LUMINANCE,
        peak_luminance=PEAK_LUMINANCE,
        pixels=int(chosen.sum()),
        nonfinite=int(chosen.sum() - finite.sum()),
        clipped=int((surface != shown).any(axis=(0, 2)).sum()),
        clipped_itp=int((light != shown).any(axis=(0, 2)).sum()),
        **dict(zip(("ciede2000_mean", "ciede2000_p99", "ciede2000_max"), _summary(de))),
        **dict(zip(("itp_mean", "itp_p99", "itp_max"), _summary(itp))),
    )


def auto_exposure(reference: ArrayLike) -> float:
    """Return the exposure [stops] that brings the 99th percentile of the finite
    radiance to 0.9; 0 for black.
    """
    values = np.asarray(reference, dtype=np.float64)
    values = values[np.isfinite(values)]
    bright = float(np.percentile(values, 99)) if values.size else 0.0
    return float(np.log2(0.9) - np.log2(bright)) if bright > 0 else 0.0


def ciede2000(reference: Array, test: Array) -> Array:
    """Return the CIEDE2000 difference of colours in CIE L*a*b*, (..., 3)."""
    import colour

    return np.asarray(colour.delta_E(reference, test, method="CIE 2000"))


def delta_e_itp(reference: Array, test: Array) -> Array:
    """Return Delta E ITP of colours in IC_TC_P, (..., 3): 720 sqrt(dI^2 +
    (dT/2)^2 + dP^2), BT.2124 annex 1.
    """
    import colour

    return np.asarray(colour.delta_E(reference, test, method="ITP"))


def _lab(linear: Array) -> Array:
    """Return CIE L*a*b* of linear sRGB."""
    import colour

    space = colour.RGB_COLOURSPACES["sRGB"]
    return colour.XYZ_to_Lab(linear @ space.matrix_RGB_to_XYZ.T, space.whitepoint)


def _ictcp(luminance: Array) -> Array:
    """Return IC_TC_P, by PQ, of linear light with the primaries of sRGB [cd/m^2]."""
    import colour

    # Both spaces have the white D65, so no chromatic adaptation.
    wide = colour.matrix_RGB_to_RGB("sRGB", "ITU-R BT.2020", chromatic_adaptation_transform=None)
    # The matrices are rounded to four digits, which can leave a colour of the gamut's edge
    # below zero by 1e-4 of it.
    return colour.RGB_to_ICtCp(
        np.maximum(luminance @ wide.T, 0), method="ITU-R BT.2100-2 PQ", L_p=PQ_PEAK
    )


def _summary(values: Array) -> tuple[float | None, float | None, float | None]:
    """Return the mean, the 99 % quantile and the largest."""
    if not values.size:
        return None, None, None
    return float(values.mean()), float(np.quantile(values, 0.99)), float(values.max())
