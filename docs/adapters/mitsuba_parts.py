# SPDX-License-Identifier: BSD-3-Clause
"""Numbers of Blender as parts of a Mitsuba scene, and the files that hold them; no adapter itself.

`to_mitsuba.py` reads a level by `bpy` and asks this file. Nothing here needs Blender or airlight:
Blender's Python has NumPy and no Mitsuba. The numbers are those of Cycles:

- A point or spot light of the power P has the intensity P/(4 pi), whatever its cone is.
- A sphere of the radius r has the radiance of that intensity over its disk, P/(4 pi^2 r^2).
- An area light of the area A has the radiance P/(pi A).
- The edge of a spot is a smooth step in the cosine of the angle: from cos c at its cone c to
  cos c + blend (1 - cos c). Mitsuba's is linear in the angle, so that a soft spot becomes several,
  whose edges add up to a function that is linear between the angles where they meet.
"""

import errno
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Index = NDArray[np.int64]

_PIECES = 10  # of the edge of a spot: they are within 0.6 % of the intensity, a test says
_SAME = 1e-4  # relative: lengths of axes and right angles of float32 matrices are equal up to this


class CannotError(Exception):
    """A part of a level that a scene cannot say; the words say why, and what to do."""


@dataclass(frozen=True)
class Medium:
    """A homogeneous medium."""

    sigma_s: Array  #: RGB [1/m]
    sigma_a: Array  #: RGB [1/m]
    phase: str = "hg"  #: or "rayleigh"
    g: float = 0.0

    def __add__(self, other: "Medium") -> "Medium":
        """Return what both are together; raise CannotError where they scatter by two functions."""
        first, second = (self, other) if self.sigma_s.any() else (other, self)
        if second.sigma_s.any() and (first.phase, first.g) != (second.phase, second.g):
            raise CannotError("volumes of several anisotropies meet in it; expected one")
        sums = self.sigma_s + other.sigma_s, self.sigma_a + other.sigma_a
        return replace(first, sigma_s=sums[0], sigma_a=sums[1])

    @property
    def sigma_t(self) -> Array:
        """The extinction, RGB [1/m]."""
        return self.sigma_s + self.sigma_a


@dataclass(frozen=True)
class Lamp:
    """A light of Blender. Its lengths are in metres, and its power belongs to metres too."""

    kind: str  #: "POINT", "SPOT", "SUN" or "AREA"
    matrix: Array  #: to the world, (4, 4); it shines along -z
    power: Array  #: colour times power, RGB [W]; of a sun the irradiance [W/m^2]
    radius: float = 0.0  #: of a point or spot light [m]
    soft_falloff: bool = False  #: of a light with a radius
    cone: float = 0.0  #: of a spot, the whole angle [rad]
    blend: float = 0.0  #: of a spot
    angle: float = 0.0  #: of a sun [rad]
    shape: str = "SQUARE"  #: of an area light, as Blender calls it
    size: tuple[float, float] = (1.0, 1.0)  #: of an area light, before its matrix
    spread: float = math.pi  #: of an area light [rad]


def fov_x(lens: float, sensor: tuple[float, float], fit: str, size: tuple[int, int]) -> float:
    """Return the horizontal field of view [degrees].

    Parameters
    ----------
    lens
        Focal length [mm].
    sensor
        Width and height of the sensor [mm].
    fit
        "AUTO", "HORIZONTAL" or "VERTICAL". The width counts but for the last of them.
    size
        Width and height of the image [pixels].
    """
    wide, high = size
    extent = sensor[1] if fit == "VERTICAL" else sensor[0]
    across = fit == "HORIZONTAL" or (fit == "AUTO" and wide >= high)
    return math.degrees(2 * math.atan(extent * (1 if across else wide / high) / (2 * lens)))


def coefficients(node: str, given: Mapping[str, Any]) -> tuple[Array, Array]:
    """Return sigma_s and sigma_a of a volume, RGB [1/m], by the name of its node and its inputs."""
    if node == "ShaderNodeVolumeCoefficients":
        return given["Scatter Coefficients"], given["Absorption Coefficients"]
    colour, density = given["Color"], max(given["Density"], 0.0)
    none: Array = np.zeros(3)
    if node == "ShaderNodeVolumeScatter":
        return colour * density, none
    if node == "ShaderNodeVolumeAbsorption":
        return none, (1 - colour) * density
    # A Principled Volume absorbs what it does not scatter, less for a bright Absorption Color.
    kept = np.maximum(1 - colour, 0) * np.maximum(1 - np.sqrt(given["Absorption Color"]), 0)
    return colour * density, kept * density


def spot_edge(cone: float, blend: float) -> tuple[Array, Array]:
    """Return angles from the axis between which a soft spot falls off linearly, (n + 1,)
    [degrees], and how far it falls in each of these pieces, (n,), 1 in all.

    Parameters
    ----------
    cone
        The half angle of the cone [rad].
    blend
        Above 0, at most 1.
    """
    end = math.cos(cone)
    start = end + blend * (1 - end)
    angle = np.linspace(math.acos(min(start, 1.0)), cone, 4097)  # the error to four digits
    t = (np.cos(angle) - end) / (start - end)
    falloff = t * t * (3 - 2 * t)
    # The error of a line in a step h is f'' h^2 / 8: equal parts of the integral of |f''|^(1/2).
    bend = np.sqrt(np.abs(np.gradient(np.gradient(falloff, angle), angle)))
    steps = np.concatenate([[0.0], np.cumsum(0.5 * (bend[1:] + bend[:-1]))])
    angles = np.interp(np.linspace(0, steps[-1], _PIECES + 1), steps, angle)
    values = np.interp(angles, angle, falloff)
    values[[0, -1]] = 1.0, 0.0
    return np.degrees(angles), values[:-1] - values[1:]


def lamp_xml(name: str, lamp: Lamp, *, sharp: bool = False) -> list[str]:
    """Return the emitters of a light; a sharp one has neither a radius nor an angle."""
    if lamp.kind == "AREA":
        return [_area(name, lamp)]
    if lamp.kind == "SUN":
        if lamp.angle > 0 and not sharp:
            raise CannotError("its Angle is not 0; expected 0, or --sharp for all lights")
        way = tag("vector", name="direction", value=words(_axis(lamp)))
        return [_emitter("directional", name, rgb("irradiance", lamp.power), way)]
    intensity, radius = lamp.power / (4 * math.pi), 0.0 if sharp else lamp.radius
    place = words(lamp.matrix[:3, 3])
    if lamp.kind == "POINT" and radius == 0:
        position = tag("point", name="position", value=place)
        return [_emitter("point", name, rgb("intensity", intensity), position)]
    if lamp.kind == "POINT":
        if lamp.soft_falloff:
            raise CannotError("it has a Soft Falloff; expected it off, or --sharp for all lights")
        centre = tag("point", name="center", value=place)
        size = tag("float", name="radius", value=word(radius))
        return [_shining("sphere", name, intensity / (math.pi * radius**2), centre, size)]
    # A spot, in pieces if its edge is soft.
    if radius > 0:
        raise CannotError(
            "it is a spot with a radius; expected Radius 0, or --sharp for all lights"
        )
    if np.ptp(lengths := np.linalg.norm(lamp.matrix[:3, :3], axis=0)) > _SAME * lengths.max():
        raise CannotError("its scales differ, which stretches its cone; expected one scale")
    cutoff = math.degrees(lamp.cone) / 2
    if cutoff >= 90:
        raise CannotError("its Spot Size is 180 degrees; expected less")
    turned = _facing(lamp)
    if lamp.blend == 0:
        return [_spot(name, turned, intensity, cutoff, cutoff)]
    angles, falls = spot_edge(lamp.cone / 2, lamp.blend)
    return [
        _spot(f"{name}-edge-{number}", turned, fall * intensity, beam, end)
        for number, (fall, beam, end) in enumerate(zip(falls, angles, angles[1:]), 1)
    ]


def _axis(lamp: Lamp) -> Array:
    """Return the unit vector along which a light shines."""
    axis: Array = -lamp.matrix[:3, 2]
    length = np.linalg.norm(axis)
    if length == 0:
        raise CannotError("its scale along z is 0; expected another")
    return axis / length


def _facing(lamp: Lamp) -> Array:
    """Return a rotation and translation whose z is the axis of a light."""
    axis = _axis(lamp)
    across = np.cross(np.eye(3)[np.argmin(np.abs(axis))], axis)
    across /= np.linalg.norm(across)
    turned = np.eye(4)
    turned[:3] = np.column_stack([across, np.cross(axis, across), axis, lamp.matrix[:3, 3]])
    return turned


def _area(name: str, lamp: Lamp) -> str:
    if lamp.spread < math.pi * (1 - _SAME):
        raise CannotError("its Spread is below 180 degrees; expected 180")
    # Half its sides are along x and y; it shines along -z.
    sides = lamp.matrix[:3, :2] * (np.array(lamp.size) / 2)
    half = np.linalg.norm(sides, axis=0)
    if not half.all():
        raise CannotError("it has no area; expected sizes and scales above 0")
    across, up = (sides / half).T
    if abs(across @ up) > _SAME:
        raise CannotError("it is sheared; expected sides at right angles")
    axis = np.cross(across, up) * np.sign(np.cross(across, up) @ _axis(lamp))
    round_ = lamp.shape in ("DISK", "ELLIPSE")
    if round_ and np.ptp(half) > _SAME * half.max():
        raise CannotError("it is an ellipse; expected a disk: one size and one scale")
    matrix = np.eye(4)
    columns = [across * half[0], np.cross(axis, across) * half[1], axis, lamp.matrix[:3, 3]]
    matrix[:3] = np.column_stack(columns)
    # The power belongs to the whole area, of a disk pi/4 of its square.
    area = (math.pi if round_ else 4) * half.prod()
    kind = "disk" if round_ else "rectangle"
    return _shining(kind, name, lamp.power / (math.pi * area), to_world(matrix))


def _spot(name: str, matrix: Array, intensity: Array, beam: float, cutoff: float) -> str:
    angles = [("cutoff_angle", cutoff), ("beam_width", beam)]
    numbers = [tag("float", name=key, value=word(value)) for key, value in angles]
    return _emitter("spot", name, rgb("intensity", intensity), *numbers, to_world(matrix))


def _emitter(kind: str, name: str, *inside: str) -> str:
    return tag("emitter", *inside, type=kind, id=name)


def _shining(kind: str, name: str, radiance: Array, *place: str) -> str:
    """Return a shape that is nothing but its light: it casts no shadow."""
    emitter = tag("emitter", rgb("radiance", radiance), type="area")
    return tag("shape", *place, tag("bsdf", type="null"), emitter, type=kind, id=name)


def medium_xml(name: str, medium: Medium) -> str:
    """Return a medium; its albedo is 0 where nothing is extinguished."""
    extinction = medium.sigma_t
    albedo = medium.sigma_s / np.where(extinction > 0, extinction, 1.0)
    phase = tag("phase", type="isotropic" if medium.phase == "hg" else medium.phase)
    if medium.phase == "hg" and medium.g != 0:
        phase = tag("phase", tag("float", name="g", value=word(medium.g)), type="hg")
    inside = [rgb("sigma_t", extinction), rgb("albedo", albedo), phase]
    return tag("medium", *inside, type="homogeneous", id=name)


def camera_xml(
    name: str, matrix: Array, fov: float, size: tuple[int, int], medium: str | None
) -> str:
    """Return a sensor; `matrix` is that of Blender, whose cameras look along -z with y up."""
    axes = matrix[:3, :3] / np.linalg.norm(matrix[:3, :3], axis=0)
    if np.abs(axes.T @ axes - np.eye(3)).max() > _SAME or np.linalg.det(axes) < 0:
        raise CannotError("it is sheared or mirrored; expected a rotation and a place")
    # Mitsuba's cameras look along z, with x to the left.
    turned = np.eye(4)
    turned[:3] = np.column_stack([-axes[:, 0], axes[:, 1], -axes[:, 2], matrix[:3, 3]])
    pixels = zip(("width", "height"), size)
    film = [tag("integer", name=key, value=str(value)) for key, value in pixels]
    return tag(
        "sensor",
        tag("float", name="fov", value=word(fov)),
        tag("string", name="fov_axis", value="x"),
        to_world(turned),
        *([] if medium is None else [tag("ref", name="medium", id=medium)]),
        tag("film", *film, tag("rfilter", type="box"), type="hdrfilm"),
        type="perspective",
        id=name,
    )


def surface_xml(reflectance: Array, *, two_sided: bool) -> str:
    """Return a diffuse material, black from behind if it has one side."""
    diffuse = tag("bsdf", rgb("reflectance", reflectance), type="diffuse")
    return tag("bsdf", diffuse, type="twosided") if two_sided else diffuse


def is_inside(vertices: Array, faces: Index, point: Array) -> bool:
    """Return whether a point is in a closed mesh: whether its triangles fill the directions from
    the point (van Oosterom and Strackee 1983: the solid angle of a triangle).
    """
    corners = vertices[faces] - point
    lengths = np.linalg.norm(corners, axis=2)
    a, b, c = corners.transpose(1, 0, 2)
    volume = np.sum(a * np.cross(b, c), axis=1)
    dots = [np.sum(x * y, axis=1) for x, y in ((a, b), (b, c), (c, a))]
    below = lengths.prod(axis=1) + dots[0] * lengths[:, 2]
    below += dots[1] * lengths[:, 0] + dots[2] * lengths[:, 1]
    return bool(abs(np.sum(2 * np.arctan2(volume, below))) > 2 * math.pi)


def ply_bytes(vertices: ArrayLike, faces: Index, normals: ArrayLike | None = None) -> bytes:
    """Return a mesh as a binary PLY file in float32, with normals at the vertices if there are."""
    columns = np.asarray(vertices, dtype=np.float64)
    columns = columns if normals is None else np.column_stack([columns, np.asarray(normals)])
    names = ["x", "y", "z", "nx", "ny", "nz"][: columns.shape[1]]
    head = ["ply", "format binary_little_endian 1.0", f"element vertex {len(columns)}"]
    head += [f"property float {name}" for name in names]
    head += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header\n"]
    # Each face is a byte, which says three, and three numbers of vertices.
    rows = np.zeros(len(faces), dtype=[("count", "u1"), ("corners", "<i4", (3,))])
    rows["count"], rows["corners"] = 3, faces
    return "\n".join(head).encode() + columns.astype("<f4").tobytes() + rows.tobytes()


def word(value: float) -> str:
    """Return the shortest decimal word of a number's float32 value, which Mitsuba holds."""
    return repr(float(np.format_float_scientific(np.float32(value))) + 0.0)


def words(values: ArrayLike) -> str:
    """Return numbers for an attribute."""
    return " ".join(word(float(each)) for each in np.asarray(values, dtype=np.float64).ravel())


def rgb(name: str, values: ArrayLike) -> str:
    """Return a colour."""
    return tag("rgb", name=name, value=words(values))


def to_world(matrix: Array) -> str:
    """Return a transform, (4, 4)."""
    return tag("transform", tag("matrix", value=words(matrix)), name="to_world")


def tag(name: str, /, *inside: str, **given: str) -> str:
    """Return an element of XML with others inside of it, indented."""
    head = name + "".join(f" {key}={quoteattr(value)}" for key, value in given.items())
    if not inside:
        return f"<{head}/>"
    body = "\n".join(inside).replace("\n", "\n    ")
    return f"<{head}>\n    {body}\n</{name}>"


def write_files(files: Sequence[tuple[Path, bytes]]) -> None:
    """Write all files, in this order, or none: each under another name, then all get theirs.

    Raises OSError.
    """
    drafts = [(path.with_name(f".{path.name}.{os.getpid()}"), path) for path, _ in files]
    for _, path in drafts:
        if path.is_dir():
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    try:
        for (draft, _), (_, content) in zip(drafts, files):
            draft.write_bytes(content)
        for draft, path in drafts:
            draft.replace(path)
    finally:
        for draft, _ in drafts:
            draft.unlink(missing_ok=True)
