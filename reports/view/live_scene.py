# SPDX-License-Identifier: BSD-3-Clause
"""A scene that changes from frame to frame, of which only changed parts are made again; its
stages timed one by one.

Camera, lights and media are opaque arrays, so their changes record nothing. A configuration has its
own recorded functions: they are kept for the last few configurations, which share the functions
that cast and shade. These depend on a method only in whether it finds out which surfaces are lit.
Hits of camera rays are kept while the camera stands still.
"""

from collections import OrderedDict
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import drjit as dr

from airlight.analytic.clock import stopwatch
from airlight.errors import InputError
from airlight.realtime.frame.image import Frame, image_frame
from airlight.realtime.frame.incremental import FrameCache, next_frame
from airlight.realtime.frame.renderer import FrameRenderer
from airlight.realtime.methods.registry import find_method
from airlight.realtime.methods.shader.method import Shader
from airlight.realtime.parameters import defaults
from airlight.realtime.scene.read_scene import describe, read_again, read_scene
from airlight.validation.clock import timed
from airlight.validation.scenes.changes import Values, change_scene, changeable, isotropic_media
from airlight.validation.scenes.loading import load_scene
from airlight.validation.study.configuration import Configuration, configuration, prepared

#: The `Stages` of a frame, in their order, and what the page calls them.
WORDS = {
    "prepare": "shadow maps or planes",
    "surface": "camera rays and surface",
    "shade": "surface, rays cached",
    "render": "airlight",
}


def timed_stages(renderer: FrameRenderer) -> tuple[FrameRenderer, dict[str, float]]:
    """Return a renderer that does the same, and a dictionary that its next frame fills with
    the time of stages [ms].
    """
    times: dict[str, float] = {}

    timed: dict[str, Any] = {
        name: _clocked(name, getattr(renderer.stages, name), times) for name in WORDS
    }
    return replace(renderer, stages=replace(renderer.stages, **timed)), times


def _clocked(name: str, stage: Callable[..., Any], times: dict[str, float]) -> Callable[..., Any]:
    def clocked(*arguments):
        def work():
            result = stage(*arguments)
            if name != "prepare":  # whose states need not be arrays alone
                dr.eval(result)
            return result

        # Work of the stage before must not count for this one.
        dr.sync_thread()
        result, took = timed(work)
        times[name] = times.get(name, 0.0) + took.ms
        return result

    return clocked


@dataclass(frozen=True)
class Shown:
    """A frame on the device, and what it cost."""

    #: distance, surface, airlight, as `realtime.frame.renderer.run_stages` returns them
    stages: tuple[Any, Any, Any]
    frame_ms: float  #: until the arrays are ready
    stages_ms: dict[str, float]  #: by stage; empty where they were not timed


class LiveScene:
    """A scene, its configuration, and what the last frame left to the next."""

    def __init__(
        self, name: str, size: tuple[int, int], chosen: Configuration, changes: Mapping[str, Values]
    ) -> None:
        self.name, self.size = name, size
        self.chosen, self.changes = chosen, dict(changes)
        # Isotropic media of the scene as it was read: a change that gives one a lobe needs another
        # phase function, for which the scene is loaded again.
        self._isotropic = isotropic_media(load_scene(name, size).scene)
        self._renderers: OrderedDict[Any, FrameRenderer] = OrderedDict()
        self._surfaces: dict[Any, FrameRenderer] = {}
        self._load()
        self.renderer = self._find_renderer()

    def _load(self) -> None:
        loaded = load_scene(self.name, self.size, self.changes)
        # A new scene has new arrays and new meshes: nothing that was kept for the last one fits.
        self.label = loaded.name
        self.source = loaded.scene
        self.scene = read_scene(loaded.scene)
        self._cache: FrameCache | None = None
        self._other_method = False
        self._moved = {"camera_moved": False, "light_moved": False}
        self.begin_mean()
        self._renderers.clear()
        self._surfaces.clear()

    def _lobes(self, changes: Mapping[str, Values]) -> set[str]:
        """Return which isotropic media changes give a lobe: the scene is
        loaded again for others.
        """
        return {name for name, value in changes.items() if name in self._isotropic and any(value)}

    @property
    def there(self) -> dict[str, Any]:
        """The changeable parameters of the scene, with their present values."""
        return changeable(self.source)

    @property
    def goes_on(self) -> bool:
        """Whether frames differ while nothing moves: they build on the last
        one, or draw random numbers.
        """
        made = self.renderer
        return made.method.carries or made.method.noisy or made.history is not None

    def begin_mean(self) -> None:
        """Forget the mean of the frames of a method that draws random numbers: from now on
        they show another thing.
        """
        self._sum: Any = None
        self.summed = 0  # frames

    def mean(self, shown: Shown) -> Shown:
        """Return the last frame with the mean airlight of the frames of a noisy method
        since something changed.
        """
        # Only the airlight is noisy.
        distance, surface, airlight = shown.stages
        return replace(
            shown, stages=(distance, surface, self._sum / self.summed if self.summed else airlight)
        )

    def choose(self, chosen: Configuration) -> float:
        """Render by another configuration from now on; return what its preparation takes [ms].

        If the method refuses the scene or a parameter, all is as it was.
        """
        took = stopwatch()
        # A method may refuse the scene only when it is prepared: then the last configuration goes
        # on.
        before, self.chosen = self.chosen, chosen
        try:
            renderer = self._find_renderer()
        except InputError:
            self.chosen = before
            raise
        self._other_method |= renderer is not self.renderer
        self.renderer = renderer
        return took().ms

    def shader_stamp(self) -> tuple[Any, ...]:
        """Return a stamp of the files of the shader that is shown, which changes with them;
        None for another method.
        """
        files = (
            self.renderer.method.shader.files if isinstance(self.renderer.method, Shader) else ()
        )
        return tuple((str(file), file.stat().st_mtime_ns) for file in files if file.is_file())

    def read_shader(self) -> None:
        """Render by the shader as it is in its file now; if that is at fault, all is as it was."""
        known = defaults(find_method(self.chosen.method))
        given = {name: value for name, value in self.chosen.parameters if name in known}
        # The new text may have other parameters: parameters that stayed keep their values.
        chosen = configuration(self.chosen.method, None, given)
        made = prepared(self.scene, chosen)
        self.chosen, self.renderer, self._other_method = chosen, made, True
        # Renderers of the old text must not come back.
        for key in [key for key in self._renderers if key[0].method == chosen.method]:
            del self._renderers[key]
        self._renderers[chosen, self._code()] = made

    def change(self, changes: Mapping[str, Values]) -> None:
        """Change the scene; names that are not given are as they were. If scene or method
        refuse, all is as it was.
        """
        # Changes are absolute values: the old and the new ones are applied together.
        before, renderer = self.changes, self.renderer
        wanted = before | dict(changes)
        moved = {name for name, value in changes.items() if before.get(name) != tuple(value)}
        try:
            # Numbers change in place, which keeps what was recorded.
            if self._lobes(wanted) == self._lobes(before):
                change_scene(self.source, wanted)
                self.scene = read_again(self.scene, self.source)
                self.changes = wanted
            else:
                self.changes = wanted
                self._load()
            renderer = self._find_renderer()
        except InputError:
            self.changes = before
            self._load()  # the numbers of before, bit by bit
            self.renderer = self._find_renderer()
            raise
        self._other_method |= renderer is not self.renderer
        self.renderer = renderer
        self._moved["camera_moved"] |= any(name.startswith("camera") for name in moved)
        self._moved["light_moved"] |= any(
            name.endswith((".position", ".direction")) for name in moved
        )

    def reset(self) -> None:
        """Make the scene as it was read, without any change."""
        self.changes = {}
        self._load()
        self.renderer = self._find_renderer()

    def frame(self, *, by_stage: bool = False) -> Shown:
        """Render the next frame; `by_stage` times its stages, which makes it a little slower."""
        # The time of the whole frame, until its arrays are ready.
        took = stopwatch()
        renderer, times = timed_stages(self.renderer) if by_stage else (self.renderer, {})
        cache, moved = self._cache, dict(self._moved)
        # Another method can use only the hits of camera rays, and these only while the camera stood
        # still. Lights count as moved, so that shadows are prepared again.
        if self._other_method and cache is not None:
            keeps = not moved["camera_moved"]
            cache = FrameCache(cache.cast, None, frames=cache.frames) if keeps else None
            moved["light_moved"] = True
        stages, self._cache = next_frame(renderer, self.scene, cache, geometry_moved=False, **moved)
        dr.sync_thread()
        self._other_method = False
        self._moved = dict.fromkeys(self._moved, False)
        shown = Shown(stages, took().ms, times)
        # The mean of noisy frames since the last change, for the error that remains.
        if self.renderer.method.noisy:
            self._sum, self.summed = (
                stages[2] + (0 if self._sum is None else self._sum),
                self.summed + 1,
            )
            dr.eval(self._sum)
        return shown

    def on_host(self, shown: Shown) -> Frame:
        """Bring a frame to the host in the order of the image."""
        return image_frame(replace(self.renderer, scene=self.scene), shown.stages)

    def _code(self) -> tuple[Any, ...]:
        """Return a key of the code that the scene needs: a change may add or take a
        channel, or a light's falloff.
        """
        return (*describe(self.scene).values(), self.scene.medium.vacuum)

    def _find_renderer(self) -> FrameRenderer:
        """Return the renderer of the configuration for the scene as it is now."""
        # The last six configurations keep their recorded functions; the least recently used goes
        # first.
        key = self.chosen, self._code()
        if key not in self._renderers:
            made = prepared(self.scene, self.chosen)
            self._renderers[key] = self._with_known_surface(made)
            while len(self._renderers) > 6:
                self._renderers.popitem(last=False)
        self._renderers.move_to_end(key)
        return self._renderers[key]

    def _with_known_surface(self, made: FrameRenderer) -> FrameRenderer:
        """Return a renderer that casts and shades by the functions that
        another one has recorded.
        """
        # Casting and shading depend on a method only in whether it finds out which surfaces are
        # lit.
        key = self._code(), made.method.provides_visibility
        known = self._surfaces.setdefault(key, made)
        stages = replace(made.stages, surface=known.stages.surface, shade=known.stages.shade)
        # The pixels too: a recorded function tells arrays apart by how they lie in memory.
        return replace(made, pixel=known.pixel, stages=stages)
