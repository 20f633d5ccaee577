# SPDX-License-Identifier: BSD-3-Clause
"""Whether an image of clouds that is too bright holds light that was scattered more than once.

The reference of a scene is light of one scattering. Let m be the light of all further orders over
that of the first, as means over an image, and x the relative excess of an image over the reference.
An image of all orders has x = m. Further orders are named where

    min(1, m / 2) <= x <= 2 m.

Methods that approximate further orders miss them by factors, of which two are allowed. Where m is
above 1, as in most clouds, all x from 1 on count: single scattering is the smaller part there, and
no fault of it is told from an error of the larger one.

Clouds are what `cloud-paths` can have: bounded media under suns and a sky. In other scenes the
diagnosis predicts further orders pixel by pixel.
"""

from collections.abc import Callable
from dataclasses import dataclass

from airlight.errors import InputError
from airlight.reference.scene.clouds import read_clouds
from airlight.reference.storage.exr import TOTAL
from airlight.validation.engine.observation import SURFACE
from airlight.validation.estimates.monte_carlo import monte_carlo_batches
from airlight.validation.scenes.loading import LoadedScene

_LONGER_SIDE = 32  # pixels of the image whose mean light is wanted: a few seconds
_BRIGHTER = 0.1  # relative: further orders of clouds are never less


@dataclass(frozen=True)
class OtherOrders:
    """The light of further orders in a scene of clouds, and how bright an image is."""

    scene: str
    more: float  #: light of all further orders over that of single scattering [1]
    excess: float  #: the image over the reference, less 1

    @property
    def dominate(self) -> bool:
        """Whether single scattering is the smaller part of the light."""
        return self.more > 1

    @property
    def words(self) -> str:
        """Return a sentence."""
        return (
            f"the image is {1 + self.excess:.3g} times as bright as light that was scattered once, "
            f"which is all that the reference has; light of all orders is about {1 + self.more:.2g} times "
            f"as bright: compare the image with that of `airlight reference {self.scene} "
            "--estimator cloud-paths -o FILE`"
        )


def other_orders(
    loaded: LoadedScene,
    at_size: Callable[[tuple[int, int]], LoadedScene],
    holds: str,
    relative_bias: float | None,
) -> OtherOrders | None:
    """Return the light of further orders where an image may hold it; None where it does not.

    Parameters
    ----------
    loaded, at_size
        The scene at the size of the image, and a function that loads it at another size.
    holds
        The light that the image holds, see `judged_layer`.
    relative_bias
        The bias of the image against the reference [1].
    """
    if relative_bias is None or relative_bias < _BRIGHTER:
        return None
    if not loaded.model.is_physical or holds == SURFACE:
        return None
    try:
        read_clouds(loaded.scene)
        width, height = (int(n) for n in loaded.scene.sensors()[0].film().size())
        part = _LONGER_SIDE / max(width, height)
        size = max(round(width * part), 1), max(round(height * part), 1)
        batches = monte_carlo_batches(
            at_size(size).scene, "cloud-paths", orders=("1", "2-inf"), batches=8, samples=16
        ).batches
    except InputError:  # no clouds
        return None
    light = dict(zip(batches.layers, batches.mean.mean(axis=(1, 2)), strict=True))
    once, more = light["airlight_1"], light["airlight_2_inf"]
    if holds == TOTAL:
        # Surfaces lit without any scattering belong to the reference, all others do not.
        once += light["surface_straight"]
        more += light["surface"] - light["surface_straight"]
    if not once > 0:
        return None
    found = OtherOrders(loaded.name, float(more / once), relative_bias)
    is_named = min(1.0, found.more / 2) <= found.excess <= 2 * found.more
    return found if is_named else None
