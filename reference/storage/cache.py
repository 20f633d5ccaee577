# SPDX-License-Identifier: BSD-3-Clause
"""Finished references on disk, found again by their content.

The key is a digest of everything that decides the numbers: the scene as Mitsuba holds it (every parameter of every
plugin, every vertex), the estimator and its settings, the versions of what computes them. A file is written whole or
not at all, so a killed run loses nothing that was finished and leaves nothing half-written. Each file holds a digest of
its own content and name: one that was damaged, edited or renamed counts as none.
"""

import hashlib
import json
import os
import re
import time
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from contextlib import suppress
from io import BytesIO
from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np

from reference.storage.files import write_bytes

#: Raise this when the meaning or the accuracy of a cached number changes.
GENERATION = 4

#: Plugins without an id are named by their address, which differs from run to run.
_ADDRESS = re.compile(r"object_\d+|0x[0-9a-f]+")
_DIGEST = "digest"  # the name of the digest among the arrays
_STALE = 3600.0  # seconds after which a half-written file belongs to nobody


def cache_folder() -> Path:
    """Return the folder of the cache: AIRLIGHT_CACHE_DIR, or `airlight` in the user's cache folder."""
    own = os.environ.get("AIRLIGHT_CACHE_DIR")
    if own:
        return Path(own)
    base = os.environ.get("XDG_CACHE_HOME")
    return (Path(base) if base else Path.home() / ".cache") / "airlight"


def scene_digest(scene) -> str:
    """Return a digest of a Mitsuba scene: of every parameter of every plugin in it."""
    digest = hashlib.sha256()
    parameters = mi.traverse(scene)
    for words in _kinds(scene):
        digest.update(_ADDRESS.sub("", words).encode())
    for key in parameters.keys():  # noqa: SIM118 - SceneParameters iterates over items
        digest.update(_ADDRESS.sub("", key).encode())
        digest.update(_value_bytes(parameters[key]))
    return digest.hexdigest()


def _kinds(scene) -> Iterator[str]:
    """Yield what decides the numbers but is no parameter: the kinds of the plugins, and which way surfaces face."""
    for sensor in scene.sensors():
        yield sensor.class_name()
        yield _medium_words(sensor.get_medium())
    for emitter in scene.emitters():
        yield emitter.class_name()
    for shape in scene.shapes():
        yield f"{shape.class_name()} {shape.has_flipped_normals()} {shape.bsdf()}"
        yield f"inside {_medium_words(shape.interior_medium())}, outside {_medium_words(shape.exterior_medium())}"


def _medium_words(medium: Any) -> str:
    # An isotropic and a Rayleigh phase function have no parameters: they differ by their names alone.
    return "no medium" if medium is None else f"{medium} {medium.phase_function()}"


def _value_bytes(value: Any) -> bytes:
    # By the name of the type: a colour has a `matrix` too, a swizzle that holds its first channel six times.
    matrix = value.matrix if "Transform" in type(value).__name__ else value
    try:
        return np.array(matrix, dtype=np.float64).tobytes()
    except (TypeError, ValueError):
        return repr(value).encode()


def cache_key(scene, estimator: str, settings: Mapping[str, Any]) -> str:
    """Return the name under which a result of an estimator is kept."""
    from importlib.metadata import version

    content = {
        "scene": scene_digest(scene),
        "estimator": estimator,
        "settings": dict(settings),
        "versions": {name: version(name) for name in ("mitsuba", "drjit")},
        "generation": GENERATION,
    }
    return f"{estimator}-" + hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:32]


def load_arrays(key: str) -> dict[str, Any] | None:
    """Return the arrays kept under a key, or None where there are none or the file is damaged."""
    try:
        # Opened here, since `np.load` leaves a file that it cannot read open.
        with open(_path(key), "rb") as file, np.load(file, allow_pickle=False) as stored:
            arrays = {name: stored[name] for name in stored.files}
    except FileNotFoundError:
        return None
    except (OSError, ValueError, KeyError, EOFError, AttributeError, TypeError, zipfile.BadZipFile, zlib.error):
        # Not ours, or cut short by a full disk: compute it again and replace it.
        return None
    written = arrays.pop(_DIGEST, None)
    return arrays if written is not None and str(written) == _content_digest(key, arrays) else None


def is_kept(key: str) -> bool:
    """Return whether there is a file under a key, damaged or not."""
    return _path(key).exists()


def store_arrays(key: str, arrays: Mapping[str, Any]) -> None:
    """Keep arrays under a key, replacing what is there; a key may name a folder, as in 'volpath-0a1b/000017'."""
    content: dict[str, Any] = {name: np.asarray(value) for name, value in arrays.items()}
    buffer = BytesIO()
    np.savez(buffer, **(content | {_DIGEST: np.asarray(_content_digest(key, content))}))
    write_bytes(_path(key), buffer.getvalue())


def drop_arrays(key: str) -> None:
    """Forget what is kept under a key."""
    _path(key).unlink(missing_ok=True)


def sweep(folder: Path) -> None:
    """Remove what a killed run left half-written in a folder: hidden files older than an hour."""
    for path in folder.glob(".*.npz"):
        with suppress(OSError):  # another run may have removed it
            if time.time() - path.stat().st_mtime > _STALE:
                path.unlink()


def _path(key: str) -> Path:
    return cache_folder() / f"{key}.npz"


def _content_digest(key: str, arrays: Mapping[str, Any]) -> str:
    """Return a digest of the name and of every array: its name, kind, shape and bytes."""
    digest = hashlib.blake2b(key.encode(), digest_size=16)
    for name in sorted(arrays):
        value = np.ascontiguousarray(arrays[name])
        digest.update(f"|{name} {value.dtype.str} {np.shape(arrays[name])}|".encode())
        digest.update(value.data if value.size and value.dtype.kind in "biufc" else value.tobytes())
    return digest.hexdigest()
