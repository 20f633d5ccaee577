# SPDX-License-Identifier: BSD-3-Clause
"""Configurations: a method with a kernel and the values of its parameters, as a user names them."""

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from analytic.errors import InputError, nearest
from realtime.errors import InputError as MethodError
from realtime.frame.renderer import FrameRenderer, frame_renderer
from realtime.methods.registry import find_method
from realtime.scene.read_scene import Scene
from validation.configurations.kernel_names import find_kernel

_TRUE, _FALSE = ("true", "yes", "on", "1"), ("false", "no", "off", "0")


@dataclass(frozen=True)
class Configuration:
    """A method, the kernel that it calls (if it calls one) and the parameters that differ from its defaults."""

    method: str
    kernel: str | None = None
    parameters: tuple[tuple[str, int | float | str], ...] = ()

    @property
    def label(self) -> str:
        """A name for tables, plots and files."""
        values = [f"{name}={value}" for name, value in self.parameters]
        inside = ", ".join(([self.kernel] if self.kernel else []) + values)
        return f"{self.method} ({inside})" if inside else self.method

    @property
    def own(self) -> bool:
        """Whether the method is the user's own, named 'module:function'."""
        return ":" in self.method


#: Of airlight between the corners of tiles, where tables show it: 99 % of the pixels are within 1e-3.
TOLERANCE = 0.005

#: What `bench` and `report` measure unless told otherwise.
STANDARD: tuple[Configuration, ...] = (
    Configuration("unshadowed", "taylor"),
    Configuration("unshadowed", "quadrature"),
    Configuration("unshadowed", "exact"),
    Configuration("ray-march", None, (("steps", 16),)),
    Configuration("ray-march", None, (("steps", 100),)),
    Configuration("ray-march", None, (("steps", 100), ("spacing", "uniform"))),
    Configuration("ray-march", None, (("steps", 100), ("shadow", "map"))),
    Configuration("ray-march", None, (("steps", 400), ("shadow", "map"), ("map", 1024))),
    Configuration("shadow-planes", "exact"),
    Configuration("shadow-planes", "taylor"),
    Configuration("shadow-planes", "exact", (("order", "paper"),)),
    Configuration("shadow-planes", "exact", (("order", "none"),)),
    Configuration("shadow-planes", "exact", (("media", "paper"),)),
    Configuration("min-max", "exact"),
    Configuration("light-volumes", "exact"),
    Configuration("light-volumes", "taylor"),
    Configuration("light-volumes", "exact", (("map", 2048),)),
)

#: What `report --quick` measures: one of each kind.
QUICK: tuple[Configuration, ...] = (
    Configuration("unshadowed", "exact"),
    Configuration("ray-march", None, (("steps", 100),)),
    Configuration("ray-march", None, (("steps", 100), ("shadow", "map"))),
    Configuration("shadow-planes", "exact"),
    Configuration("shadow-planes", "taylor"),
    Configuration("min-max", "exact"),
    Configuration("light-volumes", "exact"),
)


def configuration(
    method: str | Callable[..., Any], kernel: str | None = None, parameters: Mapping[str, Any] | None = None
) -> Configuration:
    """Return a configuration, checked.

    Parameters
    ----------
    method
        A name of `realtime.methods.registry.METHODS`, one's own as 'module:function' or 'path/to/file.py:function', or
        such a function itself.
    kernel
        See `validation.configurations.kernel_names.find_kernel`; 'exact' by default for methods that call a kernel.
    parameters
        Values of the method's parameters; words are converted to the type of the default.

    Raises
    ------
    InputError
        For an unknown method, kernel or parameter (the nearest is named), a value of the wrong type, and a method of
        one's own that cannot be loaded.
    """
    method = method if isinstance(method, str) else _function_name(method)
    try:
        record = find_method(method)
    except MethodError as error:
        raise InputError(str(error)) from error
    if not record.uses_kernel and kernel is not None:
        raise InputError(f"method {method}: got the kernel {kernel!r}, but this method calls no kernel: leave it out")
    if record.uses_kernel:
        kernel = kernel or "exact"
        find_kernel(kernel)
    values = [(name, _converted(record, name, value)) for name, value in (parameters or {}).items()]
    return Configuration(method, kernel, tuple(values))


def chosen_configurations(methods: Sequence[str]) -> tuple[Configuration, ...]:
    """Return the standard configurations of some methods, and the defaults of a method that has none."""
    found: list[Configuration] = []
    for method in methods:
        checked = configuration(method)
        found += [one for one in STANDARD if one.method == method] or [checked]
    return tuple(found)


def parse_settings(settings: Sequence[str]) -> dict[str, str]:
    """Return the mapping of 'NAME=VALUE' words."""
    pairs = {}
    for setting in settings:
        name, separator, value = setting.partition("=")
        if not separator or not name or not value:
            raise InputError(f"--set: got {setting!r}, wanted NAME=VALUE, for example steps=100")
        pairs[name.strip()] = value.strip()
    return pairs


def prepared(scene: Scene, chosen: Configuration) -> FrameRenderer:
    """Return the frame renderer of a configuration for a scene."""
    kernel = find_kernel(chosen.kernel) if chosen.kernel else None
    return frame_renderer(scene, find_method(chosen.method), kernel=kernel, **dict(chosen.parameters))


def _function_name(function: Callable[..., Any]) -> str:
    """Return 'module:function', by which it can be found again."""
    name = f"{getattr(function, '__module__', '')}:{getattr(function, '__qualname__', '')}"
    found: Any = sys.modules.get(getattr(function, "__module__", None) or "")
    for part in getattr(function, "__qualname__", "").split("."):
        found = getattr(found, part, None)
    if not callable(function) or found is not function:
        raise InputError(
            f"method: got {function!r}, wanted a name or a function at the top of a module: give it a name there"
        )
    return name


def _converted(record, name: str, value: Any) -> int | float | str:
    if name not in record.parameters:
        known = ", ".join(record.parameters) or "none"
        raise InputError(
            f"method {record.name}: got a parameter {name!r}, wanted one of: {known}" + nearest(name, record.parameters)
        )
    default = record.parameters[name]
    if isinstance(default, bool):
        word = str(value).strip().lower()
        if word not in _TRUE + _FALSE:
            raise InputError(f"method {record.name}: {name} got {value!r}, wanted true or false")
        return word in _TRUE
    if isinstance(default, float):
        try:
            return float(value)
        except (TypeError, ValueError):
            raise InputError(f"method {record.name}: {name} got {value!r}, wanted a number") from None
    if isinstance(default, int):
        try:
            # int() would cut off what stands behind the point, and take True for 1.
            if isinstance(value, float | bool):
                raise TypeError
            return int(value)
        except (TypeError, ValueError):
            raise InputError(f"method {record.name}: {name} got {value!r}, wanted a whole number") from None
    return str(value)
