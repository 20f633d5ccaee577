# SPDX-License-Identifier: BSD-3-Clause
"""The parameters of soft shafts. The defaults are those of Ali 2016, Fig. 4.9: 5
points, hd = 5, hr = 0.5.
"""

import math
from dataclasses import dataclass
from typing import Any

from airlight.errors import InputError
from airlight.realtime.area_lights.points import LightSamples
from airlight.realtime.methods.interface.method import Method
from airlight.realtime.parameters import MOST_STEPS, parameter
from airlight.realtime.shadow_maps.shadow_map import map_size

AUTO = "auto"


def check_width(value: Any) -> None:
    """Refuse a width that no filter can have.

    Raises InputError if `value` is neither 'auto' nor a number above 0 up to 64 [pixels].
    """
    if value == AUTO:
        return
    # A value that is no number, or NaN, fails the comparison below.
    try:
        width = float(value)
    except (TypeError, ValueError):
        width = math.nan
    most = 64.0  # [pixels]
    if not 0 < width <= most:
        raise InputError(
            f"hd: got {value!r}, expected 'auto' or a number above 0 to {most:g} [pixels]"
        )


def check_range(value: Any) -> None:
    """Refuse a range that no filter can have.

    Raises InputError if `value` is not above 0; it may be infinite.
    """
    if not value > 0:
        raise InputError(f"hr: got {value!r}, expected a number above 0, or inf for a Gaussian")


@dataclass(frozen=True)
class SoftShaftsParameters(Method):
    """The parameters of soft shafts, and what follows from them."""

    name = "soft-shafts"
    summary = "few points of a light, visibility in few levels, smoothed by bilateral filters"
    source = "Ali 2016, reconstructed from captions"
    prepared_from = frozenset({"geometry", "light"})
    casts_rays = True
    provides_visibility = True
    at_once = True
    light_samples = LightSamples(5, "ring")

    steps: int = parameter(32, "steps of every ray and light sample", least=1, most=MOST_STEPS)
    spacing: str = parameter(
        "uniform",
        "of the steps: in the distance, or in the angle at the light sample",
        choices=("uniform", "equiangular"),
    )
    shadow: str = parameter(
        "map",
        "of the steps: a look-up in a map, a shadow ray, or none",
        choices=("map", "ray", "none"),
    )
    surfaces: str = parameter(
        "map",
        "visibility of surfaces: by look-ups in the maps, or by a shadow ray",
        choices=("map", "ray"),
    )
    map: int = map_size(512, "texels on a side of the map of every light sample")
    scale: int = parameter(
        1,
        "airlight is computed in one pixel of so many, in rows and columns, and interpolated",
        choices=(1, 2, 4, 8),
    )
    interleave: bool = parameter(
        False,
        "each pixel of a tile of 4 x 4 takes one of the light samples and a shift of the steps of "
        "its own",
    )
    narrow: float = parameter(
        0.0,
        "with `interleave` and `hd=auto`: in penumbrae narrower than this every pixel tests four "
        "light samples",
        least=0,
        unit="pixels",
    )
    filter: str = parameter(
        "bilateral", "filters of visibility and airlight", choices=("bilateral", "gauss", "none")
    )
    hd: str = parameter(
        "5",
        "standard deviation of the filter in the image; auto: by pixel, from the width of the "
        "penumbra",
        unit="pixels",
        check=check_width,
        wanted="auto, or a number above 0 to 64",
    )
    hr: float = parameter(
        0.5,
        "standard deviation of the filter in visibility, and in log(1 + L / mean L) for airlight",
        check=check_range,
        wanted="a number above 0, or inf",
    )
    guide: str = parameter(
        "self",
        "values that the bilateral filter compares: the image itself, or depths",
        choices=("self", "depth"),
    )
    hz: float = parameter(
        0.05, "relative difference of depths at which pixels are no longer alike", above=0, most=10
    )

    def _check_together(self) -> None:
        if self.hd == AUTO and (self.filter != "bilateral" or self.guide != "depth"):
            raise InputError(
                "hd: auto has the depth for a guide; expected filter=bilateral guide=depth with it"
            )

    @property
    def width(self) -> float:
        """The standard deviation of the filter [pixels], not a number for `auto`."""
        return math.nan if self.hd == AUTO else float(self.hd)

    def error_causes(self, size):
        """Return the causes of its errors, see `Method.error_causes`."""
        # `hd=auto` needs a bilateral filter: without filter it is a number.
        plain = {"filter": "none"} | ({"hd": "5"} if self.hd == AUTO else {})
        without = "shadows" if self.shadow == "none" else "map"
        return (
            ("filter", plain),
            ("interleaving", {"interleave": False}),
            ("resolution", {"scale": 1}),
            (without, {"shadow": "ray"}),
            ("steps", None),
        )
