# SPDX-License-Identifier: BSD-3-Clause
"""Points and spots, read from Mitsuba's emitters."""

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from airlight.errors import InputError
from airlight.reference.scene.colours import colour
from airlight.reference.scene.transforms import SAME, matrix_of, stretch

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ReferenceLight:
    """A point or spot light, or a point of an area light."""

    position: Array  #: [m]
    intensity: Array  #: radiant intensity on the axis [W/sr], RGB
    axis: Array | None = None  #: spot: unit vector; of a point of an area light the normal
    cutoff: float = np.pi  #: spot: half angle of the cone [rad]
    beam: float = np.pi  #: spot: half angle of full intensity [rad]
    cosine: bool = False  #: whether the intensity falls off as the cosine of the angle to the axis

    @property
    def is_soft(self) -> bool:
        """Whether the intensity falls off within the cone."""
        return self.cosine or (self.axis is not None and bool(self.beam < self.cutoff))


def read_point_light(emitter: "mi.Emitter") -> ReferenceLight:
    """Read a point or a spot; refuse any other light, and a spot whose cone is not one of Mitsuba's."""
    name = emitter.class_name()
    if name not in ("PointLight", "SpotLight"):
        word = {"ConstantBackgroundEmitter": "constant", "EnvironmentMapEmitter": "envmap"}.get(
            name, name
        )
        raise InputError(
            f"light '{emitter.id()}' of type '{word}' is the scene's only light; expected lights "
            "of type 'point', 'spot', 'directional', 'area' or 'constant'"
        )
    parameters = mi.traverse(emitter)
    matrix = matrix_of(emitter.world_transform())
    spot = name == "SpotLight"
    # With a texture its value on the axis would stand for all of the cone.
    if spot and "texture.value" not in parameters:
        raise InputError(
            f"light '{emitter.id()}' has a texture; expected one intensity: remove the texture"
        )
    if spot and stretch(matrix) - 1 > SAME:
        raise InputError(
            f"light '{emitter.id()}' has a to_world that stretches its cone, {stretch(matrix):.6g} "
            "to 1; expected one scale for all axes and no shear, which a 'rotate' brings whose "
            "axis is not of unit length: take the scale away, in a modelling program before the "
            "export"
        )
    # A spot stands at the origin of its frame and shines along its axis z; a point light has a
    # position of its own, and any axis will do.
    position = (
        matrix[:3, 3] if spot else np.array(parameters["position"], dtype=np.float64).reshape(3)
    )
    axis = matrix[:3, 2] / np.linalg.norm(matrix[:3, 2]) if spot else np.array([0.0, 0.0, 1.0])
    # Mitsuba's own answer at a far point on the axis, where positions lose no digits that matter.
    distance = 1024.0 * max(1.0, float(np.abs(position).max()))
    interaction = dr.zeros(mi.Interaction3f)
    interaction.p = mi.Point3f(*(position + distance * axis).tolist())
    dr.make_opaque(interaction)  # one kernel for all lights of a kind
    # Irradiance times the squared distance is the intensity.
    _, arriving = emitter.sample_direction(interaction, mi.Point2f(0.5))
    intensity = _as_given(
        emitter, colour(arriving, f"light '{emitter.id()}': its intensity") * distance**2
    )
    if not spot:
        return ReferenceLight(position, intensity)
    degrees = float(parameters["cutoff_angle"][0])
    # The interval of a cone on a ray (`reference.visibility.planes`) holds below a half space.
    if not 0 < degrees < 90:
        raise InputError(
            f"light '{emitter.id()}': its cutoff_angle is {degrees:g} degrees; expected more than "
            "0 and less than 90: a wider light is a 'point' light"
        )
    cutoff = np.deg2rad(degrees)
    return ReferenceLight(
        position,
        intensity,
        axis,
        cutoff,
        min(np.deg2rad(float(parameters["beam_width"][0])), cutoff),
    )


def _as_given(emitter: "mi.Emitter", measured: Array) -> Array:
    """Return the intensity that the scene gives, if it agrees with the measured one, which is
    rounded to float32.
    """
    parameters = mi.traverse(emitter)
    if "intensity.value" not in parameters:
        return measured
    texture = (
        np.array(parameters["texture.value"], dtype=np.float64)
        if "texture.value" in parameters
        else 1.0
    )
    given = np.array(parameters["intensity.value"], dtype=np.float64) * texture
    given = colour(given, f"light '{emitter.id()}': its intensity")
    return given if np.allclose(given, measured, rtol=1e-5, atol=0) else measured
