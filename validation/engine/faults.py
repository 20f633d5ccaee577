# SPDX-License-Identifier: BSD-3-Clause
"""The catalogue of faults that an engine's image may have.

`airlight compare --diagnose` tries all of them. The hints of `airlight compare` are the faults with
an `undo`, which takes a fault back from a whole image, without any path of light.
"""

from dataclasses import replace

from airlight.validation.engine.fault import Fault, of_fog_alone, traits, with_scenery
from airlight.validation.engine.image_faults import BRIGHTNESS, CAMERA, VALUES
from airlight.validation.engine.layer_faults import FOG_AND_SURFACES, factor_fault, scaled
from airlight.validation.engine.light_faults import LIGHTS
from airlight.validation.engine.media_faults import MEDIUM
from airlight.validation.engine.prediction import Predictor
from airlight.validation.fog_model.view import light_sources

_MANY_LIGHTS = 6  # in a scene with more lights, no faults of single lights are looked for

_TABLES = {
    "brightness": (BRIGHTNESS,),
    "light": LIGHTS,
    "medium": MEDIUM,
    "layers": FOG_AND_SURFACES,
    "camera": CAMERA,
    "values": VALUES,
}
#: in the order in which faults happen
KINDS = ("medium", "light", "layers", "camera", "brightness", "values")
FAULTS = tuple(replace(fault, kind=kind) for kind, table in _TABLES.items() for fault in table)


def faults_of(predictor: Predictor) -> tuple[Fault, ...]:
    """Return the faults that an image of a scene may have, and with them the faults of its single
    lights and classes of lights.
    """
    # Lights are numbered in the order of `light_sources`: point and spot lights, directional ones,
    # area lights. A class that is all lights, or one light, is no group of its own.
    sources = light_sources(predictor.reference)
    near, far = (
        len(predictor.reference.lights),
        len(predictor.reference.lights) + len(predictor.reference.directional),
    )
    classes = {
        "point and spot lights": range(near),
        "directional lights": range(near, far),
        "area lights": range(far, len(sources)),
    }
    groups = {
        name: tuple(numbers) for name, numbers in classes.items() if 1 < len(numbers) < len(sources)
    }
    # A light that is the only one of its class is looked at even among many.
    singles = [(numbers[0],) for numbers in classes.values() if len(numbers) == 1 < len(sources)]
    if 1 < len(sources) <= _MANY_LIGHTS:
        singles = [(number,) for number in range(len(sources))]
    groups |= {f"the light '{sources[number].name}'": (number,) for (number,) in singles}
    # Faults of each group, or of a single light: its factor, its factor in the fog, and no shadows
    # in all of its light or in the fog alone.
    group_faults = []
    for which, numbers in groups.items():
        are, they = ("is", "it") if len(numbers) == 1 else ("are", "they")
        words = f"{which} {are} {{0:.4g}} times as bright as {they} should be"
        group_faults.append(factor_fault("light-factor", words, scaled("intensity", numbers)))
        words = f"the fog of {which} is {{0:.4g}} times as bright as it should be"
        group_faults.append(
            factor_fault("fog-factor", words, scaled("airlight", numbers), ("both",))
        )
        unshadowed = with_scenery(unshadowed=numbers)
        for change, where, needs in (
            (unshadowed, "", ("shapes",)),
            (of_fog_alone(unshadowed), " in the fog, on surfaces it does", ("both",)),
        ):
            words = f"nothing casts a shadow in the light of {which}{where}"
            group_faults.append(Fault("no-shadow", words, change, needs=needs, kind="light"))
    traits_of_scene = traits(predictor)
    return tuple(
        fault
        for fault in (*FAULTS, *group_faults)
        if all(traits_of_scene[need] for need in fault.needs)
    )
