# SPDX-License-Identifier: BSD-3-Clause
"""A digest of a scene: of every property of every object, every vertex, every value of every file.

Mitsuba tells Python the parameters of its objects, their classes and a few properties beside them.
That is everything where all classes are in `_WHOLE`. Objects of other classes have properties that
nobody can ask for once they are built: how a texture or a grid is filtered and which values lie
beyond it. A scene with such an object has a digest only if it carries a digest of its description:
of the nodes of Mitsuba's parser and the files that they name, or of the code that built it. The
code that loads a scene leaves this digest as the id of the scene, since Mitsuba's scenes take no
other mark. Any other scene has no digest, and its results are not cached.
"""

import hashlib
import re
from collections.abc import Iterator, Mapping
from pathlib import Path

import mitsuba as mi
import numpy as np

from airlight.reference.storage.store import Content

#: Plugins without an id are named by their address, which differs from run to run.
_ADDRESS = re.compile(r"object_\d+|0x[0-9a-f]+")

#: Classes that `_beside` and their parameters describe in full. How a film filters and stores
#: pixels, and samplers, count for nothing: no estimator and no method uses them.
_WHOLE = {
    *("Scene", "PerspectiveCamera", "HDRFilm", "IndependentSampler", "BoxFilter", "GaussianFilter"),
    *("PointLight", "SpotLight", "DirectionalEmitter", "AreaLight", "ConstantBackgroundEmitter"),
    *("HomogeneousMedium", "ConstVolume", "UniformSpectrum", "SRGBReflectanceSpectrum"),
    *(
        "IsotropicPhaseFunction",
        "HGPhaseFunction",
        "RayleighPhaseFunction",
        "TabulatedPhaseFunction",
    ),
    *("Null", "SmoothDiffuse", "TwoSidedBRDF", "SmoothConductor"),
    *("Sphere", "Disk", "Rectangle", "Cube", "Mesh", "OBJMesh", "PLYMesh"),
}
_DESCRIPTION = "description "  # before the digest of a description in the id of a scene


class _UnknownError(Exception):
    """Raised for a value without bytes that stay the same in the next run."""


def scene_digest(scene: "mi.Scene") -> str | None:
    """Return a digest of a scene; None if it has properties that neither Mitsuba nor a description
    tells.
    """
    described = scene.id() if scene.id().startswith(_DESCRIPTION) else ""
    try:
        digest = _built_digest(scene)
    except _UnknownError:
        return None
    if not (described or is_whole(scene)):
        return None
    return hashlib.sha256(f"{digest} {described}".encode()).hexdigest()


def scene_content(scene: "mi.Scene") -> Content:
    """Return a scene as an input of results that are cached."""
    return Content(scene_digest(scene))


def build_scene(description: Mapping[str, object]) -> "mi.Scene":
    """Return the scene of a dictionary, as `mi.load_dict`, with the digest of its description."""
    scene = mi.load_dict(dict(description))
    if isinstance(scene, mi.Scene) and not is_whole(scene):
        config = mi.parser.ParserConfig(mi.variant())
        give_description(scene, description_digest(mi.parser.parse_dict(config, dict(description))))
    return scene


def give_description(scene: "mi.Scene", digest: str | None) -> None:
    """Let a scene carry a digest of its description; None where it has none."""
    scene.set_id("" if digest is None else _DESCRIPTION + digest)


def description_digest(state: "mi.parser.ParserState") -> str | None:
    """Return a digest of the nodes of a parsed scene and of the files that they name; None if a
    value has none.

    Call it before `mi.parser.instantiate`, which takes the nodes apart, with the
    file resolver of the scene.
    """
    digest = hashlib.sha256()
    try:
        for node in state.nodes:
            props = node.props
            digest.update(f"|{props.plugin_name()} {_ADDRESS.sub('', props.id())}".encode())
            for key in list(props.keys()):
                # Mitsuba marks a property that is read as used, and warns of unused ones: the mark
                # is set back.
                queried = props.was_queried(key)
                digest.update(f"|{key} {props.type(key)} ".encode() + _property_bytes(props[key]))
                props.mark_queried(key, queried)
    except _UnknownError:
        return None
    return digest.hexdigest()


def is_whole(scene: "mi.Object") -> bool:
    """Return whether Mitsuba tells every property of a scene or of another object."""
    return {part.class_name() for part in mi.traverse(scene).hierarchy} <= _WHOLE


def _built_digest(scene: "mi.Object") -> str:
    """Return a digest of all that Mitsuba tells of a scene, or of another object, that is built."""
    digest = hashlib.sha256()
    parameters = mi.traverse(scene)
    for part in parameters.hierarchy:
        digest.update(f"|{part.class_name()}".encode())
    # Names by address differ from run to run, and count for nothing.
    for words in _beside(scene) if isinstance(scene, mi.Scene) else ():
        digest.update(f"|{_ADDRESS.sub('', words)}".encode())
    for key in parameters.keys():  # noqa: SIM118 - SceneParameters iterates over items
        digest.update(f"|{_ADDRESS.sub('', key)} ".encode() + _value_bytes(parameters[key]))
    return digest.hexdigest()


def _beside(scene: "mi.Scene") -> Iterator[str]:
    """Yield the properties that decide the numbers and are no parameters: which way surfaces face,
    and which media are where.
    """
    for sensor in scene.sensors():
        yield _medium_words(sensor.get_medium())
    for emitter in scene.emitters():
        yield _medium_words(emitter.get_medium())
    for shape in scene.shapes():
        yield f"{shape.class_name()} {shape.has_flipped_normals()} {shape.bsdf()}"
        inside, outside = shape.interior_medium(), shape.exterior_medium()
        yield f"inside {_medium_words(inside)}, outside {_medium_words(outside)}"


def _medium_words(medium: "mi.Medium | None") -> str:
    if medium is None:
        return "no medium"
    sampling = f"{medium.has_spectral_extinction()} {medium.use_emitter_sampling()}"
    return f"{medium.id()} {sampling} {medium} {medium.phase_function()}"


def _property_bytes(value: object) -> bytes:
    """Return the bytes of a property of a node."""
    if isinstance(value, mi.Properties.ResolvedReference):
        return str(value.index()).encode()
    if isinstance(value, mi.Properties.Reference):
        return value.id().encode()
    # a spectrum, whose type has no name of its own in every variant
    if hasattr(value, "wavelengths") and hasattr(value, "values"):
        return _value_bytes(value.wavelengths) + b"|" + _value_bytes(value.values)
    if isinstance(value, str):
        # A word may name a file, whose content counts, not its name.
        path = Path(str(mi.file_resolver().resolve(value)))
        return hashlib.sha256(path.read_bytes()).digest() if path.is_file() else value.encode()
    if isinstance(value, mi.Bitmap):
        words = (
            f"{value.pixel_format()} {value.component_format()} {value.srgb_gamma()} "
            f"{value.premultiplied_alpha()}"
        )
        return words.encode() + _value_bytes(np.array(value))
    if isinstance(value, mi.VolumeGrid):
        return _value_bytes(np.array(value))
    if isinstance(value, mi.Object):
        # An object that is built already is known by its parameters alone: they must tell all.
        if not is_whole(value):
            raise _UnknownError
        return _built_digest(value).encode()
    return _value_bytes(value)


def _value_bytes(value: object) -> bytes:
    """Return the bytes of a number, a word, an array, or a transform."""
    if isinstance(value, str):
        return value.encode()
    # The name of the type decides: a colour has a `matrix` too, a swizzle that holds its first
    # channel six times.
    if "Transform" in type(value).__name__ and hasattr(value, "matrix"):
        value = value.matrix
    try:
        array = np.array(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise _UnknownError from error
    return f"{array.shape} ".encode() + array.tobytes()
