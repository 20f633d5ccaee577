# SPDX-License-Identifier: BSD-3-Clause
"""Arguments of the Python API (scenes, images, progress), and the one exception that its functions raise."""

import functools
import os
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ParamSpec, TypeAlias, TypeVar

from analytic.errors import InputError
from realtime.errors import InputError as RealtimeInputError
from validation.scenes.loading import LoadedScene, load_scene, name_shapes, parse_size, resize
from validation.scenes.numbers import check_numbers

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from reference.storage.exr import Image
    from reports.api.results import LayeredImage

#: A built-in name, the path of a Mitsuba XML file, a Mitsuba dictionary, an `mi.Scene`, or what `load_scene` returned.
SceneLike = str | os.PathLike[str] | Mapping[str, Any] | LoadedScene | Any
#: Width and height [pixels], or both as 'WxH'.
Size = tuple[int, int] | str
#: Called with (share done, what); True shows a bar on the error stream, None nothing.
Progress = Callable[[float, str], None] | bool | None
#: A result of `render` or `reference`, the path of an EXR file, layers that were read from one, or an array.
ImageLike: TypeAlias = "LayeredImage | Image | str | os.PathLike[str] | ArrayLike"

_P = ParamSpec("_P")
_R = TypeVar("_R")


@dataclass(frozen=True, eq=False, repr=False)
class OpenScene(LoadedScene):
    """A scene that is ready to be rendered."""

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of its image [pixels]."""
        width, height = self.scene.sensors()[0].film().crop_size()
        return int(width), int(height)

    def plan(self) -> dict[str, str]:
        """Return the features that the scene needs, in words; raises InputError if no method can render it."""
        return dict(_described(self)[0])

    def _repr_html_(self) -> str:
        from reports.api.html import block, paragraph, table

        try:
            words, notes = _described(self)
        except InputError as reason:
            words, notes = {"refused": str(reason)}, ()
        rows = [("size", "{} x {}".format(*self.size)), *words.items()]
        rows += [("answers to", self.published)] if self.published else []
        return block(self.name, paragraph(" ".join([self.purpose, *notes])), table(rows))

    def __repr__(self) -> str:
        return "OpenScene({}, {} x {})".format(self.name, *self.size)


def one_error(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Let a function raise `airlight.InputError` in place of the InputError of `realtime`."""

    @functools.wraps(function)
    def wrapped(*arguments: _P.args, **named: _P.kwargs) -> _R:
        try:
            return function(*arguments, **named)
        except RealtimeInputError as error:
            raise InputError(str(error)) from error

    return wrapped


def opened(scene: SceneLike, size: Size | None = None) -> OpenScene:
    """Return a scene at a size, its own by default; a scene that was loaded before is left as it is.

    Raises
    ------
    InputError
        If `scene` is not a scene, or is already loaded at another size.
    """
    from reports.machine.environment import activate

    activate()
    pixels = _pixels(size)
    if isinstance(scene, Mapping):
        return _from_dictionary(scene, pixels)
    if isinstance(scene, str | os.PathLike):
        return _as_open(load_scene(os.fspath(scene), pixels))
    loaded = _as_open(scene) if isinstance(scene, LoadedScene) else _from_mitsuba(scene)
    if pixels not in (None, loaded.size):
        # The user may have changed the scene since; loading it again in silence would undo that.
        raise InputError(
            "size: got {}x{} for a scene that is loaded already, at {}x{}; give its name, path or dictionary with the "
            "size, or load it at that size".format(*pixels, *loaded.size)
        )
    return loaded


def as_image(image: Any, layer: str, name: str) -> tuple["Image", str]:
    """Return layers, among them the one of that name, and what to call the image.

    Parameters
    ----------
    image
        See `ImageLike`; an array, (height, width[, 3]), becomes the layer.
    layer
        The layer that will be looked at.
    name
        What to call an image that has no name of its own.

    Raises
    ------
    InputError
        If an array is not of numbers, or a file has no such layer.
    """
    import numpy as np

    from reference.storage.exr import Image, read_exr
    from reference.storage.exr import layer as image_layer
    from reports.api.results import LayeredImage

    if isinstance(image, LayeredImage):
        return image.with_total(), image.title
    if isinstance(image, str | os.PathLike):
        read = read_exr(image)
        image_layer(read, layer, image)  # a message about a missing layer then names the file
        return read, Path(image).name
    if isinstance(image, Image):
        return image, name
    values = np.asarray(image)
    if values.dtype.kind not in "fiu":
        raise InputError(
            f"{name}: got {type(image).__name__}, wanted what render or reference return, a path, or numbers (height, "
            "width, 3)"
        )
    return Image({layer: values}), name


def kernel_name(kernel: str | Callable[..., Any] | None) -> str | None:
    """Return the name of a kernel: of a function 'module:function', by which it can be imported again.

    Raises
    ------
    InputError
        If it is neither a name nor a function at the top of a module.
    """
    if kernel is None or isinstance(kernel, str):
        return kernel
    module, name = getattr(kernel, "__module__", ""), getattr(kernel, "__qualname__", "")
    if not callable(kernel) or getattr(sys.modules.get(module), name, None) is not kernel:
        raise InputError(
            f"kernel: got {kernel!r}, wanted a name or a function at the top of a module: give it a name there"
        )
    return f"{module}:{name}"


@contextmanager
def telling(progress: Progress, title: str) -> Iterator[Callable[[float, str], None]]:
    """Yield a function (share done, what) that calls `progress`, or does nothing where it is None."""
    if progress is True:
        from reports.machine.progress import progress_bar

        with progress_bar(title) as callback:
            yield callback
    elif callable(progress):
        yield progress
    else:
        yield lambda share, what: None


def _pixels(size: Size | None) -> tuple[int, int] | None:
    if size is None or isinstance(size, str):
        return None if size is None else parse_size(size)
    try:
        width, height = size
        if not (int(width) == width and int(height) == height):
            raise ValueError
    except (TypeError, ValueError):
        raise InputError(f"size: got {size!r}, wanted (width, height) in pixels, for example (800, 600)") from None
    return int(width), int(height)


def _as_open(loaded: LoadedScene) -> OpenScene:
    if isinstance(loaded, OpenScene):
        return loaded
    return OpenScene(loaded.name, loaded.scene, loaded.purpose, loaded.published, loaded.path, loaded.animation)


def _from_dictionary(scene: Mapping[str, Any], pixels: tuple[int, int] | None) -> OpenScene:
    import mitsuba as mi

    try:
        built = mi.load_dict(dict(scene))
    except Exception as error:  # Mitsuba reports every kind of bad input as a RuntimeError, Python plugins as anything
        raise InputError(f"scene: Mitsuba cannot build the dictionary: {' '.join(str(error).split())}") from error
    loaded = _from_mitsuba(built)
    if pixels is not None:
        resize(built, pixels)
    return loaded


def _from_mitsuba(scene: Any) -> OpenScene:
    import mitsuba as mi

    if not isinstance(scene, mi.Scene):
        kind = type(scene)
        if kind.__name__ == "Scene" and kind.__module__.split(".")[0] == "mitsuba":
            raise InputError(
                f"scene: got a Mitsuba scene of another variant than {mi.variant()}; call airlight.activate() before "
                "you build it"
            )
        raise InputError(
            f"scene: got {kind.__name__}, wanted a name, the path of a Mitsuba XML file, a Mitsuba dictionary of the "
            "type 'scene', or a scene that is loaded"
        )
    if not scene.sensors():
        raise InputError("scene: it has no sensor; add one of the type 'perspective'")
    name_shapes(scene)
    check_numbers(scene)
    return OpenScene("scene", scene, "The user's own scene.", "")


@one_error
def _described(loaded: OpenScene) -> tuple[dict[str, str], tuple[str, ...]]:
    from realtime.scene.features import describe
    from realtime.scene.read_scene import read_scene

    features = read_scene(loaded.scene).features
    return describe(features), features.notes
