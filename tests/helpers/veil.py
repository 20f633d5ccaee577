# SPDX-License-Identifier: BSD-3-Clause
"""A method that uses most of the interface: a veil before the scene that
fades in from frame to frame.
"""

from dataclasses import dataclass

import drjit as dr

from airlight.realtime.methods.interface.method import Layers, Method
from airlight.realtime.parameters import parameter


@dataclass(frozen=True)
class Veil(Method):
    """A veil that glows as far as each surface is near."""

    name = "veil"
    summary = "a veil"
    source = "tests"
    provides_visibility = True
    carries = True
    at_once = True

    fraction: float = parameter(
        0.5, "fraction of every light that reaches the surfaces", least=0, most=1
    )
    veil: float = parameter(0.8, "transmittance of the veil", above=0, most=1)
    keep: float = parameter(0.25, "weight of the last frame", least=0, below=1)

    def prepare(self, scene, light):
        """Return how bright the veil is under a light."""
        return 0.1 * light.intensity

    def render(self, view, state, kernel):
        """Return the layers of every ray."""
        Color = type(view.medium.albedo)
        glow = sum(state) * dr.exp(-dr.minimum(view.distance, 99))
        if view.carried is not None:
            glow = dr.lerp(glow, view.carried, self.keep)
        background = dr.select(dr.isfinite(view.distance), Color(0), Color(0.3, 0.4, 0.5))
        fractions = tuple(self.fraction for _ in view.lights)
        return Layers(glow, fractions, Color(self.veil), background, carried=glow)
