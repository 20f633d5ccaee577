# SPDX-License-Identifier: BSD-3-Clause
"""The adapters `eevee.py` and `cycles.py` but for their engines; no adapter itself. See README.md.

Both build a scene as `docs/examples/render_cycles.py` does, by the module `bpy`. That wants CPython
3.11, and lies in an environment of its own, which is looked for and started: AIRLIGHT_CYCLES_PYTHON
names the Python of another one. No display is needed.
"""

import json
import math
import os
import shlex
import shutil
import sys
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

_HERE = Path(__file__).resolve().parent
EXAMPLES = _HERE.parent / "examples"
VERSION = "5.0.1"
WRONG, MISSING = 2, 3  # exit statuses, those of airlight
_PYTHON = "AIRLIGHT_CYCLES_PYTHON"
_STARTED = "AIRLIGHT_BPY_STARTED"  # says to a Python that it was started for its `bpy`
#: The libraries that `bpy` loads, as Debian has them.
_LIBRARIES = "libgl1 libsm6 libxfixes3 libxi6 libxkbcommon0 libxrender1"


@dataclass(frozen=True)
class Engine:
    """An engine of Blender."""

    name: str
    key: str  #: as Blender calls it
    settings: dict[str, Any]  #: by their names in Blender's Python, with their defaults
    phases: tuple[str, ...]  #: the phase functions that it has, by their names in a description
    #: sets up a scene of `bpy` by a description and settings, and returns the settings as they are
    set_up: Callable[[Any, dict[str, Any], dict[str, Any]], dict[str, Any]]
    model: Callable[[dict[str, Any]], str | None]  #: the equation that settings mean, in words
    pixel: Callable[[dict[str, Any]], str | None]  #: of what the values of pixels are
    device: Callable[[], str]  #: that drew the image
    prepare: Callable[[], object] = lambda: None  #: ends where something is missing on the machine


def end(status: int, words: str) -> NoReturn:
    """End with a line on the error stream."""
    print(" ".join(words.split()), file=sys.stderr, flush=True)
    os._exit(status)


def run(engine: Engine) -> None:
    """Be the adapter of an engine."""
    began = time.perf_counter()
    if len(sys.argv) < 4:
        end(WRONG, f"expected {Path(sys.argv[0]).name} SCENE.json SCENE.glb OUT.exr NAME=VALUE...")
    # Mistakes in words are told before anything is looked for or starts.
    settings = engine.settings | dict(setting(engine, word) for word in sys.argv[4:])
    find_bpy(engine.name)
    engine.prepare()
    # Blender prints on the output, which belongs to one line of JSON: it gets the error stream.
    told = os.dup(1)
    os.dup2(2, 1)
    try:
        data = draw(engine, settings, *sys.argv[1:4])
    except Exception:
        traceback.print_exc()
        os._exit(1)
    data["seconds"] = round(time.perf_counter() - began, 3)
    os.write(told, (json.dumps(data) + "\n").encode())
    os._exit(0)  # Blender's own end takes long, and prints


def setting(engine: Engine, word: str) -> tuple[str, Any]:
    """Return a setting by its name, with the type that it has."""
    name, _, value = word.partition("=")
    if name == "edit":
        end(WRONG, f"{engine.name}: its shaders cannot be edited")
    if name not in engine.settings:
        had = ", ".join(engine.settings)
        end(WRONG, f"{engine.name} has no setting '{name}' here; it has {had}")
    old = engine.settings[name]
    if isinstance(old, bool):
        values = {"1": True, "true": True, "0": False, "false": False}
        if value.lower() not in values:
            end(WRONG, f"{name}: got '{value}', expected true or false")
        return name, values[value.lower()]
    try:
        number = type(old)(value)
    except ValueError:
        number = math.nan
    if isinstance(old, str) or math.isfinite(number):
        return name, number
    kind = "a whole number" if isinstance(old, int) else "a number"
    end(WRONG, f"{name}: got '{value}', expected {kind}")


def find_bpy(name: str) -> None:
    """Start again with the Python that has `bpy`, where this one has not."""
    # Blender has a module `cycles` of its own, which the adapter of that name would hide.
    sys.path = [path for path in sys.path if Path(path).resolve() != _HERE]
    try:
        import bpy  # noqa: F401
    except ImportError as error:
        why = error
    else:
        return
    cache = os.environ.get("AIRLIGHT_CACHE_DIR") or os.path.expanduser("~/.cache/airlight")
    folder = Path(cache) / f"adapters-bpy-{VERSION}"
    named, own = os.environ.get(_PYTHON), str(folder / "bin" / "python")
    python = shutil.which(named or own)
    if python and _STARTED not in os.environ:
        os.environ[_STARTED] = "1"
        os.execv(python, [python, *sys.argv])
    # It is nowhere: say what to type, for the Python that is named if there is one.
    if not isinstance(why, ModuleNotFoundError):
        line = f"apt-get install -y {_LIBRARIES}"
        end(MISSING, f"{name}: bpy does not load: {why}: `{line}` on Debian")
    install = f"-m pip install bpy=={VERSION}"
    if named and python:
        line = f"{shlex.quote(python)} {install}"
        end(MISSING, f"{name}: {_PYTHON} names {named}, which has no module bpy: `{line}`")
    line = f"python3.11 -m venv {shlex.quote(str(folder))} && {shlex.quote(own)} {install}"
    if named:
        line = f"unset {_PYTHON} && {line}"
        end(MISSING, f"{name}: {_PYTHON} names {named}, which is no program: `{line}`")
    end(MISSING, f"{name}: the module bpy is missing: `{line}`, which takes 1 GB")


def draw(
    engine: Engine, settings: dict[str, Any], described_path: str, gltf: str, output: str
) -> dict[str, Any]:
    """Render, and return what is to be told."""
    import bpy

    sys.path.insert(0, str(EXAMPLES))
    from render_cycles import assign, build, read

    described = json.loads(Path(described_path).read_text(encoding="utf-8"))["result"]
    properties = read(described_path)
    refused = refusal(engine, described, properties)
    if refused:
        end(WRONG, refused)
    properties["scene"]["render.engine"] = engine.key
    build(properties, gltf)
    scene = bpy.context.scene
    made = engine.set_up(scene, described, settings)
    # The layers: all light, and that of the fog.
    layer = scene.view_layers[0]
    assign(layer, {"eevee.use_pass_volume_direct": True, "cycles.use_pass_volume_direct": True})
    assign(scene.render.image_settings, properties["layered_image_settings"])
    scene.render.filepath, scene.render.use_file_extension = output, False
    bpy.ops.render.render(write_still=True)
    return {
        "engine": engine.name,
        "version": bpy.app.version_string,
        "settings": made,
        "problems": [],
        "model": engine.model(made),
        "pixel": engine.pixel(made),
        "device": engine.device(),
        "layers": {"airlight": "ViewLayer.Volume Direct", "total": "ViewLayer.Combined"},
    }


def refusal(engine: Engine, described: dict[str, Any], properties: dict[str, Any]) -> str | None:
    """Return why the engine cannot have a scene; None where it can."""
    parts = [*properties["lights"], *properties["media"].values()]
    parts += [*properties["materials"].values(), properties["world"] or {}]
    for part in parts:
        if "cannot" in part:
            like = "" if engine.key == "CYCLES" else " is set up as Cycles"
            return f"{engine.name}{like}: {part['cannot']}"
    for medium in [described["medium"] or {}, *described["bounded_media"]]:
        phase = medium.get("phase", {"name": "isotropic"})["name"]
        if phase not in engine.phases:
            return f"{engine.name}: it has no phase function {phase}"
    return None


def take(thing: Any, values: dict[str, Any]) -> None:
    """Assign settings, and end where Blender does not take a value: it changes such values to the
    nearest that it has.
    """
    for name, value in values.items():
        try:
            setattr(thing, name, value)
        except (TypeError, ValueError, OverflowError) as error:
            end(WRONG, f"{name}: got '{value}': {str(error).rpartition('val: ')[2]}")
        has = getattr(thing, name)
        # A number of Blender has 32 bits.
        close = isinstance(value, float) and math.isclose(has, value, rel_tol=1e-6)
        if has != value and not close:
            end(WRONG, f"{name}: got '{value}', and Blender takes {has} in its place")
