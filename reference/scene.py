# SPDX-License-Identifier: BSD-3-Clause
"""Reading a Mitsuba scene for the ground truth, in float64 NumPy.

`realtime.scene` reads the same scene for the methods under test. The two share no code on purpose: this one asks
Mitsuba's emitters for their intensity and reads the parameters of the medium, where the other does it the other way
round.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analytic.errors import InputError
from analytic.phase import PhaseFunction

Array = NDArray[np.float64]


@dataclass(frozen=True)
class TruthLight:
    """A point or spot light."""

    position: Array  #: [m]
    intensity: Array  #: radiant intensity on the axis [W/sr], RGB
    axis: Array | None = None  #: spot: unit vector
    cutoff: float = np.pi  #: spot: half angle of the cone [rad]
    beam: float = np.pi  #: spot: half angle of full intensity [rad]


@dataclass(frozen=True)
class TruthMedium:
    """A homogeneous medium without bounds."""

    sigma_t: Array  #: extinction [1/m], RGB
    albedo: Array  #: RGB
    phase: PhaseFunction
    plugin: Any  #: Mitsuba's medium


@dataclass(frozen=True)
class TruthScene:
    """A scene as the truth sees it."""

    scene: Any  #: the `mi.Scene`
    width: int
    height: int
    origin: Array  #: the pinhole [m], (3,)
    direction: Array  #: unit directions through the pixel centres, (pixels, 3), row by row
    medium: TruthMedium
    lights: tuple[TruthLight, ...]


def read_truth(scene) -> TruthScene:
    """Read a Mitsuba scene of the current RGB variant.

    Raises
    ------
    InputError
        For a scene whose truth cannot be computed, with the name of what is in the way.
    """
    if not scene.sensors():
        raise InputError("the scene has no camera; wanted a sensor of type 'perspective'")
    sensor = scene.sensors()[0]
    width, height = (int(n) for n in sensor.film().size())
    medium = _read_medium(sensor)
    lights = tuple(_read_light(emitter) for emitter in scene.emitters())
    if not lights:
        raise InputError("the scene has no light; wanted at least one emitter of type 'point' or 'spot'")
    for shape in scene.shapes():
        if shape.interior_medium() is not None or shape.exterior_medium() is not None:
            raise InputError(f"shape '{shape.id()}' bounds a medium; wanted one unbounded medium")
    origin, direction = _pixel_centres(sensor, width, height)
    return TruthScene(scene, width, height, origin, direction, medium, lights)


def _pixel_centres(sensor, width: int, height: int) -> tuple[Array, Array]:
    """Return the pinhole and the directions through the pixel centres.

    Mitsuba's own `sample_ray` gives them in float32, and from the near clip plane on; near a light that rounding is
    worth 1e-5 of the airlight. Here they are derived in float64, in units of a pixel on the plane where pixels are
    squares of size 1; a test holds them against `sample_ray`.
    """
    import mitsuba as mi

    parameters = mi.traverse(sensor)
    half_width = np.tan(0.5 * np.deg2rad(float(parameters["x_fov"][0])))
    matrix = np.array(sensor.world_transform().matrix, dtype=np.float64).reshape(4, 4)
    row, column = np.divmod(np.arange(width * height), width)
    pixel = 2 * half_width / width
    # In the camera's own frame x points left and y up.
    plane = np.stack([0.5 * (width - 1) - column, 0.5 * (height - 1) - row, np.full(width * height, 1 / pixel)], axis=1)
    direction = plane @ matrix[:3, :3].T
    return matrix[:3, 3], direction / np.linalg.norm(direction, axis=1, keepdims=True)


def _read_medium(sensor) -> TruthMedium:
    import mitsuba as mi

    medium = sensor.get_medium()
    if medium is None:
        raise InputError("the camera references no medium: it would be in a vacuum; reference the medium in the sensor")
    if not medium.is_homogeneous():
        raise InputError(f"the medium is a {medium.class_name()}; wanted a medium of type 'homogeneous'")
    parameters = mi.traverse(medium)
    sigma_t = _rgb(parameters["sigma_t.value.value"]) * float(parameters["scale"])
    return TruthMedium(sigma_t, _rgb(parameters["albedo.value.value"]), _read_phase(medium.phase_function()), medium)


def _read_phase(phase) -> PhaseFunction:
    import mitsuba as mi

    parameters = mi.traverse(phase)
    name = phase.class_name()
    if name == "IsotropicPhaseFunction":
        return PhaseFunction("isotropic")
    if name == "RayleighPhaseFunction":
        return PhaseFunction("rayleigh")
    if name == "HGPhaseFunction":
        return PhaseFunction("hg", g=float(parameters["g"][0]))
    if name == "TabulatedPhaseFunction":
        return PhaseFunction("tabulated", table=tuple(float(v) for v in np.array(parameters["values"])))
    raise InputError(f"the phase function is a {name}; wanted one of isotropic, hg, rayleigh, tabphase")


def _read_light(emitter) -> TruthLight:
    import drjit as dr
    import mitsuba as mi

    name = emitter.class_name()
    if name not in ("PointLight", "SpotLight"):
        raise InputError(f"the scene has an emitter of class {name}; wanted emitters of type 'point' or 'spot' only")
    parameters = mi.traverse(emitter)
    matrix = np.array(emitter.world_transform().matrix, dtype=np.float64).reshape(4, 4)
    spot = name == "SpotLight"
    position = matrix[:3, 3] if spot else np.array(parameters["position"], dtype=np.float64).reshape(3)
    axis = matrix[:3, 2] / np.linalg.norm(matrix[:3, 2]) if spot else np.array([0.0, 0.0, 1.0])
    # Mitsuba's own answer at a far point on the axis, where positions lose no digits that matter.
    distance = 1024.0 * max(1.0, float(np.abs(position).max()))
    interaction = dr.zeros(mi.Interaction3f)
    interaction.p = mi.Point3f(*(float(c) for c in position + distance * axis))
    _, arriving = emitter.sample_direction(interaction, mi.Point2f(0.5))
    intensity = _rgb(arriving) * distance**2
    if not spot:
        return TruthLight(position, intensity)
    cutoff = np.deg2rad(float(parameters["cutoff_angle"][0]))
    return TruthLight(position, intensity, axis, cutoff, min(np.deg2rad(float(parameters["beam_width"][0])), cutoff))


def _rgb(value) -> Array:
    flat = np.array(value, dtype=np.float64).reshape(-1)
    return np.repeat(flat, 3) if flat.size == 1 else flat
