# SPDX-License-Identifier: BSD-3-Clause
"""Changes of a scene by name: its camera, lights and media, as `--change NAME=VALUE` and
the live view make them.

A change goes into Mitsuba's own scene, so the methods and the reference read the same. The names:

| name | value |
| --- | --- |
| `camera.origin`, `camera.target` | a point [m]: where the camera is, where it looks |
| `camera.up` | a direction: up in the image |
| `camera.fov` | horizontal field of view [degrees] |
| `light.position` | of a point or spot light, a point [m] |
| `light.direction` | in which a spot or directional light shines |
| `light.intensity`, `light.irradiance`, `light.radiance` | of a point or spot, a directional, an area light: RGB |
| `medium.sigma_t` | extinction [1/m]: one number, or RGB where the scene gives RGB |
| `medium.sigma_1`, `medium.z_1`, `medium.H_1`, ... | of height fog, a number of its file: 1/m before `scale`, or m |
| `medium.albedo` | single-scattering albedo: RGB |
| `medium.g` | mean cosine of an isotropic or a Henyey-Greenstein phase function |

One number for an RGB value is grey. The second light is `light-2`, the third `light-3`, a sky comes
last. Media are named so too: first the one around the camera, then those with bounds in the order
of their shapes.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import ArrayLike

from airlight.errors import InputError, nearest
from airlight.reference.scene.transforms import matrix_of
from airlight.reference.storage.scene_digest import description_digest, give_description
from airlight.validation.arrays import Array
from airlight.validation.readers import named_values
from airlight.validation.scenes.height_fog import NUMBERS
from airlight.validation.scenes.numbers import LARGEST_LENGTH, LARGEST_LIGHT
from airlight.validation.scenes.parts import Plugin

Values = tuple[float, ...]
Changes = Mapping[str, Sequence[float]]
UNCHANGED: Changes = MappingProxyType({})
_LIGHTS = {"intensity": "W/sr", "irradiance": "W/m^2", "radiance": "W/(m^2 sr)"}


@dataclass(frozen=True)
class Changeable:
    """A number, point, direction or colour of a scene that has a name."""

    name: str
    value: Values  #: as the scene has it
    sizes: tuple[int, ...]  #: how many numbers a value may have
    least: float
    most: float
    unit: str = ""
    direction: bool = False  #: only its direction matters: not all of it may be 0


def changeable(scene: mi.Scene) -> dict[str, Changeable]:
    """Return the changeable parameters of a scene, by name, with their values."""
    # A scene without a camera has lights and media to change all the same.
    parameters = list(_of_camera(scene.sensors()[0])) if scene.sensors() else []
    for number, emitter in enumerate(_lights(scene), 1):
        parameters += _of_light(_numbered("light", number), emitter)
    for number, medium in enumerate(_media(scene), 1):
        parameters += _of_medium(_numbered("medium", number), medium)
    return {each.name: each for each in parameters}


def parse_changes(words: Sequence[str]) -> dict[str, Values]:
    """Return values by name from words of the form 'NAME=VALUE' or 'NAME=X,Y,Z'."""
    wanted = "NAME=NUMBER or NAME=X,Y,Z, for example medium.sigma_t=0.1"
    return named_values(
        "--change", words, lambda text: tuple(float(number) for number in text.split(",")), wanted
    )


def change_words(changes: Mapping[str, Sequence[float]]) -> list[str]:
    """Return the words that `parse_changes` reads, to the last digit."""
    return [
        f"{name}={','.join(_word(value) for value in values)}" for name, values in changes.items()
    ]


def checked_changes(scene: mi.Scene, changes: Mapping[str, Sequence[float]]) -> dict[str, Values]:
    """Return the changes of a scene as tuples.

    Raises InputError for a name that the scene does not have, and a value that it cannot have.
    """
    parameters = changeable(scene)
    return {name: _checked(name, values, parameters) for name, values in changes.items()}


def change_scene(scene: mi.Scene, changes: Mapping[str, Sequence[float]]) -> None:
    """Change a scene in place: values by name, see the module.

    Raises InputError for a name that the scene does not have, and a value that it cannot have: then
    nothing is changed.
    """
    # All values are checked before any is set. A part may refuse some values together, such as
    # numbers of height fog without a bound, only when they are set: all parts then get their old
    # values.
    checked = checked_changes(scene, changes)
    changed = []
    for kind, parts, change in (
        ("camera", scene.sensors()[:1], _change_camera),
        ("light", _lights(scene), _change_light),
        ("medium", _media(scene), _change_medium),
    ):
        for number, part in enumerate(parts, 1):
            prefix = _numbered(kind, number) + "."
            of_part = {
                name.removeprefix(prefix): values
                for name, values in checked.items()
                if name.startswith(prefix)
            }
            changed += [(part, change, of_part)] if of_part else []
    before = [(part, _parameters(part)) for part, _, _ in changed]
    try:
        # The changes of one part are made together, since its plugin is updated once.
        for part, change, of_part in changed:
            change(part, of_part)
    except InputError:
        for part, values in before:
            parameters = mi.traverse(part)
            for name, value in values.items():
                parameters[name] = value
            parameters.update()
        raise


def _parameters(part: mi.Object) -> dict[str, Any]:
    """Return copies of the parameters of a plugin, which Mitsuba may change in place."""
    return {name: type(value)(value) for name, value in mi.traverse(part)}


def move_shapes(scene: mi.Scene, matrices: Mapping[str, Sequence[Sequence[float]]]) -> None:
    """Move shapes of a scene in place from where they are; `matrices`: (4, 4) [m], by the ids
    of the shapes.

    Raises InputError for a shape that the scene does not have, or that Mitsuba cannot move.
    """
    if not matrices:
        return
    parameters = mi.traverse(scene)
    shapes = [shape.id() for shape in scene.shapes()]
    for name, rows in matrices.items():
        if name not in shapes:
            advice = (
                f"expected some of {', '.join(shapes)}{nearest(name, shapes)}"
                if shapes
                else "the scene has no shapes"
            )
            raise InputError(f"objects: got {name!r}, {advice}")
        # A mesh has its vertices in world coordinates and no transform that could be set; the
        # vertices themselves are moved. Rectangle, disk and sphere have `to_world`.
        matrix = np.array(rows, dtype=np.float64)
        place, vertices, normals = (
            f"{name}.{each}" for each in ("to_world", "vertex_positions", "vertex_normals")
        )
        if vertices in parameters:
            points = np.reshape(parameters[vertices], (-1, 3)) @ matrix[:3, :3].T + matrix[:3, 3]
            parameters[vertices] = type(parameters[vertices])(points.ravel())
            if normals in parameters and len(parameters[normals]):
                # Unit length for any scale: the matrix is a rotation times a number.
                turned = (
                    np.reshape(parameters[normals], (-1, 3))
                    @ matrix[:3, :3].T
                    / np.cbrt(np.linalg.det(matrix))
                )
                parameters[normals] = type(parameters[normals])(turned.ravel())
        elif place in parameters:
            moved = matrix @ matrix_of(parameters[place])
            parameters[place] = type(parameters[place])(moved)
        else:
            raise InputError(
                f"objects: shape '{name}' cannot be moved; expected a mesh, rectangle, disk or "
                "sphere"
            )
    parameters.update()


def shift_film(scene: mi.Scene, right: float, down: float) -> None:
    """Let the camera's rays pass right of and below the centres of pixels [pixels], in place."""
    parameters = mi.traverse(scene.sensors()[0])
    for axis, size, shift in zip("xy", parameters["film.size"], (right, down), strict=True):
        parameters[f"principal_point_offset_{axis}"] = shift / int(size)
    parameters.update()


def _numbered(kind: str, number: int) -> str:
    return kind if number == 1 else f"{kind}-{number}"


def _word(value: float) -> str:
    """Return the shortest decimals that are read as this number: in single precision where it is
    a number of single precision, else in double.
    """
    # The shortest decimals of float32 are enough where the value came from float32; otherwise more
    # digits are needed to read the same double again.
    single = np.float32(value)
    return np.format_float_positional(
        single if float(single) == value else np.float64(value), trim="-"
    )


def _checked(name: str, values: Sequence[float], parameters: Mapping[str, Changeable]) -> Values:
    if name not in parameters:
        raise InputError(
            f"--change: got {name!r}, expected one of {', '.join(parameters)}"
            f"{nearest(name, parameters)}"
        )
    # The numbers of a value: how many, within which limits, and not all 0 for a direction.
    parameter = parameters[name]
    if len(values) not in parameter.sizes:
        sizes = " or ".join(str(size) for size in parameter.sizes)
        raise InputError(
            f"{name}: got {len(values)} numbers, expected {sizes}, with commas between them and a "
            "point "
            "in each, such as 0.5"
        )
    # The comparison is written so that NaN fails it.
    numbers = np.array(values, dtype=np.float64)
    if not np.all((numbers >= parameter.least) & (numbers <= parameter.most)):
        given = ",".join(f"{value:g}" for value in values)
        unit = f" [{parameter.unit}]" if parameter.unit else ""
        raise InputError(
            f"{name}: got {given}, expected finite numbers from {parameter.least:g} to "
            f"{parameter.most:g}{unit}"
        )
    if parameter.direction and not np.any(numbers):
        raise InputError(
            f"{name}: got {','.join('0' for _ in values)}, expected a direction: not all of it 0"
        )
    return tuple(float(value) for value in values)


def _point(name: str, value: Array, *, direction: bool = False) -> Changeable:
    return Changeable(
        name,
        _values(value),
        (3,),
        -LARGEST_LENGTH,
        LARGEST_LENGTH,
        "" if direction else "m",
        direction,
    )


def _values(value: ArrayLike) -> Values:
    return tuple(float(number) for number in np.array(value, dtype=np.float64).ravel())


# The camera ---------------------------------------------------------------------------------------

_AIM = ("origin", "target", "up")


def _of_camera(sensor: mi.Sensor) -> Iterable[Changeable]:
    parameters = mi.traverse(sensor)
    if "x_fov" not in parameters:
        return
    # The columns of the camera's transform are left, up, forward and origin. A target at a distance
    # of one metre stands for the direction.
    matrix = matrix_of(sensor.world_transform())
    yield _point("camera.origin", matrix[:3, 3])
    yield _point("camera.target", matrix[:3, 3] + matrix[:3, 2])
    yield _point("camera.up", matrix[:3, 1], direction=True)
    yield Changeable("camera.fov", _values(parameters["x_fov"]), (1,), 0.1, 179.0, "degrees")


def _change_camera(sensor: mi.Sensor, changed: Mapping[str, Values]) -> None:
    parameters = mi.traverse(sensor)
    # Origin, target and up make one transform: coordinates that are not changed are read from the
    # camera.
    if set(changed) & set(_AIM):
        aim = {item.name.removeprefix("camera."): item.value for item in _of_camera(sensor)}
        aim |= changed
        parameters["to_world"] = _looking(parameters["to_world"], *(aim[name] for name in _AIM))
    if "fov" in changed:
        parameters["x_fov"] = changed["fov"][0]
    parameters.update()


def _looking(like: mi.Transform4f, origin: Values, target: Values, up: Values) -> mi.Transform4f:
    """Return the transform of a camera that looks from a point at another, of the type of the
    transform `like`.

    It is made here in float64: Mitsuba's `look_at` takes the difference of float32 coordinates, and
    a target a metre away, 10 km from the origin, would turn the camera by half a milliradian.
    """
    forward = np.subtract(target, origin)
    # Up and forward must span a plane. 1e-9 is the sine of the angle between both.
    left = np.cross(up, forward)
    if not np.linalg.norm(left) > 1e-9 * np.linalg.norm(up) * np.linalg.norm(forward):
        raise InputError(
            "camera: got a target at the origin, or straight up from it; expected another "
            "camera.target or camera.up"
        )
    forward, left = forward / np.linalg.norm(forward), left / np.linalg.norm(left)
    matrix = np.eye(4)
    matrix[:3] = np.column_stack([left, np.cross(forward, left), forward, origin])
    return type(like)(matrix)


# Lights -------------------------------------------------------------------------------------------


def _lights(scene: mi.Scene) -> list[mi.Emitter]:
    """Return the emitters in the order of their names: a sky comes behind the lights, which methods
    count without it.
    """
    return sorted(scene.emitters(), key=lambda emitter: emitter.is_environment())


def _of_light(prefix: str, emitter: mi.Emitter) -> Iterable[Changeable]:
    parameters = mi.traverse(emitter)
    kind = emitter.class_name()
    # A point light keeps its position as a parameter; a spot has it in its transform, with its axis
    # as the third column.
    if kind == "PointLight":
        yield _point(f"{prefix}.position", np.array(parameters["position"]))
    if kind == "SpotLight":
        yield _point(f"{prefix}.position", matrix_of(emitter.world_transform())[:3, 3])
    if kind in ("SpotLight", "DirectionalEmitter"):
        yield _point(
            f"{prefix}.direction", matrix_of(emitter.world_transform())[:3, 2], direction=True
        )
    for name, unit in _LIGHTS.items():
        if f"{name}.value" in parameters:
            # A grey spectrum of one number may be given one number only; an RGB value takes one or
            # three.
            value = _values(parameters[f"{name}.value"])
            yield Changeable(
                f"{prefix}.{name}",
                value,
                (1, 3) if len(value) == 3 else (1,),
                0,
                LARGEST_LIGHT,
                unit,
            )


def _change_light(emitter: mi.Emitter, changed: Mapping[str, Values]) -> None:
    parameters = mi.traverse(emitter)
    if "position" in parameters and "position" in changed:
        parameters["position"] = type(parameters["position"])(*changed["position"])
    elif "position" in changed or "direction" in changed:
        parameters["to_world"] = _shining(emitter, parameters["to_world"], changed)
    for name in _LIGHTS:
        if name in changed:
            _set_colour(parameters, f"{name}.value", changed[name])
    parameters.update()


def _shining(
    emitter: mi.Emitter, like: mi.Transform4f, changed: Mapping[str, Values]
) -> mi.Transform4f:
    """Return the transform of a light with its new position and direction, of the type of the
    transform `like`.
    """
    matrix = matrix_of(emitter.world_transform())
    if "position" in changed:
        matrix[:3, 3] = changed["position"]
    if "direction" in changed:
        # A light's axis is the third column. The two columns across it are arbitrary, but form a
        # right-handed orthonormal frame; the axis of coordinates least parallel to the light's axis
        # gives the cross product most digits.
        axis = np.array(changed["direction"]) / np.linalg.norm(changed["direction"])
        across = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
        across /= np.linalg.norm(across)
        matrix[:3, :3] = np.stack([across, np.cross(axis, across), axis], axis=1)
    return type(like)(matrix)


# Media --------------------------------------------------------------------------------------------


def _media(scene: mi.Scene) -> list[mi.Medium]:
    """Return the media of a scene, each once: first the medium around the camera, then the media
    that shapes bound.
    """
    media: list[mi.Medium] = []
    # The order makes the names: `medium` is the one around the camera. Grids are left out: they
    # have no single extinction to change.
    around = [sensor.get_medium() for sensor in scene.sensors()[:1]]
    for medium in around + [shape.interior_medium() for shape in scene.shapes()]:
        if (
            medium is not None
            and (medium.is_homogeneous() or _is_height_fog(medium))
            and medium not in media
        ):
            media.append(medium)
    return media


def _of_medium(prefix: str, medium: mi.Medium) -> Iterable[Changeable]:
    parameters = mi.traverse(medium)
    if _is_height_fog(medium):
        yield from _of_layers(
            prefix, {name: _values(parameters[f"sigma_t.{name}"]) for name in NUMBERS}
        )
    elif "sigma_t.value.value" in parameters:  # else a grid, which readers refuse
        # Mitsuba's extinction is the product of the colour and `scale`; only the product is
        # changed.
        sigma_t = np.array(parameters["sigma_t.value.value"], dtype=np.float64).ravel() * float(
            parameters["scale"]
        )
        sizes = (1, 3) if len(sigma_t) == 3 else (1,)
        yield Changeable(f"{prefix}.sigma_t", _values(sigma_t), sizes, 0, LARGEST_LENGTH, "1/m")
    if "albedo.value.value" in parameters:
        albedo = _values(parameters["albedo.value.value"])
        yield Changeable(f"{prefix}.albedo", albedo, (1, 3) if len(albedo) == 3 else (1,), 0, 1)
    if "phase_function.g" in parameters or _is_isotropic(medium):
        # An isotropic phase function has no parameter g; its mean cosine is 0, and
        # `scene_with_lobes` can give it another. At |g| = 1 the lobe is a delta function, hence
        # 0.99.
        g = _values(parameters["phase_function.g"]) if "phase_function.g" in parameters else (0.0,)
        yield Changeable(f"{prefix}.g", g, (1,), -0.99, 0.99)


def _is_height_fog(medium: mi.Medium) -> bool:
    return "sigma_t.H_1" in mi.traverse(medium)


def _of_layers(prefix: str, numbers: Mapping[str, Values]) -> Iterable[Changeable]:
    """Yield the constant part, and the numbers of the layers that have an extinction."""
    for name, value in numbers.items():
        part, layer = name.split("_")
        if layer == "0" or numbers[f"sigma_{layer}"] > (0.0,):
            # A scale height divides, so it stays above 0; extinctions may be 0, base heights
            # anything.
            least = {"sigma": 0.0, "z": -LARGEST_LENGTH, "H": 1e-6}[part]
            yield Changeable(
                f"{prefix}.{name}",
                value,
                (1,),
                least,
                LARGEST_LENGTH,
                "1/m" if part == "sigma" else "m",
            )


def _change_medium(medium: mi.Medium, changed: Mapping[str, Values]) -> None:
    parameters = mi.traverse(medium)
    if "sigma_t" in changed:
        # The value that is set is the whole extinction: the old scale must not multiply it again.
        parameters["scale"] = 1.0
        _set_colour(parameters, "sigma_t.value.value", changed["sigma_t"])
    for name in NUMBERS:
        if name in changed:
            parameters[f"sigma_t.{name}"] = changed[name][0]
    if "albedo" in changed:
        _set_colour(parameters, "albedo.value.value", changed["albedo"])
    if "g" in changed and "phase_function.g" in parameters:
        parameters["phase_function.g"] = changed["g"][0]
    elif changed.get("g", (0.0,)) != (0.0,):
        raise InputError(
            f"medium '{medium.id()}' is isotropic here; expected its g when the scene is loaded"
        )
    try:
        parameters.update()
    except (ValueError, RuntimeError) as error:  # of height fog, whose density has no bound then
        raise InputError(f"--change: {error}") from error


def _is_isotropic(medium: mi.Medium) -> bool:
    return medium.phase_function().class_name() == "IsotropicPhaseFunction"


def isotropic_media(scene: mi.Scene) -> dict[str, str]:
    """Return the ids of the isotropic media of a scene by the names of their mean cosines."""
    numbered = enumerate(_media(scene), 1)
    return {
        f"{_numbered('medium', number)}.g": medium.id()
        for number, medium in numbered
        if _is_isotropic(medium)
    }


def _set_colour(parameters: mi.SceneParameters, key: str, values: Values) -> None:
    kind = type(parameters[key])
    parameters[key] = kind(*values) if len(values) == 3 else kind(values[0])


# Isotropic media given a mean cosine --------------------------------------------------------------


def scene_with_lobes(description: Plugin, lobes: Mapping[str, float]) -> mi.Scene:
    """Return the scene of a dictionary, see `give_lobes`."""
    config = mi.parser.ParserConfig(mi.variant())
    # Merged meshes would lose their names, and media with one phase function change together; a
    # built-in scene is loaded without merging, too.
    config.merge_meshes = config.merge_equivalent = False
    state = mi.parser.parse_dict(config, description)
    give_lobes(state, lobes)
    # The digest describes the scene with its new phase functions, and is taken before Mitsuba's
    # transforms rewrite it.
    digest = description_digest(state)
    mi.parser.transform_all(config, state)
    scene = mi.parser.instantiate(config, state)
    give_description(scene, digest)
    return scene


def give_lobes(state: mi.parser.ParserState, lobes: Mapping[str, float]) -> None:
    """Give isotropic media of a parsed scene Henyey-Greenstein phase functions; `lobes`: their mean
    cosines by the ids of the media.

    Mitsuba can change the numbers of a phase function that it has built, not its kind: the
    description is changed before. Raises InputError for a medium without a description, which is
    part of a shape that was built before.
    """
    for name, g in lobes.items():
        phase = _isotropic_phase(state, name)
        if phase is None:
            raise InputError(
                f"medium '{name}': its g cannot be changed: give it a phase function of type 'hg'"
            )
        phase.set_plugin_name("hg")
        phase["g"] = g


def _isotropic_phase(state: mi.parser.ParserState, name: str) -> mi.Properties | None:
    """Return the properties of the isotropic phase function of a medium; None where the parsed
    scene has none.
    """
    nodes = [node.props for node in state.nodes]
    for medium in nodes:
        if medium.plugin_name() != "homogeneous" or medium.id() != name:
            continue
        for key in medium.keys():  # noqa: SIM118 - properties iterate over pairs
            value = medium[key]
            # A parsed dictionary refers to plugins by number (resolved) or by id (a `ref`). A `ref`
            # of an unknown id falls back to the medium itself, which is no phase function.
            if isinstance(value, mi.Properties.ResolvedReference):
                phase = nodes[value.index()]
            elif isinstance(value, mi.Properties.Reference):
                phase = next((node for node in nodes if node.id() == value.id()), medium)
            else:
                continue
            if phase.plugin_name() == "isotropic":
                return phase
    return None
