# SPDX-License-Identifier: BSD-3-Clause
"""The formulas of the faults of `faults.toml`, by the names that they have there.

A formula is a function of the quantity that the fault changes, and of the numbers of the fault.
`targets.py` says where in a guess of an image this quantity is.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from airlight.analytic.height_fog import Layer
from airlight.validation.arrays import Array
from airlight.validation.engine.curves import (
    agx,
    blender_filmic,
    exponential,
    filmic,
    from_srgb,
    gamma,
    reinhard,
    srgb_in_8_bits,
    to_pq,
    to_srgb,
)
from airlight.validation.fog_model.laws import WINDOWS as RANGES
from airlight.validation.fog_model.laws import Falloff, clamped, of_a_disk, softened
from airlight.validation.fog_model.radiance import PhaseLaw

# The medium: extinction and albedo, phase functions, layers of height fog.


def absorption_times(sigma_t: float, albedo: float, factor: float = 0.0) -> tuple[float, float]:
    """Return extinction and albedo of a medium whose absorption has a factor; the scattering
    stays.
    """
    # The albedo is the same scattering over the new extinction.
    scattering = sigma_t * albedo
    extinction = scattering + factor * (sigma_t - scattering)
    return extinction, scattering / extinction if extinction > 0 else albedo


#: Extinction [1/m] and albedo [1] of a channel, as functions of both as they should be.
OPTICS: Mapping[str, Callable[..., tuple[float, float]]] = {
    "one over the extinction": lambda sigma_t, albedo: (1 / sigma_t, albedo),
    "extinction times": lambda sigma_t, albedo, factor: (sigma_t * factor, albedo),
    "absorption times": absorption_times,
    "extinction as scattering": lambda sigma_t, albedo: (
        (sigma_t / albedo if albedo > 0 else sigma_t),
        albedo,
    ),
    "albedo twice": lambda sigma_t, albedo: (sigma_t, albedo**2),
    "albedo of one": lambda sigma_t, albedo: (sigma_t, 1.0),
    "albedo decoded": lambda sigma_t, albedo: (sigma_t, float(from_srgb(np.array(albedo)))),
    "albedo encoded": lambda sigma_t, albedo: (sigma_t, float(to_srgb(np.array(albedo)))),
}


def schlick(k: float) -> PhaseLaw:
    """Return Schlick's phase function (Blasi et al. 1993)."""
    return lambda cosine: (1 - k * k) / (1 - k * cosine) ** 2


def cornette_shanks(g: float) -> PhaseLaw:
    """Return the phase function of Cornette and Shanks (1992)."""
    return lambda cosine: (
        1.5 * (1 - g * g) / (2 + g * g) * (1 + cosine**2) / (1 + g * g - 2 * g * cosine) ** 1.5
    )


def rayleigh(cosine: Array) -> Array:
    """Return Rayleigh's phase function."""
    return 0.75 * (1 + cosine**2)


def cosine_lobe(cosine: Array) -> Array:
    """Return a clamped cosine of mean 1, as of a surface that faces the light."""
    return 4 * np.maximum(cosine, 0.0)


#: Another g, or another phase function, in the place of Henyey and Greenstein's with g.
LOBES: Mapping[str, Callable[..., float | PhaseLaw]] = {
    "minus g": lambda g: -g,
    "another g": lambda g, value: value,
    "isotropic": lambda g: 0.0,
    "Schlick, k = 1.55 g - 0.55 g^3": lambda g: schlick(1.55 * g - 0.55 * g**3),
    "Schlick, k = g": schlick,
    "Cornette-Shanks": cornette_shanks,
}

#: A phase function, or g of Henyey and Greenstein's, in the place of any other.
PHASES: Mapping[str, Callable[..., float | PhaseLaw]] = {
    "Henyey-Greenstein": lambda g: g,
    "Rayleigh": lambda: rayleigh,
    "cosine": lambda: cosine_lobe,
}

#: A layer of height fog, as a function of the layer as it should be.
LAYERS: Mapping[str, Callable[..., Layer]] = {
    "one over the scale height": lambda layer: replace(layer, scale_height=1 / layer.scale_height),
    "scale height over ln 2": lambda layer: replace(
        layer, scale_height=layer.scale_height / math.log(2)
    ),
    "scale height times ln 2": lambda layer: replace(
        layer, scale_height=layer.scale_height * math.log(2)
    ),
    "scale height times": lambda layer, factor: replace(
        layer, scale_height=layer.scale_height * factor
    ),
    "base moved": lambda layer, shift: replace(layer, base=layer.base + shift),
    "scale height times, base moved": lambda layer, factor, shift: replace(
        layer, base=layer.base + shift, scale_height=layer.scale_height * factor
    ),
}


# The light of lights by the distance r from them [m], as a factor on what it should be.


#: r^2 f(r) of another distance law f than 1/r^2.
LAWS: Mapping[str, Callable[..., Array]] = {
    "one over the distance": lambda r: r,
    "no fall": lambda r: r**2,
    "softened": softened,
    "of a disk": of_a_disk,
    "clamped": clamped,
}


def _in_range(factor: Falloff) -> Callable[[Array, float], Array]:
    """Return a factor by the distance r, of a function of r/R up to the range R."""
    return lambda r, end: factor(np.minimum(r / end, 1.0))


WINDOWS: Mapping[str, Callable[..., Array]] = {
    "(1 - (r/R)^4)^2": _in_range(RANGES["quartic"]),
    "1 - (r/R)^4": _in_range(RANGES["fourth"]),
    "(1 - (r/R)^2)^2": _in_range(RANGES["square"]),
    "1 - r/R": _in_range(RANGES["linear"]),
    "r < R": _in_range(RANGES["cut"]),
}


# Airlight, surfaces and values of the image.

_LEAST_OPACITY = 1e-6  # by which fog is divided: a ray through no fog has no fog to divide

#: Airlight and surfaces, (m, 3) each, by both as they should be and the transmittance of the fog.
MIXES: Mapping[str, Callable[..., tuple[Array, Array]]] = {
    "fog times opacity": lambda airlight, surface, transmittance: (
        airlight * (1 - transmittance),
        surface,
    ),
    "fog over opacity": lambda airlight, surface, transmittance: (
        airlight / np.maximum(1 - transmittance, _LEAST_OPACITY),
        surface,
    ),
    "fog times transmittance": lambda airlight, surface, transmittance: (
        airlight * transmittance,
        surface,
    ),
    "surfaces times transmittance": lambda airlight, surface, transmittance: (
        airlight,
        surface * transmittance,
    ),
    "mixed by opacity": lambda airlight, surface, transmittance: (
        airlight * (1 - transmittance),
        surface * transmittance,
    ),
    "fog of a largest opacity": lambda airlight, surface, transmittance, most: (
        airlight * np.minimum(1.0, most / np.maximum(1 - transmittance, _LEAST_OPACITY)),
        surface,
    ),
    "fog plus light times opacity": lambda airlight, surface, transmittance, *light: (
        airlight + np.array(light) * (1 - transmittance),
        surface,
    ),
}

#: Values by the values as they should be, (m, 3) or (height, width, 3).
VALUES: Mapping[str, Callable[..., Array]] = {
    "sRGB": to_srgb,
    "from sRGB": from_srgb,
    "sRGB in 8 bits": srgb_in_8_bits,
    "gamma": gamma,
    "PQ": to_pq,
    "x/(1 + x)": reinhard,
    "1 - exp(-x)": exponential,
    "ACES": filmic,
    "x/(1 + x), sRGB": lambda radiance: to_srgb(reinhard(radiance)),
    "ACES, sRGB": lambda radiance: to_srgb(filmic(radiance)),
    "Filmic": blender_filmic,
    "AgX": agx,
    "added": lambda radiance, level: radiance + level,
}

#: Turns of an image, (height, width, 3) -> the same. Each is its own inverse.
TURNS: Mapping[str, Callable[[Array], Array]] = {
    "upside down": lambda image: image[::-1],
    "mirrored": lambda image: image[:, ::-1],
    "turned": lambda image: image[::-1, ::-1],
    "transposed": lambda image: image.transpose(1, 0, 2),
}


def reordered(order: str) -> Callable[[Array], Array]:
    """Return a function that gives the channels of an image another order, such as 'B, G, R'."""
    channels = ["RGB".index(channel) for channel in order.split(", ")]
    return lambda radiance: radiance[..., channels]
