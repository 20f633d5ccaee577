# SPDX-License-Identifier: BSD-3-Clause
"""What a scene needs of a method: a frame runs the code that these features ask for, no other (DESIGN section 5)."""

from collections import Counter
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class SceneFeatures:
    """What a scene needs; every field chooses which code runs, and none is data."""

    shadows: bool  #: there is something that can cast a shadow
    surfaces: bool  #: there is something that the camera can see
    extinctions: int  #: 1 for a grey medium, 3 for a coloured one
    isotropic: bool  #: the phase function is a constant
    bounded: bool  #: the medium ends somewhere
    vacuum: bool  #: nothing is extinguished in at least one channel
    point_lights: int
    spot_lights: int
    soft_spots: bool  #: a spot's intensity falls off inside its cone
    directional_lights: int = 0
    area_lights: tuple[str, ...] = ()  #: the shapes of lights with extent: 'rectangle', 'disk', 'sphere' or 'mesh'
    clear: bool = False  #: bounded: nothing fills the space between the media
    concave: tuple[str, ...] = ()  #: shapes that bound media and are not all convex: clouds
    uneven: int = 0  #: clouds whose density differs from place to place
    sky: str = ""  #: the axis from which a uniform sky shines, '' where there is none; it is seen behind the scene
    height_fog: bool = False  #: the density of the medium depends on height
    grid: bool = False  #: the density of the medium is a grid
    notes: tuple[str, ...] = ()  #: what the user should know of this scene


def backgrounds(scene, *, clouds: bool = True) -> list[Any]:
    """Return what is seen behind a scene that lights in it light: an environment, or a sky that is no light of clouds.

    A constant emitter beside directional lights alone lights clouds (`realtime.scene.read_scene`), if there may be any.
    """
    around = {"EnvironmentMapEmitter", "ConstantBackgroundEmitter"}
    lights = {emitter.class_name() for emitter in scene.emitters()} - around
    around -= {"ConstantBackgroundEmitter"} if clouds and lights <= {"DirectionalEmitter"} else set()
    return [emitter for emitter in scene.emitters() if lights and emitter.class_name() in around]


def scene_notes(scene, *, clouds: bool = True) -> list[str]:
    """Return what the user should know of the cameras and the lights of a Mitsuba scene, a line each."""
    cameras = len(scene.sensors())
    notes = [f"the scene has {cameras} cameras: the first is used, the others are left out"] if cameras > 1 else []
    notes += [
        f"light '{emitter.id()}' around the scene is seen behind it; light of it that is scattered is left out"
        + " by methods: references and fog colours have it" * (emitter.class_name() == "ConstantBackgroundEmitter")
        for emitter in backgrounds(scene, clouds=clouds)
    ]
    return notes


def describe(features: SceneFeatures) -> dict[str, str]:
    """Return the features in words, one entry for each decision."""
    counts = (
        ("point", features.point_lights),
        ("spot", features.spot_lights),
        ("directional", features.directional_lights),
    )
    lights = [f"{count} {kind}" for kind, count in counts if count]
    lights += [f"{count} {shape} with extent" for shape, count in Counter(features.area_lights).items()]
    lights += [f"a sky, as a beam from {features.sky}"] if features.sky else []
    words = {
        "surfaces": "lit surfaces" if features.surfaces else "none: no ray is cast for the camera",
        "shadows": "visibility tests" if features.shadows else "none: nothing casts a shadow",
        "extinction": "one for all channels"
        if features.extinctions == 1
        else "one for each channel: three integrals a ray",
        "phase function": "isotropic: left out of the integrand"
        if features.isotropic
        else "anisotropic: split at the foot point",
        "medium": f"{len(features.concave)} clouds in clear air, bounded by meshes: rays cast at them"
        + f", {features.uneven} with a grid of densities: marched" * bool(features.uneven)
        if features.concave
        else f"bounded, in {'clear air' if features.clear else 'another medium'}: rays clipped, no kernel"
        if features.bounded
        else "height fog: depths and suns in closed form, panels of nodes for lights at places"
        if features.height_fog
        else "a density grid: marched, depths from cell to cell"
        if features.grid
        else "unbounded: every ray lies in it whole",
        "lights": " and ".join(lights),
        "spot falloff": "inside the cone: integrand weighted"
        if features.soft_spots
        else "none: rays are clipped to cones at most",
    }
    return words
