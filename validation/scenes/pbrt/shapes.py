# SPDX-License-Identifier: BSD-3-Clause
r"""The shapes of pbrt as shapes of Mitsuba, with their materials, lights and media.

**Normals.** The normal of pbrt is (p1 - p0) x (p2 - p0) of the corners in the world, or the outward
one of a sphere, turned where exactly one of `ReverseOrientation` and a transform that mirrors is
there; a triangle with normals at its vertices faces where they point. It decides which side emits,
and which medium of the interface is on which side. The corners here are in the order in which the
normal is (p1 - p0) x (p2 - p0) in our world: the flip from pbrt's world to ours turns the order
once more, so that it is turned where exactly one of `ReverseOrientation` and det(flip M) < 0 is
there. Spheres and disks that emit under a mirroring transform are refused: pbrt samples them on one
side, and takes their emission from the other.

**Media.** A surface that lets light pass is the bound of a medium. An opaque surface has no medium
of its own here, where camera and bounds say which medium is at a place. pbrt takes the names of a
surface for light that leaves it: where these are others than the medium at the place, its image
differs, which a note says.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import cast
from xml.sax.saxutils import quoteattr

import mitsuba as mi
import numpy as np

from airlight.realtime.scene.closed_mesh import winding_number
from airlight.reference.scene.transforms import SAME, stretch
from airlight.validation.arrays import Array
from airlight.validation.scenes.pbrt.directives import (
    Directive,
    array,
    check_names,
    colour,
    number,
    truth,
    word,
)
from airlight.validation.scenes.pbrt.lights import facing, rgb, to_world, words
from airlight.validation.scenes.pbrt.sides import is_closed, volume
from airlight.validation.scenes.pbrt.state import Part, State

_GREY = (0.5, 0.5, 0.5)  # the reflectance of a material that gives none, and of no material
_INTERFACES = ("none", "", "interface")
_FULL = 360.0


@dataclass(frozen=True, eq=False)
class Ball:
    """A sphere in our world."""

    centre: Array  #: [m], (3,)
    radius: float  #: [m]


@dataclass(frozen=True, eq=False)
class Solid:
    """A shape in our world, before it becomes XML."""

    name: str
    part: Part
    xml: str  #: type and place, with {} for what stands within
    #: triangles that face to the side of pbrt's normal, (n, 3, 3) [m], one of them for a disk, or
    #: a sphere; None: a cylinder
    body: Array | Ball | None
    outwards: bool  #: whether a closed body's normals point outwards
    opaque: bool
    visible: bool  #: whether a ray meets it
    origin: Array  #: of its frame, (3,) [m]

    @property
    def closed(self) -> bool:
        """Whether it has an inside."""
        return isinstance(self.body, Ball) or (self.body is not None and is_closed(self.body))

    def holds(self, place: Array) -> bool:
        """Return whether a closed shape holds a place, (3,) [m]."""
        if isinstance(self.body, Ball):
            return float(np.linalg.norm(place - self.body.centre)) < self.body.radius
        return self.body is not None and round(winding_number(self.body, place)) != 0

    @property
    def sample(self) -> Array:
        """A place on it, or of a cylinder in it, (3,) [m]."""
        if isinstance(self.body, Ball):
            return self.body.centre + np.array([0.0, 0.0, self.body.radius])
        return self.origin if self.body is None else np.asarray(self.body[0].mean(axis=0))

    @property
    def interior(self) -> str:
        """The medium inside of a bound."""
        return self.part.state.inside if self.outwards else self.part.state.outside

    @property
    def exterior(self) -> str:
        """The medium outside of a bound."""
        return self.part.state.outside if self.outwards else self.part.state.inside


def solid(part: Part, name: str, flip: Array, folder: Path, beside: Path) -> Solid | None:
    """Return a shape, None for one that does nothing.

    `flip`: from pbrt's world to ours, (4, 4); `folder`: for the files of meshes; `beside`: where
    the files are that pbrt names. Raises InputError by file, line and name.
    """
    directive, state = part.directive, part.state
    alpha = number(directive, "alpha", 1.0)
    if alpha not in (0.0, 1.0):
        raise directive.error(f"alpha is {alpha:g}; expected 1, or 0 for a light without a surface")
    opaque = not _is_interface(state)
    # Nothing meets a shape of alpha 0; a bound with one medium on both sides bounds nothing.
    idle = alpha == 0 if opaque else state.inside == state.outside or alpha == 0
    if state.area is not None and not opaque:
        raise directive.error("pbrt makes no light of a shape without a surface; give it a surface")
    if idle and state.area is None:
        return None
    matrix = flip @ state.ctm
    # The side of the normal under pbrt's own transform; the flip moves it like all else.
    turned = state.reverse ^ bool(np.linalg.det(state.ctm[:3, :3]) < 0)
    mirrored = bool(np.linalg.det(matrix[:3, :3]) < 0)
    body: Array | Ball | None
    if directive.type == "sphere":
        xml, body = _sphere(directive, matrix)
    elif directive.type == "disk":
        xml, body = _disk(directive, matrix, turned)
    elif directive.type == "cylinder":
        xml, body = _cylinder(directive, matrix), None
    elif directive.type in ("trianglemesh", "plymesh"):
        corners, normals = _mesh(directive, beside)
        corners = corners @ matrix[:3, :3].T + matrix[:3, 3]
        if normals is not None:
            sign = -1.0 if state.reverse else 1.0
            normals = sign * normals @ np.linalg.inv(matrix[:3, :3])
        # The order of the corners that gives pbrt's normal (see the module).
        if mirrored ^ state.reverse:
            corners = corners[:, ::-1]
            normals = None if normals is None else normals[:, ::-1]
        if normals is not None:
            corners, normals = _towards(corners, normals)
        xml, body = _ply(folder / f"{name}.ply", corners, normals), corners
    else:
        raise directive.error(
            "is not read; expected one of sphere, disk, cylinder, trianglemesh, plymesh"
        )
    is_mesh = body is not None and not isinstance(body, Ball) and directive.type != "disk"
    outwards = volume(cast(Array, body)) > 0 if is_mesh else not turned
    xml = xml.replace("@@", quoteattr(name))
    made = Solid(name, part, xml, body, outwards, opaque, alpha == 1, matrix[:3, 3])
    _check(made)
    return made


def material(state: State) -> str:
    """Return the material of an opaque shape, which reflects on both sides as in pbrt."""
    diffuse = f'<bsdf type="diffuse">{rgb("reflectance", reflectance(state))}</bsdf>'
    return f'<bsdf type="twosided">{diffuse}</bsdf>'


def written(made: Solid, media: Mapping[str, str]) -> str:
    """Return a shape as XML; `media` has the ids of media by their names in pbrt."""
    state = made.part.state
    if not made.opaque:
        sides = (("interior", made.interior), ("exterior", made.exterior))
        return made.xml.format(
            '<bsdf type="null"/>'
            + "".join(
                f"<ref name={quoteattr(side)} id={quoteattr(media[name])}/>"
                for side, name in sides
                if name
            )
        )
    inner = material(state) if made.visible else '<bsdf type="null"/>'
    if state.area is not None:
        inner += f'<emitter type="area">{rgb("radiance", radiance(state.area))}</emitter>'
    return made.xml.format(inner)


def radiance(area: Directive) -> Array:
    """Return the radiance of an area light, RGB."""
    white = (1.0, 1.0, 1.0)
    return colour(area, "L", white, light=True) * colour(area, "scale", white, light=True)


def _is_interface(state: State) -> bool:
    return state.material is not None and _kind(state.material) in _INTERFACES


def _kind(directive: Directive) -> str:
    """Return the kind of a material, which a named one has as a parameter."""
    return directive.type if directive.name == "Material" else word(directive, "type", "")


def reflectance(state: State) -> Array:
    """Return the diffuse reflectance of a state, RGB; other materials are refused by line."""
    directive = state.material
    if directive is None:
        return np.array(_GREY)
    keys = {"diffuse": "reflectance", "matte": "Kd"}
    key = keys.get(_kind(directive))
    if key is None:
        raise directive.error(
            f'the material "{_kind(directive)}" is not read; expected diffuse (matte in pbrt-v3), '
            "or interface for the bound of a medium"
        )
    check_names(directive, (key, "type", *(("sigma",) if key == "Kd" else ())))
    if number(directive, "sigma", 0.0) != 0:
        raise directive.error("sigma is not 0, a rough surface; expected a diffuse one: remove it")
    return colour(directive, key, _GREY)


def _check(made: Solid) -> None:
    """Refuse what a light or a bound of a medium cannot be, and materials that are not read."""
    directive, state = made.part.directive, made.part.state
    if made.opaque:
        reflectance(state)
    elif not made.closed:
        raise directive.error(
            "bounds a medium and is open, so that nothing says where the medium ends; expected a "
            "closed mesh or a sphere: close it, with the vertices of its edges in common"
        )
    area = state.area
    if area is None:
        return
    if area.type not in ("diffuse", "area"):  # the latter is pbrt-v3's other name
        raise area.error("is not read; expected diffuse")
    for key in ("filename", "power"):
        if key in area.parameters:
            raise area.error(f'"{key}" is not read; expected one colour: give the radiance as L')
    check_names(area, ("L", "scale", "twosided", "samples", "nsamples"))
    if directive.type == "cylinder":
        raise directive.error("a light on a cylinder is not read; expected a mesh")
    mirrored = np.linalg.det(state.ctm[:3, :3]) < 0
    if directive.type in ("sphere", "disk") and mirrored:
        raise directive.error(
            "it emits under a transform that mirrors, where pbrt itself takes both sides; expected "
            "one without a negative scale"
        )
    # The inner side of a closed surface is never seen from outside.
    if truth(area, "twosided") and not (made.visible and made.closed and made.outwards):
        raise area.error(
            f"twosided on the {directive.type} of line {directive.at.line}, whose back is seen; "
            "expected one side that emits: remove it, or write two shapes"
        )
    if isinstance(made.body, Ball) and not made.outwards:
        raise directive.error("emits inwards; expected no ReverseOrientation on a light")


def _sphere(directive: Directive, matrix: Array) -> tuple[str, Ball]:
    check_names(directive, ("radius", "zmin", "zmax", "phimax", "alpha"))
    radius = number(directive, "radius", 1.0)
    parts = number(directive, "zmin", -radius), number(directive, "zmax", radius)
    if parts[0] > -radius or parts[1] < radius:
        raise directive.error("it is a part of a sphere; expected a whole one")
    _whole(directive)
    if stretch(matrix) - 1 > SAME or not radius > 0:
        raise directive.error(
            "its transform has several scales, or its radius is not above 0; expected a round "
            "sphere: one scale for all axes"
        )
    radius *= float(np.linalg.norm(matrix[:3, 0]))
    centre = f'<point name="center" value="{words(matrix[:3, 3])}"/>'
    inner = f'{centre}<float name="radius" value="{radius!r}"/>'
    return _shape("sphere", inner), Ball(matrix[:3, 3], radius)


def _disk(directive: Directive, matrix: Array, turned: bool) -> tuple[str, Array]:
    check_names(directive, ("radius", "height", "innerradius", "phimax", "alpha"))
    if number(directive, "innerradius", 0.0) != 0:
        raise directive.error("it has a hole; expected a whole disk, or a mesh")
    _whole(directive)
    radius, height = number(directive, "radius", 1.0), number(directive, "height", 0.0)
    first, second = matrix[:3, :2].T
    length = float(np.linalg.norm(first))
    oval = abs(float(np.linalg.norm(second)) - length) > SAME * length
    if oval or abs(first @ second) > SAME * length**2 or not radius > 0:
        raise directive.error("it is oval or has no radius; expected a round disk, or a mesh")
    # The normal of the object is its z, moved by the inverse transposed: that is the third row.
    normal = np.linalg.inv(matrix[:3, :3])[2] * (-1.0 if turned else 1.0)
    place = (matrix @ [0.0, 0.0, height, 1.0])[:3]
    scale = np.diag([*3 * [length * radius], 1.0])
    placed = facing(place, normal) @ scale
    # A triangle in the disk says where it lies and which side is its front.
    corners = np.array([[1.0, 0, 0, 1], [-0.5, 0.8, 0, 1], [-0.5, -0.8, 0, 1]]) @ placed.T
    return _shape("disk", to_world(placed)), corners[None, :, :3]


def _cylinder(directive: Directive, matrix: Array) -> str:
    check_names(directive, ("radius", "zmin", "zmax", "phimax", "alpha"))
    _whole(directive)
    radius = number(directive, "radius", 1.0)
    ends = number(directive, "zmin", -1.0), number(directive, "zmax", 1.0)
    if stretch(matrix) - 1 > SAME or not radius > 0 or ends[0] >= ends[1]:
        raise directive.error(
            "its transform has several scales, or it has no size; expected one scale for all axes, "
            "a radius above 0, and zmin below zmax"
        )
    points = (
        f'<point name="{name}" value="{words([0.0, 0.0, end])}"/>'
        for name, end in zip(("p0", "p1"), ends)
    )
    inner = "".join(points) + f'<float name="radius" value="{radius!r}"/>' + to_world(matrix)
    return _shape("cylinder", inner)


def _whole(directive: Directive) -> None:
    if number(directive, "phimax", _FULL) < _FULL:
        raise directive.error("phimax is less than 360, a part of it; expected the whole shape")


def _shape(kind: str, inner: str) -> str:
    # The id follows when all names are given; {} is for materials, lights and media.
    return f'<shape type="{kind}" id=@@>{inner}{{}}</shape>'


def _mesh(directive: Directive, beside: Path) -> tuple[Array, Array | None]:
    """Return the triangles of a mesh in its object's frame and the normals at their corners,
    (n, 3, 3) each.
    """
    if directive.type == "plymesh":
        check_names(directive, ("filename", "alpha"))
        return _ply_triangles(directive, beside / word(directive, "filename", ""))
    check_names(directive, ("P", "indices", "N", "uv", "st", "S", "faceIndices", "alpha"))
    points = array(directive, "point3 point", "P", 3)
    if points is None:
        raise directive.error('it has no "point3 P"; expected its vertices')
    vertices = points.reshape(-1, 3)
    indices = array(directive, "integer", "indices", 3)
    if indices is None and len(vertices) != 3:
        raise directive.error('it has no "integer indices"; expected three for each triangle')
    faces = (np.arange(3.0) if indices is None else indices).astype(np.int64).reshape(-1, 3)
    if indices is not None and np.any(faces.ravel() != indices):
        raise directive.error("an index is no whole number; expected numbers of vertices")
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise directive.error(
            f"an index is {faces.min() if faces.min() < 0 else faces.max()}; expected numbers from "
            f"0 to {len(vertices) - 1}, of its vertices"
        )
    normals = array(directive, "normal normal3", "N", 3)
    if normals is None:
        return vertices[faces], None
    if len(normals) != len(points):
        raise directive.error("N has another number of values than P; expected one at each vertex")
    return vertices[faces], normals.reshape(-1, 3)[faces]


def _ply_triangles(directive: Directive, path: Path) -> tuple[Array, Array | None]:
    if not path.is_file():
        raise directive.error(
            f"there is no file {path}; expected a PLY mesh beside the scene: copy it, or correct "
            "the filename"
        )
    try:
        mesh = mi.load_dict({"type": "ply", "filename": str(path)})
    except RuntimeError as error:
        reason = " ".join(str(error).split()).rpartition("] ")[2]
        raise directive.error(f"Mitsuba cannot read {path}: {reason}") from error
    parameters = mi.traverse(mesh)
    faces = np.array(parameters["faces"], dtype=np.int64).reshape(-1, 3)
    vertices = np.array(parameters["vertex_positions"], dtype=np.float64).reshape(-1, 3)
    if not len(faces):
        raise directive.error(f"{path} has no triangles; expected a mesh")
    # Mitsuba makes up normals where the file has none: pbrt takes the triangles'.
    header = path.read_bytes().partition(b"end_header")[0].split()
    if b"nx" not in header:
        return vertices[faces], None
    normals = np.array(parameters["vertex_normals"], dtype=np.float64).reshape(-1, 3)
    return vertices[faces], normals[faces]


def _towards(corners: Array, normals: Array) -> tuple[Array, Array]:
    """Return triangles that face where the normals at their corners point."""
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    back = (np.einsum("ij,ij->i", across, normals.sum(axis=1)) < 0)[:, None, None]
    return np.where(back, corners[:, ::-1], corners), np.where(back, normals[:, ::-1], normals)


def _ply(path: Path, corners: Array, normals: Array | None) -> str:
    """Write triangles as a PLY file and return the shape that reads it.

    Corners with the same place and normal become one vertex, which keeps closed meshes closed.
    """
    rows = corners if normals is None else np.concatenate([corners, normals], axis=2)
    flat = (rows.reshape(-1, rows.shape[2]) + 0.0).astype("<f4")  # no zero with a sign
    vertices, numbers = np.unique(flat, axis=0, return_inverse=True)
    names = ("x", "y", "z", "nx", "ny", "nz")[: rows.shape[2]]
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(vertices)}\n"
    header += "".join(f"property float {name}\n" for name in names)
    header += f"element face {len(corners)}\nproperty list uchar int vertex_indices\nend_header\n"
    faces = np.zeros(len(corners), dtype=[("count", "u1"), ("corners", "<i4", 3)])
    faces["count"], faces["corners"] = 3, numbers.reshape(-1, 3)
    path.write_bytes(header.encode() + vertices.tobytes() + faces.tobytes())
    flat_shading = '<boolean name="face_normals" value="true"/>' if normals is None else ""
    inner = f'<string name="filename" value={quoteattr(str(path))}/>{flat_shading}'
    return _shape("ply", inner.replace("{", "{{").replace("}", "}}"))
