# SPDX-License-Identifier: BSD-3-Clause
"""A user's own method, named 'module:function' or 'path/to/file.py:function'.

The signature of the function decides: a keyword `kernel` means that it calls a kernel; other
keywords are parameters, with the types of their defaults. The result is checked, because nothing
else checks it. See docs/your-method.md.

It is not frozen unless its author says that it can be: a frozen function that copies NumPy's arrays
in or reads values out ends the process (Dr.Jit 1.5). Tracing `unshadowed` again for every frame
costs 0.3 ms (2 threads).

The result is converted to a colour for every pixel, or refused.
"""

import importlib
import importlib.machinery
import importlib.util
import inspect
import os
import sys
import traceback
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, fields, make_dataclass, replace
from pathlib import Path
from types import ModuleType
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from airlight.errors import InputError
from airlight.realtime.errors import root_of
from airlight.realtime.methods.interface.method import Layers, Method, View, no_state
from airlight.realtime.parameters import values
from airlight.realtime.scene.light_table import lights_apart

_WANTED = "expected 'module:function' or 'path/to/file.py:function'"
_TYPES = (bool, int, float, str)
_BESIDE = "__airlight_beside__"  # in a module that lies beside a file of the user's: the folder


def user_method(name: str) -> type[Method]:
    """Return a user's own method.

    Parameters
    ----------
    name
        'module:function', the current folder first on the path, or 'path/to/file.py:function'. The
        object may also be a class derived from `Method`; what it returns is checked.

    Raises
    ------
    InputError
        For what cannot be imported, is not there or is no function, a function that no frame can
        call, and a parameter with the name of a member of `Method`.
    """
    target = user_object(name, "method")
    # A class of `Method` brings its own parameters and members; only its errors and results are
    # guarded.
    if isinstance(target, type) and issubclass(target, Method):
        check_names(name, (item.name for item in fields(target)), Method)
        return _guarded(target, name)
    if isinstance(target, type) or not callable(target):
        kind = "class" if isinstance(target, type) else type(target).__name__
        raise InputError(
            f"method {name}: this is a {kind}; expected a function of the view, or a class of "
            "airlight.Method"
        )
    return _of_function(target, name)


def check_names(method: str, names: Iterable[str], kind: type[Method]) -> None:
    """Refuse parameters of a user's method that would overwrite a member of its class.

    Parameters
    ----------
    method
        The name of the method, for messages.
    names
        The names of its parameters.
    kind
        The class that the method is made from.

    Raises
    ------
    InputError
        For a name that the class has.
    """
    taken = sorted(set(names) & set(dir(kind)))
    if taken:
        raise InputError(
            f"method {method}: a parameter cannot be called {taken[0]}, a name that frames use; "
            "rename it"
        )


def _of_function(function: Any, name: str) -> type[Method]:
    """Return a plain function of the view as a method."""
    takes_kernel, parameters = _signature(function, name)
    check_names(name, parameters, Method)
    # Keywords become fields of a class: commands set them as those of built-in methods.
    items = [(key, type(default), field(default=default)) for key, default in parameters.items()]
    # Attributes of the function say the rest: the facts below, and `prepare`, which is called once
    # for a scene and returns the function that makes the state of each frame.
    prepare = getattr(function, "prepare", None)
    if prepare is not None and not callable(prepare):
        raise InputError(
            f"method {name}: its `prepare` is a {type(prepare).__name__}; expected a function of "
            "the scene"
        )

    def preparation(self, scene):
        if prepare is None:
            return no_state
        with user_errors(f"method {name}", _file(prepare)):
            make_state = prepare(scene, **values(self))
        if not callable(make_state):
            raise InputError(
                f"method {name}: `prepare` returned a {type(make_state).__name__}; expected a "
                "function of the scene"
            )

        # Both calls of the author's code have their errors named, in the file of `prepare`.
        def run(now):
            with user_errors(f"method {name}", _file(prepare)):
                return make_state(now)

        return run

    def render(self, view, state, kernel):
        # The function has the state as `view.prepared`, and a kernel where it takes one.
        given = values(self) | ({"kernel": kernel} if takes_kernel else {})
        with user_errors(f"method {name}", _file(function)):
            returned = function(replace(view, prepared=state), **given)
        return Layers(checked_radiance(returned, view, name))

    what = {
        "name": name,
        "summary": _summary(function),
        "source": _file(function) or "the user",
        "uses_kernel": takes_kernel,
        "casts_rays": True,
        # A frame is recorded only if the author says that it can be.
        "frozen": bool(getattr(function, "frozen", False)),
        "by_rays": bool(getattr(function, "by_rays", False)),
        "shadows": bool(getattr(function, "shadows", True)),
        "noisy": bool(getattr(function, "noisy", False)),
        "preparation": preparation,
        "render": render,
    }
    return make_dataclass("UserMethod", items, bases=(Method,), frozen=True, namespace=what)


def _guarded(method: type[Method], name: str) -> type[Method]:
    """Return a user's class with its errors named and its results checked."""
    file = _file(method.render)

    def render(self, view, state, kernel):
        with user_errors(f"method {name}", file):
            returned = method.render(self, view, state, kernel)
        return checked_layers(returned, view, name, visibility=self.provides_visibility)

    return dataclass(frozen=True)(
        type(method.__name__, (method,), {"name": name, "render": render})
    )


def method_file(name: str) -> Path | None:
    """Return the file of a user's own method without running it; None if it has
    none, or cannot be found.
    """
    module_name = name.rpartition(":")[0]
    # From the cheapest to the costliest: the path itself, a module that is loaded, a search along
    # the path, package by package, which runs no code of theirs.
    if _is_file(module_name):
        return Path(module_name)
    loaded_file = getattr(sys.modules.get(module_name), "__file__", None)
    if loaded_file is not None:
        return Path(loaded_file)
    places: list[str] | None = [os.getcwd(), *sys.path]
    spec = None
    for number, part in enumerate(module_name.split(".")):
        whole = ".".join(module_name.split(".")[: number + 1])
        spec = (
            importlib.machinery.PathFinder.find_spec(whole, places)
            if part and places is not None
            else None
        )
        places = None if spec is None else spec.submodule_search_locations
    return Path(spec.origin) if spec is not None and spec.origin else None


def _is_file(module_name: str) -> bool:
    return module_name.endswith(".py") or os.sep in module_name


def user_object(name: str, kind: str) -> Any:
    """Import a module or a file of the user's, and return the object in it; `kind`
    says in messages what it is.

    Raises
    ------
    InputError
        For what cannot be imported, or is not there.
    """
    # The last colon parts file and object: a path may have one too.
    module_name, _, path = name.rpartition(":")
    if not module_name or not all(part.isidentifier() for part in path.split(".")):
        raise InputError(f"{kind}: got {name!r}, {_WANTED}")
    what = f"{kind} {name}"
    with user_errors(what):
        module = (
            _from_file(Path(module_name), what)
            if _is_file(module_name)
            else _from_path(module_name, what)
        )
    named_object: Any = module
    # The object may lie in a class: 'module:Class.method'.
    for part in path.split("."):
        if not hasattr(named_object, part):
            candidates = [
                key for key, value in vars(module).items() if _is_candidate(value, module)
            ]
            hint = (
                f"it has {', '.join(candidates)}"
                if candidates
                else "it has no functions of its own"
            )
            raise InputError(f"{what}: {module_name} has no {path!r}; {hint}")
        named_object = getattr(named_object, part)
    return named_object


@contextmanager
def _imports_from(folder: str) -> Iterator[None]:
    """Within the block, a folder is the first on the path, and imports write
    no `__pycache__` into it.
    """
    before = sys.dont_write_bytecode
    sys.dont_write_bytecode = True
    sys.path.insert(0, folder)
    try:
        yield
    finally:
        sys.path.remove(folder)
        sys.dont_write_bytecode = before


def _is_candidate(value: Any, module: ModuleType) -> bool:
    if isinstance(value, type) and issubclass(value, Method):
        return value.__module__ == module.__name__
    return (
        inspect.isfunction(value)
        and value.__module__ == module.__name__
        and not value.__name__.startswith("_")
    )


def _from_path(module_name: str, what: str) -> ModuleType:
    """Import a module, the current folder first on the path: the console script's own
    folder stands there otherwise.
    """
    if not all(part.isidentifier() for part in module_name.split(".")):
        raise InputError(f"{what}: no module can have the name {module_name!r}; {_WANTED}")
    folder = os.getcwd()
    try:
        with _imports_from(folder):
            importlib.invalidate_caches()
            return importlib.import_module(module_name)
    except ModuleNotFoundError as error:
        missing = error.name or ""
        if missing and f"{module_name}.".startswith(f"{missing}."):
            raise InputError(
                f"{what}: there is no module {missing!r} in {folder} or installed; {_WANTED}"
            ) from None
        raise


def _from_file(path: Path, what: str) -> ModuleType:
    """Import a file under a name of its own, again if it or a module that it imported from its
    folder has changed since, as in a notebook.
    """
    if not path.is_file():
        raise InputError(f"{what}: there is no file {path}; {_WANTED}")
    # A file is loaded again when its time or size has changed, or that of a neighbour: in a
    # notebook the author edits them between frames.
    place = path.resolve()
    key = f"airlight_own_{place.stem}_{abs(hash(str(place))):x}"
    loaded = sys.modules.get(key)
    known: dict[Path, Any] = {} if loaded is None else loaded.__dict__["__airlight_stamps__"]
    if loaded is not None and known and all(_stamp(file) == known[file] for file in known):
        return loaded
    spec = importlib.util.spec_from_file_location(key, place)
    if spec is None or spec.loader is None:
        raise InputError(f"{what}: {path} is not a Python file; {_WANTED}")
    module = importlib.util.module_from_spec(spec)
    # In `sys.modules` before it runs, as imports do; a file that fails leaves nothing there.
    stamps = {place: _stamp(place)}
    module.__dict__["__airlight_stamps__"] = stamps
    sys.modules[key] = module
    _forget_neighbours(place.parent)
    before = set(sys.modules)
    try:
        with _imports_from(str(place.parent)):  # its neighbours are there for it, as if it were run
            spec.loader.exec_module(module)
    except BaseException:
        del sys.modules[key]
        raise
    finally:
        stamps |= {file: _stamp(file) for file in _marked_neighbours(place.parent, before)}
    return module


def _stamp(file: Path) -> tuple[int, int] | None:
    """Return what changes with a file; None for one that is gone."""
    try:
        status = file.stat()
    except OSError:
        return None
    return status.st_mtime_ns, status.st_size


def _marked_neighbours(folder: Path, before: set[str]) -> list[Path]:
    """Mark the modules that were imported from a folder since, and return their files."""
    files = []
    for name in set(sys.modules) - before:
        own = getattr(sys.modules[name], "__dict__", {})
        file, stem = own.get("__file__"), folder.joinpath(*name.split("."))
        if file in (f"{stem}.py", str(stem / "__init__.py")):
            own[_BESIDE] = str(folder)
            files.append(Path(file))
    return files


def _forget_neighbours(folder: Path) -> None:
    """Drop the marked modules of a folder, which may have changed, and those of other folders
    that stand for a module of this one.
    """
    for name, module in list(sys.modules.items()):
        beside = getattr(module, "__dict__", {}).get(_BESIDE)
        own = folder / name.partition(".")[0]
        if beside is not None and (
            beside == str(folder) or Path(f"{own}.py").is_file() or (own / "__init__.py").is_file()
        ):
            del sys.modules[name]


def _signature(function: Callable[..., Any], name: str) -> tuple[bool, dict[str, Any]]:
    """Return whether a function takes a kernel, and its other keywords with their defaults."""
    try:
        arguments = list(inspect.signature(function).parameters.values())
    except (TypeError, ValueError) as error:
        raise InputError(
            f"method {name}: its arguments cannot be read ({error}); expected a Python function"
        ) from error
    # The view is given by position.
    if not arguments or arguments[0].kind not in (
        inspect.Parameter.POSITIONAL_ONLY,
        inspect.Parameter.POSITIONAL_OR_KEYWORD,
    ):
        raise InputError(
            f"method {name}: it takes no view; expected function(view, *, kernel=None, "
            "**parameters)"
        )
    parameters = {}
    takes_kernel = False
    for argument in arguments[1:]:
        # *args and **kwargs stay empty; `kernel` is no parameter of the method, but says that it
        # calls one.
        if argument.kind in (inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD):
            continue
        if argument.name == "kernel":
            takes_kernel = True
        elif (
            argument.default is inspect.Parameter.empty
            or argument.kind == inspect.Parameter.POSITIONAL_ONLY
        ):
            raise InputError(
                f"method {name}: nothing gives {argument.name!r} a value; expected a keyword with "
                "a default"
            )
        # what has another type cannot be set, and keeps its default
        elif type(argument.default) in _TYPES:
            parameters[argument.name] = argument.default
    return takes_kernel, parameters


@contextmanager
def user_errors(what: str, file: str | None = None) -> Iterator[None]:
    """Turn any exception of the user's code into an `InputError` that says where it came from."""
    try:
        yield
    except InputError:  # what it refuses by name
        raise
    # The user's code may raise anything, and end the program: the author repairs that, and it is
    # never a failure of ours.
    except (Exception, SystemExit) as error:
        root = root_of(error)  # Dr.Jit wraps what is raised in the body of a loop
        words = " ".join(str(root).split())
        if isinstance(root, InputError):
            raise InputError(words) from error
        raise InputError(
            f"{what}: {_place(root, error, file)}{type(root).__name__}: {words}"
        ) from error


def _place(root: BaseException, error: BaseException, file: str | None) -> str:
    """Return 'file, line N: ' of the innermost step in the user's file, or
    of the innermost of all.
    """
    if isinstance(root, SyntaxError):
        return f"{root.filename}, line {root.lineno}: "
    steps = [
        step for raised in (error, root) for step in traceback.extract_tb(raised.__traceback__)
    ]
    # Steps of this file and of the import machinery say nothing to the author.
    outside = [
        step for step in steps if step.filename != __file__ and "importlib" not in step.filename
    ]
    inside = [step for step in outside if step.filename == file]
    chosen = inside or outside
    return f"{chosen[-1].filename}, line {chosen[-1].lineno}: " if chosen else ""


def _file(function: Any) -> str | None:
    code = getattr(inspect.unwrap(function), "__code__", None)
    return None if code is None else code.co_filename


def _summary(function: Any) -> str:
    text = inspect.getdoc(function) if inspect.isfunction(function) else None
    return text.splitlines()[0] if text else "a user method"


_RESULT = "expected the radiance of every pixel, an RGB colour or one number: a Dr.Jit array, or NumPy's (pixels, 3)"


def checked_radiance(returned: Any, view: View, name: str):
    """Return the radiance of every pixel as a colour in the precision of the view.

    Parameters
    ----------
    returned
        The result of the method `name`: a Dr.Jit colour, three-vector or number, or an array
        (pixels, 3) or (pixels,) of another kind, which goes through NumPy; one entry per pixel of
        `view`, or one for all.
    view
        The view that the method was given.
    name
        The method's name, for messages.

    Raises
    ------
    InputError
        For a result of another type or shape.
    """
    Color, Float = type(view.medium.albedo), type(view.distance)
    width = dr.width(view.pixel)
    # Dr.Jit arrays stay on the device; what else came goes through NumPy.
    channels = (
        _dr_channels(returned, name)
        if dr.is_array_v(returned)
        else _channels(returned, width, name)
    )
    for channel in channels:
        if dr.width(channel) not in (1, width):
            raise InputError(
                f"method {name}: returned {dr.width(channel)} values for {width} pixels; {_RESULT}"
            )
    # A constant has one entry: every pixel gets it.
    return Color(*(Float(channel) + dr.zeros(Float, width) for channel in channels))


def checked_layers(returned: Any, view: View, name: str, *, visibility: bool) -> Layers:
    """Return the layers of a method, their in-scattered radiance as `checked_radiance` does.

    Parameters
    ----------
    returned
        The result of the method `name`.
    view
        The view that it was given.
    name
        Its name, for messages.
    visibility
        Whether it says that it provides the visibility of its lights.

    Raises
    ------
    InputError
        For an object other than `Layers`, radiance of another type or shape, and a
        visibility that lacks a light.
    """
    if not isinstance(returned, Layers):
        raise InputError(
            f"method {name}: returned a {type(returned).__name__}; expected "
            "realtime.methods.interface.method.Layers"
        )
    fractions = () if returned.visibility is None else returned.visibility
    if not visibility and returned.visibility is not None:
        raise InputError(
            f"method {name}: returned a visibility, expected None where `provides_visibility` is "
            "False"
        )
    # One for each light, or one for all samples of each area light.
    lights, sources = (
        len(list(lights_apart(view.tables, by_source=by_source))) for by_source in (False, True)
    )
    if visibility and len(fractions) not in (lights, sources):
        expected = f"{lights}: one for each light"
        if sources != lights:
            expected += f", or {sources}: one for each light of the scene"
        raise InputError(
            f"method {name}: returned the visibility of {len(fractions)} lights, expected "
            f"{expected}"
        )
    return replace(returned, in_scattered=checked_radiance(returned.in_scattered, view, name))


def _dr_channels(returned: Any, name: str) -> tuple[Any, ...]:
    """Return the three channels of a Dr.Jit array."""
    kind = type(returned)
    if dr.is_float_v(kind) and not dr.is_special_v(kind) and not dr.is_tensor_v(kind):
        if dr.depth_v(kind) == 1:
            return (returned,) * 3
        if dr.depth_v(kind) == 2 and len(returned) == 3:
            return tuple(returned)
    raise InputError(f"method {name}: returned a {kind.__module__}.{kind.__name__}; {_RESULT}")


def _channels(returned: Any, width: int, name: str) -> tuple[Any, ...]:
    """Return the three channels of an array of another kind, or of a number."""
    try:
        values = np.asarray(returned)
        right = values.dtype.kind in "fiu"
    except (TypeError, ValueError):
        right = False
    if not right:
        raise InputError(f"method {name}: returned a {type(returned).__name__}; {_RESULT}")
    if values.ndim == 0:
        return (float(values),) * 3
    if values.shape not in ((width,), (width, 3)):
        raise InputError(
            f"method {name}: returned an array of shape {values.shape} for {width} pixels; "
            f"{_RESULT}"
        )
    # In float64, so that whole numbers and doubles lose nothing before the view's precision is
    # known.
    double = np.ascontiguousarray(values, dtype=np.float64)
    return (
        (mi.Float64(double),) * 3
        if double.ndim == 1
        else tuple(mi.Float64(column) for column in double.T.copy())
    )
