# SPDX-License-Identifier: BSD-3-Clause
"""The filters that the parameters ask for, for the visibility of surfaces and for airlight."""

import math
from typing import Any

import drjit as dr

from realtime.image_filters import Guide, Raster, airlight_guide, bilateral, bilateral_of_levels, separable
from realtime.methods.soft_shafts.parameters import AUTO, SoftShaftsParameters


def smooth_share(
    share: Any, raster: Raster, *, there: Any, depth: Guide, points: int, levels: bool, p: SoftShaftsParameters
) -> Any:
    """Return the share of a light that reaches the surfaces, filtered.

    `share`: from 0 to 1, row by row; `raster`: the image; `there`: where there are surfaces: the sky takes no part;
    `depth`: the guide of their depth; `points`, `levels`: N, and whether the share has N + 1 levels; `p`: the
    parameters, with a filter whose `hd` is a number.
    """
    if p.filter == "gauss" or p.guide == "self":
        hr = math.inf if p.filter == "gauss" else p.hr
        if levels:
            return bilateral_of_levels(share, raster, levels=points, hd=p.width, hr=hr, there=there)
        # The sky is unlike all surfaces.
        sky = Guide(dr.select(there, type(share)(0), 1), 1e-3)
        guides = (sky,) if math.isinf(hr) else (sky, Guide(share, hr))
        return _filtered(share, raster, guides, p.width)
    return _filtered(share, raster, (depth,), p.width)


def smooth_airlight(integral: Any, raster: Raster, *, depth: Guide, p: SoftShaftsParameters) -> Any:
    """Return airlight filtered; `hd` counts pixels of the full image, whatever the scale of this one."""
    if p.filter == "none" or p.hd == AUTO:
        return integral
    guides: tuple[Guide, ...] = ()
    if p.filter == "bilateral" and p.guide == "depth":
        guides = (depth,)
    elif p.filter == "bilateral" and not math.isinf(p.hr):
        guides = (airlight_guide(integral, p.hr),)
    return _filtered(integral, raster, guides, p.width / p.scale)


def _filtered(image: Any, raster: Raster, guides: tuple[Guide, ...], hd: float) -> Any:
    return (bilateral if guides else separable)(image, raster, hd=hd, guides=guides)
