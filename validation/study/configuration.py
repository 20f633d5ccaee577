# SPDX-License-Identifier: BSD-3-Clause
"""Configurations: a method with a kernel and the values of its parameters, by the
names that a user gives.

A kernel is named 'quadrature', 'quadrature-32', or as a user's
'module:function' or 'file.py:function'.
"""

import hashlib
import sys
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import wraps
from pathlib import Path

from airlight.errors import InputError, nearest
from airlight.realtime.frame.renderer import FrameRenderer, frame_renderer
from airlight.realtime.kernels.registry import KERNELS, Kernel
from airlight.realtime.methods.interface.method import method_parameters
from airlight.realtime.methods.registry import find_method
from airlight.realtime.methods.shader.source import is_shader, is_users, read_shader
from airlight.realtime.methods.user_method import method_file, user_errors, user_object
from airlight.realtime.parameters import values
from airlight.realtime.scene.read_scene import Scene
from airlight.reference.storage.code import code_digest
from airlight.reference.storage.store import Content
from airlight.validation.readers import named_values
from airlight.validation.study.cost import TIMED, Work, frame_work

#: Values of a method's parameters by name; words are converted to the type of the default.
Parameters = Mapping[str, int | float | str]


@dataclass(frozen=True)
class Configuration:
    """A method, its kernel (None if it calls none) and the parameters that
    differ from their defaults.
    """

    method: str  #: name in the registry, or of a user's as 'module:function' or 'fog.glsl'
    kernel: str | None = None  #: see `find_kernel`
    parameters: tuple[tuple[str, int | float | str], ...] = ()  #: names and values

    @property
    def label(self) -> str:
        """The name of the configuration in tables, plots and files."""
        values = [f"{name}={value}" for name, value in self.parameters]
        inside = ", ".join(([self.kernel] if self.kernel else []) + values)
        return f"{self.method} ({inside})" if inside else self.method

    @property
    def own(self) -> bool:
        """Whether the method or its kernel is the user's, named 'module:function' or 'fog.glsl'."""
        return is_users(self.method) or is_users(self.kernel or "")


_NAMED = tomllib.loads(
    (Path(__file__).parent / "studies" / "methods.toml").read_text(encoding="utf-8")
)


def named_configurations(word: str) -> tuple[Configuration, ...]:
    """Return the configurations that `studies/methods.toml` has under a word."""
    configurations = []
    for table in _NAMED[word]:
        # Parameters that several configurations share have a name in the file.
        parameters = table.get("parameters", {})
        if isinstance(parameters, str):
            parameters = _NAMED[parameters]
        configurations.append(
            Configuration(table["method"], table.get("kernel"), tuple(parameters.items()))
        )
    return tuple(configurations)


#: see `studies/methods.toml`
STANDARD, QUICK = named_configurations("standard"), named_configurations("quick")
#: parameters of `soft-shafts`, beyond Ali 2016
SHARED_POINTS: Parameters = _NAMED["shared_points"]


def configuration(
    method: str | Callable[..., object],
    kernel: str | None = None,
    parameters: Parameters | None = None,
) -> Configuration:
    """Return a configuration, checked.

    Parameters
    ----------
    method
        A name of `METHODS`, a user's method as 'module:function', 'path/to/file.py:function' or
        'path/to/file.glsl', or a function itself.
    kernel
        A name of `KERNELS`, 'name-N' for the size N, or a user's as 'module:function';
        'exact' by default for methods that call a kernel.
    parameters
        Parameters of the method by name.

    Raises
    ------
    InputError
        For an unknown method, kernel or parameter (the nearest is named), a value of the wrong type
        or outside its range, values that contradict one another, and a user's method that cannot be
        loaded.
    """
    method = method if isinstance(method, str) else _function_name(method)
    chosen, light_samples = method_parameters(find_method(method), parameters or {})
    uses_kernel = chosen.uses_kernel
    if not uses_kernel and kernel is not None:
        raise InputError(
            f"method {method}: got the kernel {kernel!r}, but this method calls no kernel: leave "
            "it out"
        )
    if uses_kernel:
        kernel = kernel or "exact"
        find_kernel(kernel)
    checked = values(light_samples) | values(chosen)
    return Configuration(method, kernel, tuple((name, checked[name]) for name in parameters or {}))


def chosen_configurations(methods: Sequence[str] | None = None) -> tuple[Configuration, ...]:
    """Return the standard configurations of some methods, of all of them by default.

    A method without any for every scene has its defaults too.
    """
    chosen: list[Configuration] = []
    for method in dict.fromkeys(each.method for each in STANDARD) if methods is None else methods:
        default = configuration(method)
        standard = [each for each in STANDARD if each.method == method]
        everywhere = any("points" not in dict(each.parameters) for each in standard)
        chosen += standard if everywhere else [default, *standard]
    return tuple(chosen)


def parse_settings(settings: Sequence[str]) -> dict[str, str]:
    """Return values by name from words of the form 'NAME=VALUE'."""
    return named_values("--set", settings, str, "NAME=VALUE, for example steps=100")


def prepared(scene: Scene, chosen: Configuration, *, extra_layers: bool = False) -> FrameRenderer:
    """Return the frame renderer of a configuration for a scene;
    `extra_layers` as of `frame_renderer`.

    Raises InputError if the method refuses, and for a kernel that has no effect in the scene.
    """
    kernel = find_kernel(chosen.kernel) if chosen.kernel else None
    if has_idle_kernel(scene, chosen):
        raise InputError(
            f"kernel: got {chosen.kernel}, which has no effect where all lights are suns; expected "
            "exact, the default"
        )
    return frame_renderer(
        scene,
        find_method(chosen.method),
        kernel=kernel,
        extra_layers=extra_layers,
        **dict(chosen.parameters),
    )


def has_idle_kernel(scene: Scene, chosen: Configuration) -> bool:
    """Return whether a kernel was chosen that has no effect: all lights are suns, whose airlight no
    kernel integrates. A user's method may do anything with it.
    """
    if not chosen.kernel or is_users(chosen.method) or find_kernel(chosen.kernel).exact:
        return False
    return bool(scene.lights) and not (scene.area_lights or any(each.w for each in scene.lights))


def rendered_lights(scene: Scene, chosen: Configuration) -> int:
    """Return how many lights a method renders in a scene, the points of area lights among them.

    A user's module is not imported for it: its method counts as one that has the points of others.
    """
    method = find_method("unshadowed" if is_users(chosen.method) else chosen.method)
    points = dict(chosen.parameters).get("points", method.light_samples.points)
    return len(scene.lights) + int(points) * len(scene.area_lights)


def configuration_work(scene: Scene, chosen: Configuration, frames: float = TIMED) -> Work:
    """Return the work of some frames of a configuration at the size of a scene's image."""
    parameters, steps = dict(chosen.parameters), 0.0
    if chosen.method == "ray-march" or "steps" in parameters:
        steps = float(parameters.get("steps", 100))
    size = scene.camera.width, scene.camera.height
    return frame_work(size, lights=rendered_lights(scene, chosen), steps=steps, frames=frames)


def _function_name(function: Callable[..., object]) -> str:
    """Return 'module:function', the name by which a function can be imported again."""
    name = f"{getattr(function, '__module__', '')}:{getattr(function, '__qualname__', '')}"
    # The name must lead back to the function: it does not for one within another function.
    found_by_name: object = sys.modules.get(getattr(function, "__module__", None) or "")
    for part in getattr(function, "__qualname__", "").split("."):
        found_by_name = getattr(found_by_name, part, None)
    if not callable(function) or found_by_name is not function:
        raise InputError(
            f"method: got {function!r}, expected a name or a function at the top of a module: give "
            "it a name there"
        )
    return name


def find_kernel(name: str) -> Kernel:
    """Return the kernel of a name.

    The name is one of `realtime.kernels.registry.KERNELS`, 'name-N' for the same kernel with its
    first parameter set to the whole number N, or a user's, 'module:function' or
    'path/to/file.py:function'. An unknown one is refused with the nearest.
    """
    if ":" in name:
        return _imported(name)
    record, size = split_name(name)
    return record if size is None else record.of_size(size)


def split_name(name: str) -> tuple[Kernel, int | None]:
    """Return the record of a kernel, and the N of 'name-N' or None for a plain name."""
    if name in KERNELS:
        return KERNELS[name], None
    base, separator, digits = name.rpartition("-")
    if not (separator and base in KERNELS and digits.isascii() and digits.isdecimal()):
        raise InputError(
            f"kernel: got {name!r}, expected one of {', '.join(KERNELS)}, such a name with '-N', "
            "or 'module:function'" + nearest(name, KERNELS)
        )
    record = KERNELS[base]
    if not record.parameters:
        raise InputError(
            f"kernel: got {name!r}, but {base!r} has no parameter to set: leave '-{digits}' out"
        )
    return record, int(digits)


def sized(name: str, size: int | None) -> str:
    """Return 'name-N' for a size N, or the plain name for None."""
    return name if size is None else f"{name}-{size}"


def _imported(name: str) -> Kernel:
    function = user_object(name, "kernel")
    if not callable(function):
        raise InputError(f"kernel {name}: it is a {type(function).__name__}; expected a function")

    @wraps(function)
    def guarded(*arguments: object) -> object:
        with user_errors(f"kernel {name}"):
            return function(*arguments)

    return Kernel(name, guarded)


def user_code(chosen: Configuration) -> tuple[Content, ...]:
    """Return digests of the user's code in a configuration, with the modules of
    its folder that it imports.
    """
    names = [name for name in (chosen.method, chosen.kernel) if name is not None and is_users(name)]
    return tuple(Content(_user_digest(name)) for name in names)


def _user_digest(name: str) -> str | None:
    if is_shader(name):
        digest = hashlib.sha256()
        for each in read_shader(Path(name)).files:
            digest.update(each.read_bytes() + bytes(1))
        return digest.hexdigest()
    file = method_file(name)
    # A function typed into a notebook has no file, so its results cannot be cached.
    return code_digest([file]) if file is not None and file.is_file() else None
