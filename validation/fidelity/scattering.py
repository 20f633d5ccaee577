# SPDX-License-Identifier: BSD-3-Clause
"""The ambient fog of Biri 2006 against the multiple scattering that it stands for.

The paper adds a constant ambient light in the medium, albedo A (1 - exp(-sigma_t x)), in place of what scatters more
than once. `volpath` with long paths less `volpath` with one scattering, of the same seeds, is what it should be. Both
are of the medium alone: surfaces are black. The constant A that fits best is a least-squares fit over the pixels and
channels of one image. What is then left over is taken from two images M1, M2 of other seeds, sqrt(mean((M1 - m)(M2 -
m)) / mean(M1 M2)), so that the noise of the paths does not count.
"""

from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from realtime.frame.renderer import render_frame
from realtime.scene.read_scene import read_scene
from reference.monte_carlo.batches import LAYERS
from validation.configurations.methods import configuration, prepared
from validation.estimates.monte_carlo import monte_carlo_batches
from validation.estimates.multiple_scattering import multiple_scattering_share
from validation.scenes.loading import load_scene, resize
from validation.scenes.open_fog import open_fog

Array = NDArray[np.float64]

SCENES = ("open-fog", "two-pens", "colonnade")
SIZE = (32, 24)  #: of the images [pixels]
_BATCHES, _SAMPLES, _DEPTH = 8, 8, 64
_THIN = 0.00173  # extinction of `open-fog` a hundred times as thin [1/m]: optical depth 0.009 to the lamp


def ambient_fog() -> dict[str, Any]:
    """Return by scene how well a constant stands for multiple scattering.

    Returns
    -------
    dict
        `constant` (that fits best [W/(m^2 sr)]), `left_over` (of multiple scattering after the fit, relative RMSE [1]),
        `share` (of multiple scattering in the airlight [1]), `relative` (the constant over the mean airlight [1]).
    """
    return {scene: _fitted(scene) for scene in SCENES}


def _fitted(name: str) -> dict[str, float]:
    scene = load_scene(name, SIZE).scene
    halves = [_multiple(scene, seed) for seed in (0, 1000)]
    fog = _fog(scene)
    both = 0.5 * (halves[0][0] + halves[1][0])
    constant = fitted_constant(fog, both)
    single = 0.5 * (halves[0][1] + halves[1][1])
    left = left_over(halves[0][0], halves[1][0], constant * fog)
    return {
        "constant": constant,
        "left_over": left,
        "share": float(both.mean() / (both.mean() + single.mean())),
        "relative": float(constant / (both.mean() + single.mean())),
    }


def fitted_constant(fog: Array, multiple: Array) -> float:
    """Return the factor of an image of ambient fog that brings it closest to one of multiple scattering."""
    return float(np.sum(fog * multiple) / np.sum(fog * fog))


def left_over(first: Array, second: Array, model: Array) -> float:
    """Return the relative RMSE of a model to the mean of two independent noisy images, without their noise; 0 at least.

    Parameters
    ----------
    first, second
        Images of one mean, with independent noise.
    model
        The image to judge.
    """
    squares = float(np.mean((first - model) * (second - model)) / np.mean(first * second))
    return max(0.0, squares) ** 0.5


def _multiple(scene: Any, seed: int) -> tuple[Array, Array]:
    """Return the airlight of two and more scatterings, and that of one, (pixels, 3)."""
    layer = LAYERS.index("airlight")
    whole, single = (
        monte_carlo_batches(
            scene, "volpath", batches=_BATCHES, samples=_SAMPLES, first_seed=seed, max_depth=depth
        ).batches.mean[layer]
        for depth in (_DEPTH, 2)
    )
    return whole - single, single


def _fog(scene: Any) -> Array:
    """Return the ambient fog of constant 1, (pixels, 3), as the method draws it."""
    read = read_scene(scene)
    lit, unlit = (
        render_frame(prepared(read, configuration("shadow-planes", "exact", values))).airlight.astype(np.float64)
        for values in ({"ambient": 1.0}, {})
    )
    return (lit - unlit).reshape(-1, 3)


def thin_media() -> dict[str, float]:
    """Return the share of the airlight that scatters more than once in `open-fog`, usual and 100 times thinner."""
    shares = {}
    for name, extinction in (("usual", None), ("thin", _THIN)):
        described = open_fog()
        if extinction is not None:
            described["fog"]["scale"] = extinction
        scene = mi.load_dict(described)
        resize(scene, SIZE)
        shares[name] = multiple_scattering_share(scene, batches=_BATCHES, samples=_SAMPLES).medium.value
    return shares
