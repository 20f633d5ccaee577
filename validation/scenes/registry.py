# SPDX-License-Identifier: BSD-3-Clause
"""The built-in scenes: files such as `fog.toml` describe them, and a record of each
builds Mitsuba's dictionary.

Their numbers are arbitrary, never round, so that no constant of the code can hide behind a constant
of a scene. Those of `FOG_SCENES` scatter light once in homogeneous fog: the standard report and the
tests of all methods study these. Baselines have all scenes but clouds and many
lights.

Each scene is a table with these keys; lengths are in metres, angles in degrees, colours RGB:

* `purpose`: one sentence, what the scene is for; `published`: the published
  figure that it stands for;
* `animation`: what moves in it, see `Animation`; `clouds`: whether light is
  scattered many times in it;
* `fog`: the medium around all, with `sigma_t` (one number or RGB) [1/m], `albedo`, and `phase` in
  words of `analytic.phase.phase_from_words`; or with `layers`, which may be `clamped`; or with `smoke`, whose densities
  `sigma_t` multiplies;
* `camera`: `origin`, `target` and the horizontal `fov`;
* `lights`: each with `name`, `type`, `colour` (intensity, irradiance or radiance) and what
  `parts.light` takes; one with a `swarm` stands for many at random places of a box, with powers
  whose logarithm is normal with that `spread`;
* `shapes`: each with `name` and either `reflectance` or the `medium` that it bounds,
  which may have a `density`;
* `kinds`: meshes by name that its shapes use.

A shape, a part of one and a kind is a mesh. `mesh` names a kind or a function of `MESHES`, which
takes the further keys; or there are `parts`, which are joined. A mesh may be displaced by `waves`,
then multiplied by a `scale`, turned (`turn`: an axis and an angle) and moved to `at`, and from
there by `polar`: a distance and an angle about the vertical.

If a shape or part has `copies`, k times the numbers of `step` are added to those of copy k, and a
shape gets the name 'NAME-k', from `first` on; with `of` all of that list are copied together. With
`sunflower` the copies lie like its seeds, and take the kinds of that list in turn.
"""

import hashlib
import json
import math
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache, partial
from inspect import isfunction
from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from airlight.validation.arrays import Array
from airlight.validation.scenes import cloud_meshes, meshes
from airlight.validation.scenes.height_fog import register_height_fog
from airlight.validation.scenes.meshes import Mesh, bent, joined, placed, rotation, scaled
from airlight.validation.scenes.names import FILES
from airlight.validation.scenes.parts import (
    Plugin,
    camera,
    fog,
    height_fog,
    light,
    medium_boundary,
    mitsuba_mesh,
    phase_function,
)

MOVES = ("light", "objects", "medium", "colour")

#: A table of a scene's file, with the keys of the module: their values are numbers, words, lists
#: and tables, as the function of a key takes them.
Table = dict[str, Any]

_COPYING = ("copies", "first", "step", "of", "sunflower", "colours")
_PLACING = ("name", "mesh", "waves", "scale", "turn", "at", "polar", "reflectance", "medium")
MESHES: dict[str, Callable[..., Mesh]] = {
    **{
        name: each
        for module in (meshes, cloud_meshes)
        for name, each in vars(module).items()
        if isfunction(each)
    },
    "star": lambda inner, outer, points, height: meshes.prism(
        meshes.star(inner, outer, points), height
    ),
    "triangle": lambda corners: (np.array(corners), np.array([[0, 1, 2]])),
}


@dataclass(frozen=True)
class Animation:
    """The motion in the frames of a scene; see `validation.scenes.animation`."""

    moves: tuple[str, ...] = ("light",)  #: of `MOVES`
    #: on the axis that lights circle [m]; None: the scene's middle
    about: tuple[float, float, float] | None = None
    objects: tuple[str, ...] = ()  #: names of the shapes that turn; empty: all closed ones


@dataclass(frozen=True)
class SceneRecord:
    """A built-in scene."""

    name: str
    build: Callable[[], Plugin]  #: the dictionary of the scene; needs an active Mitsuba variant
    purpose: str  #: one sentence: what the scene is for
    published: str  #: the published figure that the scene stands for
    animation: Animation = field(default_factory=Animation)  #: what moves in it
    varying: bool = False  #: whether its fog is height fog or a grid, which have no one extinction
    #: whether light is scattered many times: its reference is `cloud-paths`, and few methods fit
    clouds: bool = False
    digest: str = ""  #: of its description
    many: bool = False  #: whether it has many lights, among which methods choose


def read_scenes(path: Path) -> dict[str, SceneRecord]:
    """Return the scenes of a file by name, in its order."""
    tables = tomllib.loads(path.read_text(encoding="utf-8"))
    return {name: _record(name, table) for name, table in tables.items()}


def _record(name: str, table: Table) -> SceneRecord:
    animation = Animation(
        **{key: tuple(value) for key, value in table.get("animation", {}).items()}
    )
    digest = hashlib.sha256(json.dumps(table).encode()).hexdigest()
    words = table["purpose"], table["published"]
    # Layers and smoke have no single extinction; neither belongs to `FOG_SCENES`.
    varying = bool({"layers", "smoke"} & set(table.get("fog", {})))
    many = any("swarm" in each for each in table["lights"])
    return SceneRecord(
        name,
        partial(_build, table),
        *words,
        animation,
        varying,
        table.get("clouds", False),
        digest,
        many,
    )


def _build(table: Table) -> Plugin:
    scene: Plugin = {"type": "scene"}
    # The medium comes first: the camera and boundaries refer to it by its id 'fog'.
    if "fog" in table:
        scene["fog"] = _medium(table["fog"])
    scene["sensor"] = camera(**table["camera"], size=(800, 600), in_fog="fog" in table)
    for each in _lights(table["lights"]):
        scene[each["name"]] = light(**{key: value for key, value in each.items() if key != "name"})
    kinds = table.get("kinds", {})
    for shape in copies(table.get("shapes", [])):
        name, mesh = shape["name"], mesh_of(shape, kinds)
        if "medium" in shape:
            scene[name] = medium_boundary(
                name, mesh, _medium(shape["medium"], shape.get("mesh", ""))
            )
        else:
            scene[name] = mitsuba_mesh(name, mesh, shape["reflectance"])
    return scene


def _lights(entries: Iterable[Table]) -> Iterator[Table]:
    """Yield lights one by one, the lights of a swarm with numbers in their names."""
    for entry in entries:
        if "swarm" not in entry:
            yield entry
            continue
        shared = dict(entry)
        swarm = shared.pop("swarm")
        # Seeded: the swarm is the same on every machine, as a file with every light written out
        # would be.
        rng = np.random.default_rng(swarm["seed"])
        places = rng.uniform(swarm["low"], swarm["high"], (swarm["count"], 3))
        colours = (
            np.exp(swarm["spread"] * rng.standard_normal((swarm["count"], 1))) * shared["colour"]
        )
        for number, (place, colour) in enumerate(
            zip(places.tolist(), colours.tolist(), strict=True)
        ):
            name = f"{shared['name']}-{number}"
            yield shared | {"name": name, "position": place, "colour": colour}


def copies(entries: Iterable[Table]) -> Iterator[Table]:
    """Yield shapes or parts one by one, copies written out."""
    for entry in entries:
        step = entry.get("step", {})
        for number in range(entry.get("copies", 1)):
            # With `of` all shapes of the list are copied together, and the table around them says
            # only how.
            for each in entry.get("of", [entry]):
                copy = {
                    key: _plus(value, step.get(key), number)
                    for key, value in each.items()
                    if key not in _COPYING
                }
                if "copies" in entry and "name" in each:
                    copy["name"] = f"{each['name']}-{number + entry.get('first', 0)}"
                yield copy | (_seed(entry, number) if "sunflower" in entry else {})


def _plus(value: Any, step: Any, times: int) -> Any:
    """Return a number or a list of numbers plus `times` a `step` of its shape; None for no step."""
    if step is None:
        return value
    if isinstance(value, list):
        return [_plus(number, added, times) for number, added in zip(value, step, strict=True)]
    return value + times * step


def _seed(entry: Table, number: int) -> Table:
    """Return place, kind, size, turn and colour of a seed of a sunflower, whose spiral is a
    little flat.
    """
    # Vogel's spiral: the golden angle of 137.50776 degrees, and radii in proportion to the square
    # root of the number.
    distance, angle = 0.419 * math.sqrt(number + 2.3), math.radians(137.50776 * number + 21.7)
    x, y, z = entry["at"]
    return {
        "mesh": entry["sunflower"][number % len(entry["sunflower"])],
        "scale": 0.87 + 0.31 * math.sin(2.7 * number),
        "turn": [0, 0, 1, 53.0 * number],
        "at": [x + distance * math.cos(angle), y + 0.87 * distance * math.sin(angle), z],
        "reflectance": entry["colours"][number % len(entry["colours"])],
    }


def mesh_of(entry: Table, kinds: Mapping[str, Table]) -> Mesh:
    """Return the mesh of a shape, a part or a kind at its place."""
    if "parts" in entry:
        mesh = joined([mesh_of(part, kinds) for part in copies(entry["parts"])])
    else:
        # Keys that place a mesh are used below; all other keys are arguments of the function that
        # makes it.
        name = entry["mesh"]
        arguments = {key: value for key, value in entry.items() if key not in _PLACING}
        kind = kinds.get(name)
        mesh = MESHES[name](**arguments) if kind is None else mesh_of(kind | arguments, {})
    # In this order: waves bend the mesh about its own origin, then come scale, turn and place.
    if "waves" in entry:
        mesh = bent(mesh[0], entry["waves"]), mesh[1]
    x, y, z = entry.get("at", (0.0, 0.0, 0.0))
    distance, angle = entry.get("polar", (0.0, 0.0))
    at = (
        x + distance * math.cos(math.radians(angle)),
        y + distance * math.sin(math.radians(angle)),
        z,
    )
    *axis, degrees = entry.get("turn", (0, 0, 1, 0))
    return placed(
        scaled(mesh, entry.get("scale", 1.0)),
        at,
        rotation(axis, degrees) if "turn" in entry else None,
    )


def _medium(table: Table, shape: str = "") -> Plugin:
    # 20001 values of a tabulated phase function: glory and fogbow are blurred by less than 0.1
    # degrees.
    phase = phase_function(table.get("phase", "isotropic"), 20001)
    if "layers" in table:
        register_height_fog()
        return height_fog(
            table["layers"],
            table["floor"],
            table["cap"],
            albedo=table["albedo"],
            phase=phase,
            clamped=table.get("clamped", False),
        )
    medium = fog(table["sigma_t"], table["albedo"], phase)
    if "smoke" in table:
        from airlight.validation.scenes.smoke import smoke

        arguments = dict(table["smoke"])
        low, high = np.array(arguments.pop("low")), np.array(arguments.pop("high"))
        density = smoke(low, high, **arguments)
    elif "density" in table:
        density, low, high = _density(shape, json.dumps(table["density"]))
    else:
        return medium
    # A grid volume of Mitsuba fills the unit cube: `to_world` takes the cube to the corners of the
    # voxels.
    box = mi.ScalarTransform4f().translate(low.tolist()).scale((high - low).tolist())
    grid = {"type": "gridvolume", "grid": mi.VolumeGrid(density[..., None]), "to_world": box}
    return medium | {"type": "heterogeneous", "sigma_t": grid}


@cache
def _density(mesh: str, arguments: str) -> tuple[NDArray[np.float32], Array, Array]:
    """Return the densities of a cloud in a mesh and the corners of their box, see `hypertexture`;
    its `arguments` are JSON.
    """
    from airlight.validation.scenes.hypertexture import hypertexture

    return hypertexture(MESHES[mesh](), **json.loads(arguments))


#: The built-in scenes by name; `FOG_SCENES` are the scenes of homogeneous fog with few lights.
SCENES = {name: record for path in FILES for name, record in read_scenes(path).items()}
FOG_SCENES = {
    name: record
    for name, record in SCENES.items()
    if not (record.clouds or record.varying or record.many)
}
