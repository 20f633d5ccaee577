# SPDX-License-Identifier: BSD-3-Clause
"""Arguments of the public functions, from Python and from the command line, and the one
exception that they raise.

A type has two meanings. For a reader and for mypy it describes arguments from Python. At run time
it describes arguments of a command line, a word or several, from which `reports.commands.main`
makes the command of a function.
"""

import functools
import os
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from numbers import Integral
from pathlib import Path
from typing import TYPE_CHECKING, Any, ParamSpec, TypeAlias, TypeVar

from airlight.errors import InputError
from airlight.realtime.errors import NoDriverError
from airlight.reports.machine.progress import progress_bar

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from airlight.reference.scene.model import Model
    from airlight.reference.storage.exr import Image
    from airlight.reports.api.results import LayeredImage
    from airlight.validation.scenes.loading import LoadedScene
    from airlight.validation.study.configuration import Configuration

    #: A built-in name, random:SEED, the path of a Mitsuba XML or pbrt file, a Mitsuba dictionary, an
    #: `mi.Scene`, or what `load_scene` returned.
    SceneLike: TypeAlias = str | os.PathLike[str] | Mapping[str, Any] | LoadedScene | Any
    Scenes: TypeAlias = SceneLike | Sequence[SceneLike]
    #: A name, 'module:function', 'file.py:function', a function, or a method with
    #: its kernel and parameters.
    MethodLike: TypeAlias = str | Callable[..., Any] | Configuration
    Methods: TypeAlias = MethodLike | Sequence[MethodLike]
    #: A name, such a name with '-N', 'module:function', or a function at the top of a module.
    KernelLike: TypeAlias = str | Callable[..., Any]
    Kernels: TypeAlias = KernelLike | Sequence[KernelLike]
    #: Width and height [pixels], or both as 'WxH'.
    Size: TypeAlias = tuple[int, int] | str
    #: Called with (fraction done, what); True shows a bar on the error stream, None nothing.
    Progress: TypeAlias = Callable[[float, str], None] | bool | None
    #: A result of `render` or `reference`, the path of an EXR file, layers that were
    #: read from one, or an array.
    ImageLike: TypeAlias = LayeredImage | Image | str | os.PathLike[str] | ArrayLike
    #: Pixels that may take part, (height, width) of truth values, or an EXR file that is
    #: 0 in those to leave out.
    Mask: TypeAlias = ArrayLike | str | os.PathLike[str]
    #: A preset of `airlight list models`, its parameters, or terms, as words; or a model.
    ModelLike: TypeAlias = Model | str
    #: Values by name, or words NAME=VALUE.
    Values: TypeAlias = Mapping[str, Any] | Sequence[str] | str
    Words: TypeAlias = str | Sequence[Any]
    File: TypeAlias = str | os.PathLike[str]
    Files: TypeAlias = File | Sequence[File]
else:
    SceneLike = MethodLike = KernelLike = ModelLike = Size = ImageLike = Words = str
    Scenes = Methods = Kernels = Values = Sequence[str]
    Progress = bool
    Mask = File = Path
    Files = Sequence[Path]

_P = ParamSpec("_P")
_R = TypeVar("_R")


def one_error(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Let a function raise MissingError, which says what to install, where
    no driver draws shaders.
    """

    @functools.wraps(function)
    def wrapped(*arguments: _P.args, **named: _P.kwargs) -> _R:
        try:
            return function(*arguments, **named)
        except NoDriverError as error:
            from airlight.reports.machine.opengl import missing

            raise missing(str(error)) from error

    return wrapped


def with_kernels(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Let a function begin where Mitsuba has its variant, and raise our own exceptions."""

    @functools.wraps(function)
    def wrapped(*arguments: _P.args, **named: _P.kwargs) -> _R:
        from airlight.reports.machine.environment import activate

        activate()
        return function(*arguments, **named)

    return one_error(wrapped)


def several(things: Any) -> list[Any]:
    """Return one or several as a list, nothing for None."""
    if things is None:
        return []
    return list(things) if isinstance(things, list | tuple) else [things]


def whole_numbers(**given: Any) -> None:
    """Refuse values that are no whole numbers, by their names; None stands for no value."""
    for name, value in given.items():
        if value is not None and not isinstance(value, Integral):
            raise InputError(f"{name}: got {value!r}, expected a whole number")


def exclude(option: str, why: str, beside: Mapping[str, Any]) -> None:
    """Refuse options that were given beside one that excludes them."""
    given = [name for name, value in beside.items() if _is_given(value)]
    if given:
        raise InputError(f"{option}: {why}; leave out {', '.join(given)}")


def _is_given(value: Any) -> bool:
    """Return whether an option has a value other than None, False and an empty list;
    arrays have no truth value.
    """
    return (
        value is not None
        and value is not False
        and not (isinstance(value, list | tuple) and not value)
    )


def output_files(output: Any, *endings: str) -> list[Path]:
    """Return the files to write, once each is known to have an ending, such as '.png
    (a picture)', and a place.
    """
    from airlight.reference.storage.files import ensure_writable

    files = [Path(path) for path in several(output)]
    for path in files:
        # The suffix decides the format: an unknown one has none.
        if endings and path.suffix.lower() not in [words.split()[0] for words in endings]:
            raise InputError(
                f"output: got {str(path)!r}, expected a name that ends in {' or '.join(endings)}"
            )
        # A run of an hour must not fail when it writes its result.
        ensure_writable(path)
    return files


def listed(name: str, words: Any) -> list[str]:
    """Return the words of a list, or of a text with commas between them; none may be empty."""
    # A command line has one text, Python may also give a list.
    parts = words.split(",") if isinstance(words, str) else [str(word) for word in words]
    parts = [part.strip() for part in parts]
    if not all(parts):
        raise InputError(
            f"{name}: got {words!r}, expected names with commas between them, none of them empty"
        )
    return parts


def pixels_of(size: Any) -> tuple[int, int] | None:
    """Return two whole numbers or 'WxH' as width and height [pixels], None for None."""
    # WxH is parsed where scenes are loaded, which has its messages.
    if size is None or isinstance(size, str):
        from airlight.validation.scenes.loading import parse_size

        return None if size is None else parse_size(size)
    try:
        # Two values, each whole: 640.0 passes, 640.5 and a single number do not.
        width, height = size
        if not (int(width) == width and int(height) == height):
            raise ValueError
    except (TypeError, ValueError, OverflowError):
        raise InputError(
            f"size: got {size!r}, expected (width, height) in pixels, for example (800, 600)"
        ) from None
    return int(width), int(height)


def changes_of(change: Any) -> dict[str, tuple[float, ...]]:
    """Return the changes of a scene by name."""
    from airlight.validation.scenes.changes import parse_changes

    # A mapping is written as words, so that Python and the command line share one parser and its
    # messages.
    if isinstance(change, Mapping):
        change = [f"{name}={_numbers(value)}" for name, value in change.items()]
    return parse_changes(several(change))


def chosen_model(model: Any) -> "Model | None":
    """Return a model, from words or as it is given; None where none is."""
    from airlight.reference.scene.model import Model
    from airlight.validation.scenes.models import model_of

    if model is None or isinstance(model, Model):
        return model
    if not isinstance(model, str):
        raise InputError(
            f"model: got {model!r}, expected words such as 'playcanvas:range=8', or airlight.Model"
        )
    return model_of(model)


def _numbers(value: Any) -> str:
    return ",".join(map(str, value)) if isinstance(value, list | tuple) else str(value)


def kernel_name(kernel: Any) -> str | None:
    """Return the name of a kernel; of a function at the top of a module
    'module:function', which imports it again.
    """
    if kernel is None or isinstance(kernel, str):
        return kernel
    module, name = getattr(kernel, "__module__", ""), getattr(kernel, "__qualname__", "")
    # Other processes import the kernel by this name: a lambda or a function inside a function
    # cannot be imported.
    if not callable(kernel) or getattr(sys.modules.get(module), name, None) is not kernel:
        raise InputError(
            f"kernel: got {kernel!r}, expected a name or a function at the top of a module: give "
            "it a name there"
        )
    return f"{module}:{name}"


def configuration_of(method: Any, kernel: Any, parameters: Any) -> "Configuration":
    """Return a configuration of a method, or the one that is given, which excludes
    a kernel and parameters.
    """
    from airlight.validation.study.configuration import Configuration, configuration

    if not isinstance(method, Configuration):
        return configuration(method, kernel_name(kernel), parameters or {})
    # Parameters count as given by their names, whatever their values are, 0 and None included.
    beside = {"kernel": kernel, **dict.fromkeys(parameters or (), True)}
    exclude("method", "a configuration has its own kernel and parameters", beside)
    return method


@contextmanager
def telling(progress: Any, title: str) -> Iterator[Callable[[float, str], None]]:
    """Yield a function (fraction done, what) that calls `progress`, shows a bar for True,
    or does nothing for None.
    """
    # The command line shows a bar; a caller from Python gets the numbers.
    if progress is True:
        with progress_bar(title) as callback:
            yield callback
    else:
        yield progress if callable(progress) else lambda fraction, what: None


def note(progress: Any, notes: Sequence[str]) -> None:
    """Say on the error stream what a user should know before the work begins,
    where a bar may be shown too.
    """
    if progress is True:
        for words in notes:
            print(f"airlight: note: {words}", file=sys.stderr)
