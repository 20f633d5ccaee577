# SPDX-License-Identifier: BSD-3-Clause
"""The graphics state of pbrt, and the parts of a scene with the state where they stand.

`AttributeBegin` keeps the whole state; `TransformBegin` keeps the transform in pbrt-v3, and the
whole state in pbrt-v4. `WorldBegin` resets the transform and nothing else: media that were set
before it stay. pbrt-v4 gives the camera the medium outside of the interface at `Camera`, pbrt-v3
that at the end of the world. A file is of pbrt-v3 if it has `WorldEnd` or the film `image`, which
pbrt-v4 has not.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import numpy as np

from airlight.errors import InputError
from airlight.validation.arrays import Array
from airlight.validation.scenes.pbrt.directives import Directive
from airlight.validation.scenes.pbrt.transforms import is_transform, transformed

_IGNORED = ("Sampler", "Integrator", "Accelerator", "Texture")
_REFUSED = {
    "ObjectBegin": "instances are not read; expected shapes: write them out",
    "ObjectInstance": "instances are not read; expected shapes: write them out",
    "ObjectEnd": "instances are not read; expected shapes: write them out",
    "Attribute": "it gives defaults to what follows, which is not read; expected each parameter "
    "where it is used",
    "TransformTimes": "motion is not read; expected one instant",
}


@dataclass(frozen=True, eq=False)
class State:
    """All that a shape or a light takes from the lines before it."""

    ctm: Array = field(default_factory=lambda: np.eye(4))  #: from the object to the world, (4, 4)
    reverse: bool = False  #: whether normals are turned
    material: Directive | None = None
    area: Directive | None = None  #: the area light that shapes become
    inside: str = ""  #: the medium on the side that normals point away from
    outside: str = ""


@dataclass(frozen=True, eq=False)
class Part:
    """A camera, a light or a shape where it stands."""

    directive: Directive
    state: State


@dataclass(frozen=True, eq=False)
class PbrtScene:
    """A pbrt file in parts."""

    camera: Part
    film: Directive | None
    filter: Directive | None
    media: dict[str, Directive]
    lights: tuple[Part, ...]
    shapes: tuple[Part, ...]
    version: int  #: 3 or 4


class _World:
    """The state while the directives of a file go by."""

    def __init__(self, *, old: bool) -> None:
        self.old = old  # whether the file is of pbrt-v3
        self.state = State()
        self.kept = list[tuple[Directive, State]]()  # by AttributeBegin and TransformBegin
        self.systems = dict[str, Array]()
        self.materials = dict[str, Directive]()
        self.media = dict[str, Directive]()
        self.single = dict[str, Part]()  # camera, film, filter
        self.lights, self.shapes = list[Part](), list[Part]()
        self.begun = self.ended = False

    def run(self, directive: Directive) -> None:
        """Let a directive change the state, or add a part to the scene."""
        name, state = directive.name, self.state
        if name in _REFUSED:
            raise directive.error(_REFUSED[name])
        if self.ended:
            raise directive.error("stands after WorldEnd; expected one scene in a file")
        if is_transform(directive):
            self.state = replace(state, ctm=transformed(state.ctm, directive))
        elif name in ("AttributeBegin", "TransformBegin"):
            self.kept.append((directive, state))
        elif name in ("AttributeEnd", "TransformEnd"):
            self._end(directive)
        elif name in ("Camera", "Film", "PixelFilter"):
            self._option(directive)
        elif name in ("Shape", "LightSource"):
            if not self.begun:
                raise directive.error("stands before WorldBegin; expected it after")
            (self.shapes if name == "Shape" else self.lights).append(Part(directive, state))
        elif name == "WorldBegin":
            self.begun = True
            self.systems["world"] = np.eye(4)
            self.state = replace(state, ctm=np.eye(4))
        elif name == "WorldEnd":
            self.ended = True
        elif name not in _IGNORED:
            self._attribute(directive)

    def _end(self, directive: Directive) -> None:
        """Return to the state of the last AttributeBegin or TransformBegin (see the module)."""
        begin = directive.name.replace("End", "Begin")
        if not self.kept or self.kept[-1][0].name != begin:
            raise directive.error(f"there is no {begin} that it ends; remove it, or add one")
        kept = self.kept.pop()[1]
        whole = directive.name == "AttributeEnd" or not self.old
        self.state = kept if whole else replace(self.state, ctm=kept.ctm)

    def _option(self, directive: Directive) -> None:
        if self.begun:
            raise directive.error("stands after WorldBegin; expected it before")
        if directive.name in self.single:
            raise directive.error("is given twice; leave one out")
        self.single[directive.name] = Part(directive, self.state)
        if directive.name == "Camera":
            if abs(np.linalg.det(self.state.ctm)) == 0:
                raise directive.error("its transform has no inverse; expected one that has")
            self.systems["camera"] = np.asarray(np.linalg.inv(self.state.ctm))

    def _attribute(self, directive: Directive) -> None:
        """Let a directive that is no transform change the state."""
        state, first = self.state, directive.type
        match directive.name:
            case "ReverseOrientation":
                self.state = replace(state, reverse=not state.reverse)
            case "MediumInterface":
                self.state = replace(state, inside=first, outside=directive.strings[-1])
            case "Material":
                self.state = replace(state, material=directive)
            case "NamedMaterial":
                if first not in self.materials:
                    raise directive.error("there is no such material before it; make it first")
                self.state = replace(state, material=self.materials[first])
            case "MakeNamedMaterial":
                self.materials[first] = directive
            case "MakeNamedMedium":
                if first in self.media:
                    raise directive.error("is made twice; leave one out, or rename it")
                self.media[first] = directive
            case "AreaLightSource":
                self.state = replace(state, area=directive)
            case "CoordinateSystem":
                self.systems[first] = state.ctm
            case "CoordSysTransform":
                if first not in self.systems:
                    raise directive.error("there is no such coordinate system before it")
                self.state = replace(state, ctm=self.systems[first])
            case "ColorSpace" if first != "srgb":
                raise directive.error("expected srgb: turn the colours of the file into it")
            case "ActiveTransform" if first != "All":
                raise directive.error("motion is not read; expected one instant")
            case "Option" if "forcediffuse" in directive.parameters:
                raise directive.error("forcediffuse changes materials; remove it")


def read_parts(source: Iterable[Directive], name: str) -> PbrtScene:
    """Return the parts of a scene; messages call the file by `name`.

    Raises InputError, by file and line, for what is not read, and for blocks that have no end.
    """
    lines = list(source)
    old = any(
        each.name == "WorldEnd" or (each.name == "Film" and each.type == "image") for each in lines
    )
    world = _World(old=old)
    for directive in lines:
        world.run(directive)
    if world.kept:
        raise world.kept[-1][0].error("has no end; add one")
    if not world.begun or "Camera" not in world.single:
        missing = "Camera" if world.begun else "WorldBegin"
        raise InputError(f"scene {name}: the file has no {missing}; expected a whole scene of pbrt")
    camera, film = world.single["Camera"], world.single.get("Film")
    # pbrt-v3 makes the camera at the end of the world, with the media that are in force there.
    if old:
        camera = replace(camera, state=replace(camera.state, outside=world.state.outside))
    given = world.single.get("PixelFilter")
    return PbrtScene(
        camera=camera,
        film=film.directive if film else None,
        filter=given.directive if given else None,
        media=world.media,
        lights=tuple(world.lights),
        shapes=tuple(world.shapes),
        version=3 if old else 4,
    )
