# SPDX-License-Identifier: BSD-3-Clause
"""What the shell completes: names of scenes, methods and kernels, and files.

Nothing is imported for it: an answer must come while a finger is on the Tab key, and the registries import Mitsuba.
So the names are read from the text of the registries; a test compares them.
"""

import re
from collections.abc import Callable, Iterator
from pathlib import Path

_ROOT = Path(__file__).resolve().parents[2]


def scene_names() -> list[str]:
    """Return the names of the built-in scenes, in alphabetical order."""
    files = sorted((_ROOT / "validation" / "scenes").glob("*.toml"))
    return sorted(name for file in files for name in _named(file, r"^\[([\w-]+)\]"))


def method_names() -> list[str]:
    """Return the names of the built-in methods, in the order of the registry."""
    return _named(_ROOT / "realtime" / "methods" / "registry.py", r'^    "([\w-]+)": Method\($')


def kernel_names() -> list[str]:
    """Return the names of the kernels, in the order of the registry."""
    return _named(_ROOT / "realtime" / "kernels" / "registry.py", r'^    "([\w-]+)": Kernel\($')


def scenes(incomplete: str) -> list[str]:
    """Complete a scene: a built-in one or an XML file."""
    return [*_beginning(scene_names(), incomplete), *_files(incomplete, ".xml")]


def scenes_and_images(incomplete: str) -> list[str]:
    """Complete what `compare` takes: a scene or an EXR file."""
    return [*scenes(incomplete), *_files(incomplete, ".exr")]


def methods(incomplete: str) -> list[str]:
    """Complete a method: a built-in one, or the beginning of one's own in a file."""
    return [*_beginning(method_names(), incomplete), *(f"{path}:" for path in _files(incomplete, ".py"))]


def kernels(incomplete: str) -> list[str]:
    """Complete a kernel."""
    return _beginning(kernel_names(), incomplete)


def figures_and_scenes(*figures: str) -> Callable[[str], list[str]]:
    """Return the completion of what `figures` takes: figures and a scene."""
    return lambda incomplete: _beginning([*figures, *scene_names()], incomplete)


def one_of(*words: str) -> Callable[[str], list[str]]:
    """Return the completion of a word among few."""
    return lambda incomplete: _beginning(words, incomplete)


def _named(file: Path, pattern: str) -> list[str]:
    return re.findall(pattern, file.read_text(encoding="utf-8"), flags=re.MULTILINE)


def _beginning(words, incomplete: str) -> list[str]:
    return [word for word in words if word.startswith(incomplete)]


def _files(incomplete: str, ending: str) -> Iterator[str]:
    """Yield files with an ending whose path begins with what was typed; folders are the shell's own."""
    folder, _, name = incomplete.rpartition("/")
    start = f"{folder}/" if "/" in incomplete else ""
    try:
        found = sorted(path.name for path in Path(start or ".").iterdir())
    except OSError:
        return
    yield from (f"{start}{each}" for each in found if each.startswith(name) and each.endswith(ending))
