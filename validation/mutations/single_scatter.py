# SPDX-License-Identifier: BSD-3-Clause
"""Faults of the physics in the integrator `single-scatter`, those of its densities before all."""

from validation.mutations.record import Mutation

_DISTANCES = "reference.monte_carlo.single_scatter.distance_sampling"
_LIGHT = "reference.monte_carlo.single_scatter.estimator"
_CELLS = "reference.monte_carlo.single_scatter.stretches"
_LEGS = "reference.monte_carlo.single_scatter.boundary_walk"


def _single_scatter(name: str, meaning: str, module: str, old: str, new: str, remark: str = "") -> Mutation:
    return Mutation(name, meaning, "single-scatter", module, old, new, remark)


MUTATIONS: tuple[Mutation, ...] = (
    _single_scatter(
        "equi-angular-without-height",
        "the distance of the light from the ray left out of the equi-angular density",
        _DISTANCES,
        "0.5 * h / (mixture.range * (h * h + s * s))",
        "0.5 / (mixture.range * (h * h + s * s))",
    ),
    _single_scatter(
        "free-flight-not-truncated",
        "the density of free flights without the normalisation by their truncation",
        _DISTANCES,
        "flight.rate * scale * survival",
        "flight.rate * survival",
    ),
    _single_scatter(
        "no-weights",
        "the multiple importance weights left out: both techniques count in full",
        _DISTANCES,
        "mi.Float(sum(mixture_pdfs(y, mixture)))",
        "mi.Float(mixture_pdfs(y, mixture)[0])",
    ),
    _single_scatter(
        "equal-cells",
        "the narrower cells at both ends weighed like the others",
        _CELLS,
        "return low / (count - 1), (high - low) / (count - 1)",
        "return low / (count - 1), mi.Float(1 / (count - 1))",
    ),
    _single_scatter(
        "traced-distance-not-squared",
        "1/r in the place of 1/r^2 along the ray",
        _LIGHT,
        "(width / (r * r * density))",
        "(width / (r * density))",
    ),
    _single_scatter(
        "traced-bright-shadow-leg",
        "the leg from the light not attenuated",
        _LEGS,
        "whole = dr.exp(-media.end_sigma_t * distance)",
        "whole = dr.exp(-media.end_sigma_t * 0)",
    ),
    _single_scatter(
        "traced-shadow-epsilon",
        "the leg from the light attenuated over a shadow ray that ends short of it, as in volpath",
        _LEGS,
        "whole = dr.exp(-media.end_sigma_t * distance)",
        "whole = dr.exp(-media.end_sigma_t * distance * (1 - 8.94e-4))",
    ),
    _single_scatter(
        "traced-bright-camera-leg",
        "the leg to the camera not attenuated",
        _LIGHT,
        "camera_leg = stretch.depth + stretch.sigma_t * (before + y)",
        "camera_leg = stretch.depth",
    ),
    _single_scatter(
        "leg-before-the-cone-forgotten",
        "the leg to the camera counted from the edge of a spot's cone",
        _LIGHT,
        "stretch.sigma_t * (before + y)",
        "stretch.sigma_t * y",
    ),
    _single_scatter(
        "traced-forward-is-backward",
        "the direction of the light reversed in the phase function",
        _LIGHT,
        "point, -from_light, active)",
        "point, from_light, active)",
    ),
    _single_scatter(
        "traced-extinction-for-scattering",
        "sigma_t in the place of sigma_s: the albedo dropped",
        _LIGHT,
        "return stretch.sigma_s * phase",
        "return stretch.sigma_t * phase",
    ),
    _single_scatter(
        "traced-short-shadow-rays",
        "shadow rays that miss the last tenth of the way to the point",
        _LEGS,
        "_SHORT_OF_POINT = 1e-5",
        "_SHORT_OF_POINT = 0.1",
    ),
    _single_scatter(
        "traced-surface-not-squared",
        "1/r in the place of 1/r^2 at the surface",
        _LIGHT,
        "leg / (r * r)\n",
        "leg / r\n",
    ),
    _single_scatter(
        "traced-surface-bright-camera-leg",
        "the leg from the surface to the camera not attenuated",
        _LIGHT,
        "sent * dr.exp(-camera_leg), 0)",
        "sent, 0)",
    ),
)
