# SPDX-License-Identifier: BSD-3-Clause
"""The records of a scene that was drawn: plain numbers and words, lengths in metres.

All directions are unit vectors. `turn` is the axis of a rotation about the origin and its angle [degrees].
"""

from dataclasses import dataclass

Vector = tuple[float, float, float]
Colour = tuple[float, float, float]

AREA_KINDS = ("rectangle", "disk", "sphere")
#: Drawn scenes hold these kinds of lights.
LIGHT_KINDS = ("point", "spot", "directional", *AREA_KINDS)


@dataclass(frozen=True)
class DrawnCamera:
    """The camera."""

    origin: Vector  #: [m]
    target: Vector  #: a point that it looks at [m]
    fov: float  #: horizontal field of view [degrees]
    inside: str  #: 'endless', the name of a bounded medium, or 'clear air'
    in_shadow: bool  #: whether a plate is meant to keep the first light from it


@dataclass(frozen=True)
class DrawnMedium:
    """A medium, endless or within convex bounds."""

    name: str
    bounds: str  #: 'endless', 'sphere', 'box', 'gem' or 'ellipsoid'
    sigma_t: tuple[float, ...]  #: one extinction or three [1/m]
    albedo: Colour
    phase: str  #: words of the phase function, such as 'isotropic', 'hg:0.31' and 'hazy'
    optical_depth: float  #: of the way from the camera to behind the stage, or through the middle of the bounds
    centre: Vector = (0.0, 0.0, 0.0)  #: [m]
    half: Vector = (0.0, 0.0, 0.0)  #: half of its sizes along its own axes [m]
    turn: tuple[Vector, float] = ((0.0, 0.0, 1.0), 0.0)


@dataclass(frozen=True)
class DrawnLight:
    """A light."""

    name: str
    kind: str  #: of `LIGHT_KINDS`
    position: Vector  #: [m]; of a directional light a point on its way
    target: Vector  #: a point at which it shines [m]
    colour: Colour  #: intensity [W/sr], irradiance [W/m^2] or radiance [W/(m^2 sr)]
    brightness: float  #: of the airlight that it makes in the middle of the image without shadows, about [W/(m^2 sr)]
    size: tuple[float, ...] = ()  #: radius, or half of both sides [m]
    cutoff: float = 0.0  #: of a spot, half angle [degrees]
    beam: float = 0.0  #: of a spot, half angle of full intensity [degrees]
    black: bool = True  #: whether the shape of a light with extent is opaque


@dataclass(frozen=True)
class DrawnCaster:
    """A shape that casts shadows, within the unit ball before it is scaled."""

    name: str
    kind: str
    numbers: tuple[float, ...]  #: what its kind wants, see `casters.py`
    position: Vector  #: of the middle of the ball [m]
    radius: float  #: of the ball [m]
    turn: tuple[Vector, float]
    reflectance: Colour


@dataclass(frozen=True)
class DrawnScene:
    """A scene that was drawn."""

    seed: int
    attempt: int  #: how many draws before this one let too little light through
    scale: float  #: radius of the stage, the ball that the camera looks at [m]
    centre: Vector  #: of the stage [m]
    camera: DrawnCamera
    media: tuple[DrawnMedium, ...]  #: an endless one first
    lights: tuple[DrawnLight, ...]
    casters: tuple[DrawnCaster, ...]
