# SPDX-License-Identifier: BSD-3-Clause
"""Scenes as results of the Python API, from whatever names one."""

import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import mitsuba as mi

from airlight.errors import InputError
from airlight.reference.scene.model import Model
from airlight.reference.storage.scene_digest import build_scene
from airlight.reports.api.inputs import one_error, pixels_of
from airlight.validation.scenes.bodies import check_bodies
from airlight.validation.scenes.files.camera import lens_of
from airlight.validation.scenes.loading import LoadedScene, load_scene, name_shapes, resize
from airlight.validation.scenes.numbers import check_numbers


@dataclass(frozen=True, eq=False, repr=False)
class OpenScene(LoadedScene):
    """A scene that is ready to be rendered."""

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of its image [pixels]."""
        width, height = self.scene.sensors()[0].film().crop_size()
        return int(width), int(height)

    def plan(self) -> dict[str, str]:
        """Return the features that the scene needs, in words; raises InputError if
        no method can render it.
        """
        return dict(_described(self)[0])

    def _repr_html_(self) -> str:
        from airlight.reports.page.filters import facts
        from airlight.reports.tables.drawing import html
        from airlight.reports.tables.record import block, paragraph

        try:
            # A notebook shows a scene that no method can render too, with the reason.
            words, notes = _described(self)
        except InputError as reason:
            words, notes = {"refused": str(reason)}, ()
        known = {"size": self.size, **words, "answers to": self.published or None}
        return block(self.name, paragraph(" ".join([self.purpose, *notes])), html(facts("", known)))

    def __repr__(self) -> str:
        return "OpenScene({}, {} x {})".format(self.name, *self.size)


def opened(
    scene: Any,
    size: Any = None,
    changes: Mapping[str, tuple[float, ...]] | None = None,
    model: Model | None = None,
) -> OpenScene:
    """Return a scene at a size, its own by default; a scene that was loaded
    before is left as it is.

    A `model` stands in the place of that which the scene names.
    """
    loaded = _opened(scene, size, changes)
    return loaded if model is None else replace(loaded, model=model)


def _opened(scene: Any, size: Any, changes: Mapping[str, tuple[float, ...]] | None) -> OpenScene:
    from airlight.reports.machine.environment import activate

    activate()
    pixels = pixels_of(size)
    # A name or a path: loaded here, at the size and with the changes.
    if isinstance(scene, str | os.PathLike):
        return _as_open(load_scene(os.fspath(scene), pixels, changes or {}))
    if changes:
        raise InputError(
            "change: is for a scene by name or path; change the scene that you have loaded yourself"
        )
    # A Mitsuba dictionary is built, then resized: its film says a size too.
    if isinstance(scene, Mapping):
        return _from_dictionary(scene, pixels)
    loaded = _as_open(scene) if isinstance(scene, LoadedScene) else _from_mitsuba(scene)
    if pixels not in (None, loaded.size):
        # The user may have changed the scene since; loading it again in silence would undo that.
        raise InputError(
            "size: got {}x{} for a scene that is loaded already, at {}x{}; give its name, path or "
            "dictionary with the "
            "size, or load it at that size".format(*pixels, *loaded.size)
        )
    return loaded


def _as_open(loaded: LoadedScene) -> OpenScene:
    if isinstance(loaded, OpenScene):
        return loaded
    return OpenScene(**vars(loaded))


def _from_dictionary(scene: Mapping[str, Any], pixels: tuple[int, int] | None) -> OpenScene:
    try:
        # Mitsuba's own message, on one line.
        built = build_scene(scene)
    # Mitsuba reports every kind of bad input as a RuntimeError, Python plugins as anything
    except Exception as error:
        raise InputError(
            f"scene: Mitsuba cannot build the dictionary: {' '.join(str(error).split())}"
        ) from error
    loaded = _from_mitsuba(built)
    # A camera that was built already tells no lens.
    cameras = (each for each in scene.values() if _is_camera(each))
    camera = next(cameras, None)
    lens = lens_of(camera) if isinstance(camera, Mapping) else None
    if pixels is not None:
        resize(built, pixels, lens)
    return replace(loaded, lens=lens)


def _is_camera(part: Any) -> bool:
    return isinstance(part, mi.Sensor) or (
        isinstance(part, Mapping) and part.get("type") == "perspective"
    )


def _from_mitsuba(scene: Any) -> OpenScene:
    if not isinstance(scene, mi.Scene):
        # A scene of another variant has the same class name in another module, and this is the
        # usual mistake: it was loaded before `airlight.activate`.
        kind = type(scene)
        if kind.__name__ == "Scene" and kind.__module__.split(".")[0] == "mitsuba":
            raise InputError(
                f"scene: got a Mitsuba scene of another variant than {mi.variant()}; call "
                "airlight.activate() before "
                "you build it"
            )
        raise InputError(
            f"scene: got {kind.__name__}, expected a name, the path of a Mitsuba XML or pbrt file, "
            "a Mitsuba dictionary of the type 'scene', or a scene that is loaded"
        )
    if not scene.sensors():
        raise InputError("scene: it has no sensor; add one of the type 'perspective'")
    # A scene that Mitsuba made has passed none of the checks of files: shapes get names for changes
    # and messages, and numbers and closed bodies are checked.
    name_shapes(scene)
    check_numbers(scene)
    check_bodies(scene)
    return OpenScene("scene", scene, "The user's scene.", "")


@one_error
def _described(loaded: OpenScene) -> tuple[dict[str, str], tuple[str, ...]]:
    from airlight.realtime.scene.read_scene import describe, read_scene

    read = read_scene(loaded.scene)
    return describe(read), read.features.notes
