# SPDX-License-Identifier: BSD-3-Clause
"""Approximations of the light in Biri 2006 and Billeter 2010: multiple scattering, and the
constant R of bounded media.

*Ambient fog.* Biri adds a constant ambient light in the medium, albedo A (1 - exp(-sigma_t x)), in
place of multiple scattering. The right value, for the medium alone, is `volpath` with long paths
less `volpath` with one scattering, of the same seeds. The constant A that fits best is a
least-squares fit over the pixels and channels of an image. The residual is computed from two images
M1, M2 of other seeds, sqrt(mean((M1 - m)(M2 - m)) / mean(M1 M2)), so that the noise of the paths
does not count.

*The constant R* (section 4.2). The camera looks at a sphere of one medium in vacuum, which a lamp
outside the sphere lights from above. R, the mean distance between a point of the boundary and a
point of the medium, is 1.2 radii in a sphere. A path from far away has a mean length of 0.75 radii
within the sphere (the mean of half a chord over the volume): R is 60 % too long, and the airlight
too dark by about exp(-0.45 sigma_t radius).
"""

from __future__ import annotations

import math
from itertools import product
from statistics import median
from typing import Any

import mitsuba as mi
import numpy as np

from airlight.realtime.frame.image import render_frame
from airlight.realtime.scene.read_scene import Scene, read_scene
from airlight.reference.monte_carlo.batches import LAYERS
from airlight.validation.arrays import Array
from airlight.validation.estimates.monte_carlo import monte_carlo_batches
from airlight.validation.estimates.multiple_scattering import multiple_scattering_fraction
from airlight.validation.metrics.errors import error_metrics, known
from airlight.validation.papers.claims import INTERVAL, Figure, Figures
from airlight.validation.scenes.loading import load_scene, resize
from airlight.validation.scenes.parts import Plugin, camera, fog, point_light
from airlight.validation.scenes.registry import SCENES
from airlight.validation.study.configuration import configuration, prepared

_SCENES = ("open-fog", "two-pens", "colonnade")
_SIZE = (32, 24)  # of the images of multiple scattering [pixels]
_BATCHES, _SAMPLES, _DEPTH = 8, 8, 64


SIZES = (0.05, 0.17, 0.43, 0.83)  #: radius over the distance from the lamp to the centre
OPTICAL_DEPTHS = (0.03, 0.31, 1.1, 3.1, 9.7)  #: of the diameter


def multiple_scattering() -> Figures:
    """Return the multiple scattering that a constant misses, worst of three scenes, and
    its fraction in thin fog.
    """
    described = SCENES["open-fog"].build()
    # `open-fog` a hundred times as thin [1/m]: optical depth 0.009 to the lamp
    medium: Any = described["fog"]
    medium["scale"] = 0.00173
    scene = mi.load_dict(described)
    resize(scene, _SIZE)
    thin = multiple_scattering_fraction(scene, batches=_BATCHES, samples=_SAMPLES).medium
    # In thin fog the second scattering is a fraction in proportion to the optical depth.
    value, low, high = (math.nan if each is None else each for each in (thin.value, *thin.interval))
    return {
        "left over": max(map(_left_over, _SCENES)),
        "thin": Figure(value, low, high, INTERVAL),
    }


def _left_over(name: str) -> float:
    scene = load_scene(name, _SIZE).scene
    # Two images with independent noise: the product of their residuals has the mean of the squared
    # bias, without the noise.
    first, second = (_multiple(scene, seed) for seed in (0, 1000))
    ambient = _ambient(read_scene(scene))
    return left_over(first, second, fitted_constant(ambient, 0.5 * (first + second)) * ambient)


def fitted_constant(fog: Array, multiple: Array) -> float:
    """Return the factor of an image of ambient fog that brings it closest to
    one of multiple scattering.
    """
    return float(np.sum(fog * multiple) / np.sum(fog * fog))


def left_over(first: Array, second: Array, model: Array) -> float:
    """Return the relative RMSE of a model to the mean of two images with independent noise, without
    the part of the noise; 0 at least.
    """
    # Noise can make the estimate of a square negative.
    squares = float(np.mean((first - model) * (second - model)) / np.mean(first * second))
    return max(0.0, squares) ** 0.5


def _multiple(scene: mi.Scene, seed: int) -> Array:
    """Return the airlight of two and more scatterings, (pixels, 3)."""
    # The same seeds: most of the noise of the first scattering cancels in the difference.
    whole, single = (
        monte_carlo_batches(
            scene, "volpath", batches=_BATCHES, samples=_SAMPLES, first_seed=seed, max_depth=depth
        ).batches.mean[LAYERS.index("airlight")]
        for depth in (_DEPTH, 2)
    )
    return whole - single


def _ambient(scene: Scene) -> Array:
    """Return the ambient fog of constant 1, (pixels, 3), as the method draws it."""
    # The method adds the ambient light to the airlight; the difference is the ambient light alone.
    lit, unlit = (
        render_frame(
            prepared(scene, configuration("shadow-planes-2006", "exact", values))
        ).airlight.astype(np.float64)
        for values in ({"ambient": 1.0}, {})
    )
    return (lit - unlit).reshape(-1, 3)


def constant_distance(image: tuple[int, int] = (64, 48)) -> dict[str, float]:
    """Return the largest bias of the constant R, and what the polynomial and the printed
    equation have of its error.

    The errors are those of `SIZES` and `OPTICAL_DEPTHS` over the pixels that see the medium, in
    float64: with the constant R against `media=exact`, of the same by the polynomial of degree 4,
    and of the equation as printed, summed over nodes.
    """
    biases, ratios = [], []
    for size, depth in product(SIZES, OPTICAL_DEPTHS):
        scene = read_scene(mi.load_dict(sphere_in_vacuum(size, depth, image)), "double")
        # Float64: rounding plays no part in the comparison.
        exact = _airlight(scene, "exact")
        forms = [("paper", "exact"), ("paper", "taylor"), ("printed", "exact")]
        # Only pixels whose ray meets the sphere: vacuum has no airlight, and would only dilute the
        # errors.
        paper, taylor, printed = (
            error_metrics(exact, _airlight(scene, *form), mask=exact[..., 1] > 0) for form in forms
        )
        biases.append(abs(known(paper.relative_bias)))
        error = known(paper.relative_rmse)
        ratios.append((known(taylor.relative_rmse) / error, known(printed.relative_rmse) / error))
    polynomial, printed_form = zip(*ratios)
    return {
        "largest bias": max(biases),
        "printed, median": median(printed_form),
        "polynomial, median": median(polynomial),
        "polynomial, largest": max(polynomial),
    }


def sphere_in_vacuum(size: float, optical_depth: float, image: tuple[int, int]) -> Plugin:
    """Return a scene of a sphere of fog as high as the view, and a lamp at radius/size from its
    centre; the `image` has a width and a height [pixels].
    """
    above, radius = np.array([0.37, -0.31, 3.07]), 0.97  # direction to the lamp; of the sphere [m]
    lamp = above / np.linalg.norm(above) * (radius / size)
    # `optical_depth` belongs to the diameter
    medium = fog(0.5 * optical_depth / radius, (0.83, 0.83, 0.83))
    return {
        "type": "scene",
        "sensor": camera((0.13, -5.3, 0.21), (0.0, 0.0, 0.0), fov=27.1, size=image, in_fog=False),
        "lamp": point_light(lamp.tolist(), (3.1, 3.1, 3.1)),
        "ball": {"type": "sphere", "radius": radius, "bsdf": {"type": "null"}, "interior": medium},
    }


def _airlight(scene: Scene, media: str, kernel: str = "exact") -> Array:
    return render_frame(
        prepared(scene, configuration("shadow-planes-2006", kernel, {"media": media}))
    ).airlight
