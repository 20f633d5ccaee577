# SPDX-License-Identifier: BSD-3-Clause
"""The experiments that measure the figures of claims, by name."""

import importlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Experiment:
    """What measures the figures of some claims."""

    function: str  #: of a module beside this one, 'module:function'; called without arguments it gives the figures
    seconds: float  #: that it takes on two threads, about
    effort: str = "paper"  #: the least of 'quick', 'default', 'full' whose reports have it; 'paper': only the command

    def run(self) -> dict[str, Any]:
        """Return the figures by name; see `validation.papers.claims.Figures`."""
        module, function = self.function.split(":")
        return getattr(importlib.import_module(f"validation.papers.{module}"), function)()


EFFORTS = ("quick", "default", "full", "paper")

#: Those of quick reports render no image.
EXPERIMENTS: Mapping[str, Experiment] = {
    "formulas": Experiment("formulas:formulas", 7.0, "quick"),
    "stencil": Experiment("stencil:stencil", 1.0, "quick"),
    "orders": Experiment("shadow_planes:orders", 18.0, "default"),
    "shortcuts": Experiment("shadow_planes:shortcuts", 8.0, "default"),
    "multiple scattering": Experiment("scattering:multiple_scattering", 18.0, "default"),
    "constant distance": Experiment("scattering:constant_distance", 3.0, "default"),
    "maps": Experiment("light_volumes:maps", 5.0, "default"),
    "tessellation": Experiment("light_volumes:tessellation", 4.0, "default"),
    "triangles": Experiment("light_volumes:triangle_times", 10.0, "default"),
    "biri tables": Experiment("biri_tables:biri_tables", 70.0, "default"),
    "billeter tables": Experiment("billeter_tables:billeter_tables", 150.0, "full"),
    "soft shafts": Experiment("soft_shafts:soft_shafts", 60.0),
    "cloud slab": Experiment("slab:slab_figures", 20.0),
    "cloud transport": Experiment("slab:transport_figures", 400.0),
    "clouds": Experiment("clouds:clouds_figures", 600.0),
    "cloud frames": Experiment("clouds:cloud_frames", 60.0),
}
