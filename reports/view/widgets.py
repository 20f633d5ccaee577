# SPDX-License-Identifier: BSD-3-Clause
"""Data for the widgets of the page, and the commands that show or render its frame again.

All of it follows from typed records, nothing is listed here. Functions return dictionaries: the
messages of the page, which a script reads and no Python.
"""

import shlex
from collections.abc import Mapping
from dataclasses import Field, dataclass, field, fields
from typing import Any

from airlight.realtime.area_lights.points import LightSamples
from airlight.realtime.kernels.registry import KERNELS
from airlight.realtime.methods.interface.method import method_parameters
from airlight.realtime.methods.registry import METHODS, find_method
from airlight.realtime.parameters import limits_of
from airlight.validation.scenes.changes import Values, change_words
from airlight.validation.study.configuration import Configuration


@dataclass(frozen=True)
class ViewState:
    """A scene, what of it was changed, and the configuration that renders it."""

    scene: str  #: name or path, as the user gave it
    size: tuple[int, int]  #: of the image [pixels]
    chosen: Configuration
    changes: Mapping[str, Values] = field(default_factory=dict)  #: `validation.scenes.changes`

    def command(self, name: str) -> str:
        """Return the line to type that shows this: `name` is 'view', 'render' or 'reference'."""
        # A reference needs no method, but the same scene, changes and size.
        words = ["airlight", name, self.scene]
        if name != "reference":
            words += ["--method", self.chosen.method]
            words += ["--set", f"kernel={self.chosen.kernel}"] if self.chosen.kernel else []
            for parameter, value in self.chosen.parameters:
                words += ["--set", f"{parameter}={value}"]
        for word in change_words(self.changes):
            words += ["--change", word]
        words += ["--size", f"{self.size[0]}x{self.size[1]}"]
        return shlex.join(words)


def method_widgets(own: str) -> list[dict[str, Any]]:
    """Return the methods; `own` is the one that the user named, which
    may not be in the registry.
    """
    names = [*METHODS, *([own] if own not in METHODS else [])]
    return [{"name": name, "summary": find_method(name).summary} for name in names]


def kernel_widgets() -> list[dict[str, Any]]:
    """Return the kernels, each with the name and the default of the number
    that may follow its name.
    """
    return [
        {
            "name": kernel.name,
            "summary": kernel.summary,
            "number": next(iter(kernel.parameters.items()), None),
        }
        for kernel in KERNELS.values()
    ]


def parameter_widgets(chosen: Configuration, *, area_lights: bool) -> list[dict[str, Any]]:
    """Return the parameters of a method with values, ranges and help; for area
    lights also of their points.
    """
    method = find_method(chosen.method)
    # A method may set parameters of area lights itself: those are shown once, as the method's.
    own, light_samples = method_parameters(method, dict(chosen.parameters))
    widgets = [_parameter(item, getattr(own, item.name)) for item in fields(own)]
    if area_lights:
        names = {widget["name"] for widget in widgets}
        common = [item for item in fields(LightSamples) if item.name not in names]
        widgets += [_parameter(item, getattr(light_samples, item.name)) for item in common]
    return widgets


def calls_kernel(chosen: Configuration) -> bool:
    """Return whether a method calls a kernel with its parameters."""
    return method_parameters(find_method(chosen.method), dict(chosen.parameters))[0].uses_kernel


def _parameter(item: Field, value: Any) -> dict[str, Any]:
    limits = limits_of(item)
    widget: dict[str, Any] = {
        "name": item.name,
        "value": value,
        "help": limits.help,
        "unit": limits.unit,
    }
    # The kind of widget follows from the type of the default; a bool comes before numbers, as it is
    # one for Python.
    if limits.choices:
        return widget | {"kind": "choice", "choices": limits.choices}
    if isinstance(item.default, bool):
        return widget | {"kind": "switch"}
    if isinstance(item.default, str):
        return widget | {"kind": "word"}
    return widget | {
        "kind": "number",
        "whole": isinstance(item.default, int),
        "least": limits.above if limits.least is None else limits.least,
        "most": limits.below if limits.most is None else limits.most,
    }
