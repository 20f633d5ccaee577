# SPDX-License-Identifier: BSD-3-Clause
"""Finished references on disk, found again by their content.

The key is a digest of everything that decides the numbers: the scene as Mitsuba holds it (every parameter of every
plugin, every vertex), the estimator and its settings, the versions of what computes them. A file is written whole or
not at all, so a killed run loses nothing that was finished and leaves nothing half-written.
"""

import hashlib
import json
import os
import re
from collections.abc import Mapping
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from reference.files import write_bytes

#: Raise this when the meaning or the accuracy of a cached number changes.
GENERATION = 1


def cache_folder() -> Path:
    """Return the folder of the cache: AIRLIGHT_CACHE_DIR, or `airlight` in the user's cache folder."""
    own = os.environ.get("AIRLIGHT_CACHE_DIR")
    if own:
        return Path(own)
    base = os.environ.get("XDG_CACHE_HOME")
    return (Path(base) if base else Path.home() / ".cache") / "airlight"


def scene_digest(scene) -> str:
    """Return a digest of a Mitsuba scene: of every parameter of every plugin in it."""
    import mitsuba as mi

    digest = hashlib.sha256()
    parameters = mi.traverse(scene)
    for plugin in (*scene.sensors(), *scene.emitters(), *scene.shapes()):
        digest.update(plugin.class_name().encode())
    for key in parameters.keys():  # noqa: SIM118 - SceneParameters iterates over items
        # Plugins without an id are named by their address, which differs from run to run.
        digest.update(re.sub(r"object_\d+|0x[0-9a-f]+", "", key).encode())
        digest.update(_value_bytes(parameters[key]))
    return digest.hexdigest()


def _value_bytes(value: Any) -> bytes:
    matrix = getattr(value, "matrix", value)
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
    path = cache_folder() / f"{key}.npz"
    try:
        with np.load(path, allow_pickle=False) as stored:
            return {name: stored[name] for name in stored.files}
    except FileNotFoundError:
        return None
    except (OSError, ValueError, KeyError, EOFError):
        # Not ours, or cut short by a full disk: compute it again and replace it.
        return None


def store_arrays(key: str, arrays: Mapping[str, Any]) -> None:
    """Keep arrays under a key, replacing what is there."""
    folder = cache_folder()
    folder.mkdir(parents=True, exist_ok=True)
    buffer = BytesIO()
    np.savez(buffer, **{name: np.asarray(value) for name, value in arrays.items()})
    write_bytes(folder / f"{key}.npz", buffer.getvalue())
