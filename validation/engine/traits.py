# SPDX-License-Identifier: BSD-3-Clause
"""The features of a scene and its image that faults need."""

import numpy as np

from airlight.analytic.phase import HenyeyGreenstein, Isotropic
from airlight.validation.engine.observation import stopped
from airlight.validation.engine.prediction import Predictor


def traits(predictor: Predictor) -> dict[str, bool]:
    """Return whether a scene and its image have what faults need, by the words of `Fault.needs`."""
    reference, fog = predictor.reference, predictor.fog
    holds, values = predictor.observation.holds, predictor.observation.values
    shapes = bool(reference.occluders.shapes())
    spots = [light for light in reference.lights if light.axis is not None]
    right, model = predictor.unchanged, predictor.observation.equation
    # A pixel that is infinite, as of a lamp in a file of halves, says nothing of colours.
    finite = values[np.isfinite(values).all(axis=1)]
    # Henyey and Greenstein's phase functions have a g, which is a number.
    lobes = any(isinstance(g, float) for g in fog.phase)
    # The pairs of extinction and albedo of all channels of all media.
    optics = [
        pair
        for media in zip(fog.sigma_t, fog.albedo, strict=True)
        for pair in zip(*media, strict=True)
    ]
    return {
        "shapes": shapes,
        "lamps": bool(reference.lights),  # point and spot lights
        "suns": bool(reference.directional),
        "physics": model.is_physical,  # no other equation is asked for
        "point lights": len(spots) < len(reference.lights),
        "spots": bool(spots),
        "soft spots": any(0 < light.beam < light.cutoff for light in spots),
        "no bounds": not reference.media,
        "height fog": fog.height is not None,
        "even fog": fog.height is None,
        "clamped layers": fog.height is not None and fog.height.clamped,
        "rising layers": fog.height is not None and not fog.height.clamped,
        "fog": holds != "surface",  # in the image
        "all light": holds == "total",
        "both": holds == "total" and shapes,  # fog and surfaces in one layer
        "absorption": any(s > 0 and a < 1 - 1e-6 for s, a in optics),
        "lobes": lobes and holds != "surface",  # of Henyey and Greenstein
        "g": lobes and holds != "surface" and any(fog.phase),  # other than 0
        "known g": all(
            isinstance(medium.phase, HenyeyGreenstein | Isotropic)
            for medium in (reference.medium, *reference.media)
        ),
        "isotropy": not lobes
        and any(medium.phase.is_constant for medium in (reference.medium, *reference.media)),
        "square": predictor.shape[0] == predictor.shape[1],
        "oblong": predictor.shape[0] != predictor.shape[1],
        "colours": bool(
            np.ptp(finite, axis=1).max(initial=0.0) > 1e-6 * np.abs(finite).max(initial=0.0)
        ),
        "stop": bool(stopped(values).any()),  # of many values
        # More light than there should be: higher orders take none away. Those of another equation
        # nobody knows.
        "more light": model.is_physical
        and float(np.median(predictor.shown(right) - predictor.predicted(right))) > 0,
    }
