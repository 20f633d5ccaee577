# SPDX-License-Identifier: BSD-3-Clause
"""The command, or the call from Python, that makes a report again, as its record says."""

import os
import shlex
from collections.abc import Mapping, Sequence
from typing import Any

from airlight.reports.api.inputs import several


def setting_words(settings: Any) -> list[str]:
    """Return settings as words NAME=VALUE, from a mapping or from such words."""
    if isinstance(settings, Mapping):
        return [f"{name}={value}" for name, value in settings.items()]
    return [str(word) for word in several(settings)]


def report_command(
    options: Mapping[str, Any],
    scenes: Sequence[Any],
    methods: Sequence[Any] = (),
    kernels: Sequence[Any] = (),
    settings: Any = (),
) -> str:
    """Return what makes a report again: a command where all has a name,
    else the call from Python.
    """
    named = {"method": methods, "kernel": kernels, "set": setting_words(settings)}
    # Defaults are left out of the command; the one pair is a size.
    given = {
        name: "x".join(map(str, value)) if isinstance(value, tuple) else value
        for name, value in options.items()
        if value
    }
    # Words can be typed on a command line. A function or a loaded scene cannot: the call from
    # Python stands there instead.
    if all(isinstance(each, str | os.PathLike) for each in (*scenes, *methods, *kernels)):
        words = ["airlight", "report", *map(str, scenes)]
        several_times = [(name, value) for name, each in named.items() for value in each]
        for name, value in (*several_times, *given.items()):
            words += [f"--{name}"] if value is True else [f"--{name}", str(value)]
        return shlex.join(words)
    listed = {
        "settings" if name == "set" else name: value for name, value in named.items() if value
    }
    parts = [_python(scenes)] if scenes else []
    parts += [f"{name}={_python(value)}" for name, value in (listed | given).items()]
    return f"airlight.report({', '.join(parts)})"


def _python(value: Any) -> str:
    """Return an argument as one writes it in Python; a function stands there by its name."""
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_python, value))}]"
    if callable(value):
        return str(value.__name__)
    return repr(os.fspath(value) if isinstance(value, os.PathLike) else value)
