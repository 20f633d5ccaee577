# SPDX-License-Identifier: BSD-3-Clause
"""The loop of the view: it draws what the page asks for, and computes its
reference while nothing moves.

While the scene changes, one frame at a time is judged as it was shown, with its noise and its
history, by its own reference in some pixels; the next one when that is known.

Threads of the server put what the page says into a list; this loop alone touches Dr.Jit. It takes
all that has come since the last frame at once, so frames that nobody would see are not drawn, and
it waits for the page to show a frame before it sends the next but one.
"""

import math
import threading
import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from airlight.analytic.clock import stopwatch
from airlight.errors import InputError, nearest
from airlight.realtime.methods.interface.method import method_parameters
from airlight.realtime.methods.registry import METHODS, find_method
from airlight.realtime.parameters import defaults, values
from airlight.reports.plotting.pictures import (
    ERROR_CEILING,
    ERROR_FLOOR,
    error_map,
    error_scale,
    exposure,
)
from airlight.reports.view.live_scene import WORDS, LiveScene, Shown
from airlight.reports.view.picture import LAYERS, Pictures, rgba
from airlight.reports.view.reference import (
    ReferenceInBackground,
    ViewError,
    motion_error,
    view_error,
)
from airlight.reports.view.server import Page
from airlight.reports.view.widgets import (
    ViewState,
    calls_kernel,
    kernel_widgets,
    method_widgets,
    parameter_widgets,
)
from airlight.validation.columns import plain
from airlight.validation.scenes.changes import Values
from airlight.validation.study.configuration import Configuration, configuration

_QUIET = 0.15  # after so long without a change the page is told where all stands [s]
_STILL = 0.4  # after so long the reference is begun [s]
_NEWS = 0.4  # between two pictures of what is known of the reference [s]


class Session:
    """The state of the view: the page, its wishes, and the frame that it shows."""

    def __init__(self, state: ViewState, variant: str) -> None:
        self._given = state
        self.live = LiveScene(state.scene, state.size, state.chosen, state.changes)
        self.reference = ReferenceInBackground(self._wake, variant)
        self._pictures = Pictures()
        self._condition = threading.Condition()
        self._said: list[tuple[Page, dict[str, Any]]] = []
        self._page: Page | None = None
        self._show: dict[str, Any] = {
            "layer": "total",
            "exposure": 0.0,
            "other": "none",
            "run": False,
        }
        self._factor: float | None = None
        self._sent = self._drawn = self._wanted = 0
        self._moves = 0  # of the camera that the page has sent and that are taken
        self._shown: Shown | None = None
        self._stages: dict[str, float] = {}
        self._changed_at = time.perf_counter()
        self._asked_at: float | None = None  # of the change whose cost the next frame tells
        self._told = self._news_at = 0.0
        self._reference_of: Any = None
        self._news = False
        # whether the scene has changed since the last reference of a scene at rest
        self._moves_on = False
        # airlight of the frame of a scene that changes whose reference is computed
        self._judged: Any = None
        self._last_judged = 0  # number of that frame
        self._in_motion: list[ViewError] = []
        self._shader = self.live.shader_stamp()

    # Called by the server's threads ---------------------------------------------------------------

    def opened(self, page: Page) -> None:
        """Show this page what there is from now on, and no other."""
        with self._condition:
            # A view has one page: the newest.
            before, self._page = self._page, page
            self._said.append((page, {"kind": "opened"}))
            self._condition.notify()
        if before is not None:
            before.close("this view was opened in another tab")

    def told(self, page: Page, said: dict[str, Any]) -> None:
        """Note what a page says."""
        with self._condition:
            if page is self._page:
                self._said.append((page, said))
                self._condition.notify()

    def closed(self, page: Page) -> None:
        """Draw nothing for a page that was closed."""
        with self._condition:
            if page is self._page:
                self._page = None
                self._condition.notify()

    def _wake(self) -> None:
        with self._condition:
            self._news = True
            self._condition.notify()

    # The loop -------------------------------------------------------------------------------------

    def run(self) -> None:
        """Draw until the process ends."""
        while True:
            self.turn()

    def turn(self) -> None:
        """Wait for something to do, and do it."""
        with self._condition:
            # The server's threads and the reference wake the loop; otherwise it sleeps until the
            # next thing is due.
            if not self._said and not self._can_draw():
                self._condition.wait(self._patience())
            said, self._said = self._said, []
            page = self._page
        # Nobody looks: nothing is drawn, and no reference computed.
        if page is None:
            if self._reference_of is not None:
                self._reference_of = None
                self.reference.stop()
            return
        # First what the user asked, then a frame, then what is known by now.
        self._take(page, said)
        self._follow_shader(page)
        if self._can_draw():
            self._draw(page)
        self._after(page)

    def _can_draw(self) -> bool:
        # Two frames are sent before the page has shown the first of them.
        ahead = self._sent - self._drawn
        return self._page is not None and ahead < 2 and (self._wanted > 0 or self._show["run"])

    def _patience(self) -> float:
        """Return how long to wait for news [s]."""
        if self._page is None:
            return 60.0
        now = time.perf_counter()
        # The nearest of the times at which something is due; files of a shader are looked at every
        # 0.3 s.
        waits = [0.3 if self._shader else 60.0]
        if self._told < self._changed_at:
            waits.append(self._changed_at + _QUIET - now)
        # Without a frame no reference begins, and without a reference there is no news to wait for.
        if self._reference_of is None and self._is_shown:
            waits.append(self._changed_at + _STILL - now)
        if self._news and self._reference_of is not None and self._is_shown:
            waits.append(self._news_at + _NEWS - now)
        return max(min(waits), 0.001)

    @property
    def _is_shown(self) -> bool:
        """Whether the last frame is of the scene and the method as they are now: a page that has
        two frames to show yet gets that of a change later.
        """
        return self._shown is not None and self._asked_at is None

    def _take(self, page: Page, said: list[tuple[Page, dict[str, Any]]]) -> None:
        """Do what the page asks; changes that follow one another are one, and of values
        of one parameter the last.
        """
        changes: dict[str, Values] = {}
        messages = [message for sender, message in said if sender is page]
        # A slider sends a value for every pixel of its way: only the last choice of one parameter
        # counts. Changes of the scene are collected until another kind of message comes.
        for message, following in zip(messages, [*messages[1:], {}]):
            if message.get("kind") == "choose" and _chooses(message) == _chooses(following):
                continue
            if message.get("kind") == "change":
                changes |= _numbers(message.get("changes"))
                self._moves = max(self._moves, int(_number(message.get("moves"))))
                continue
            changes = self._change(page, changes)
            self._do(page, message)
        self._change(page, changes)

    def _change(self, page: Page, changes: dict[str, Values]) -> dict[str, Values]:
        if changes:
            self._try(page, lambda: self.live.change(changes), of_scene=True)
        return {}

    def _try(self, page: Page, work, *, of_scene: bool) -> None:
        """Change what is shown; a mistake is told in one line, and changes nothing."""
        # The first of several requests: the cost that the page shows is what the user waited.
        self._asked_at = self._asked_at or time.perf_counter()
        try:
            work()
        except InputError as error:
            page.tell("mistake", message=" ".join(str(error).split()))
        else:
            page.tell("mistake", message="")
            self._moves_on |= of_scene
            # The reference is of the scene before the change.
            if of_scene and self._reference_of is not None:
                self._reference_of = None
                self._in_motion.clear()
                self.reference.stop()
            self._news = True
        self._touch()

    def _follow_shader(self, page: Page) -> None:
        """Read the shader that is shown again where one of its files has changed; a
        mistake leaves the picture.
        """
        # An editor may remove a file before it writes it again: no stamp is no change.
        now = self.live.shader_stamp()
        changed, self._shader = (
            bool(now) and bool(self._shader) and now != self._shader,
            now or self._shader,
        )
        if changed:
            self._try(page, self.live.read_shader, of_scene=False)
            self._tell_state(page)

    def _touch(self) -> None:
        self._changed_at = time.perf_counter()
        self.live.begin_mean()
        # Frames drawn of a still scene where each builds on the last.
        self._wanted = 64 if self.live.goes_on else 1

    def _do(self, page: Page, message: Mapping[str, Any]) -> None:
        kind = message.get("kind")
        # A page that opens has seen no frame; `drawn` says which it has shown.
        if kind == "opened":
            self._sent = self._drawn = self._moves = self._last_judged = 0
            self._open(page)
        elif kind == "drawn":
            self._drawn = max(self._drawn, int(_number(message.get("frame"))))
        elif kind == "choose":
            self._try(page, lambda: self._choose(message), of_scene=False)
            self._tell_state(page)
        elif kind == "show":
            # Values of a page are not trusted: unknown words fall back to the default, and numbers
            # are limited: 20 stops brighter or darker.
            given = self._show | {name: message[name] for name in self._show if name in message}
            layer, other = (str(given[name]) for name in ("layer", "other"))
            self._show = {
                "layer": layer if layer in LAYERS else "total",
                "exposure": min(max(_number(given["exposure"]), -20.0), 20.0),
                "other": other if other in ("reference", "error") else "none",
                "run": bool(given["run"]),
            }
            if message.get("expose"):
                self._factor = None
            self._wanted, self._news = max(self._wanted, 1), True
        elif kind == "reset":
            self._try(page, self.live.reset, of_scene=True)

    def _choose(self, message: Mapping[str, Any]) -> None:
        """Choose another method, kernel or value of a parameter."""
        chosen = self.live.chosen
        # Parameters of another method do not carry over.
        method = str(message.get("method", chosen.method))
        given: dict[str, Any] = dict(chosen.parameters) if method == chosen.method else {}
        if "parameter" in message:
            given[str(message["parameter"])] = message.get("value")
        kernel = message.get("kernel", chosen.kernel)
        self._check_choice(method, kernel)
        self.live.choose(sparing(method, kernel, given))

    def _check_choice(self, method: str, kernel: Any) -> None:
        """Refuse what is neither built in nor named by the user at the start: a page
        must not choose code to run.
        """
        # The page comes from this server, but a message may come from anything that knows the
        # token.
        own = self._given.chosen
        if method not in METHODS and method != own.method:
            wanted = ", ".join([*METHODS, *([own.method] if own.method not in METHODS else [])])
            raise InputError(
                f"method: got {method!r}, expected one of {wanted}" + nearest(method, METHODS)
            )
        if kernel and ":" in str(kernel) and kernel != own.kernel:
            raise InputError(
                f"kernel: got {kernel!r}, expected one that is built in, or that of the command "
                "line"
            )

    # Messages to the page -------------------------------------------------------------------------

    def _open(self, page: Page) -> None:
        page.tell(
            "opened",
            scene=self.live.label,
            size=self._size(),
            methods=method_widgets(self.live.chosen.method),
            kernels=kernel_widgets(),
            layers=list(LAYERS),
            stages=WORDS,
            show=self._show,
            scale={
                "colours": error_scale()[0].tolist(),
                "floor": ERROR_FLOOR,
                "ceiling": ERROR_CEILING,
            },
        )
        self._tell_state(page)
        self._touch()
        self._news = True

    def _tell_state(self, page: Page) -> None:
        self._told = time.perf_counter()
        live, state = self.live, self._state()
        page.tell(
            "state",
            method=live.chosen.method,
            kernel=live.chosen.kernel,
            calls_kernel=calls_kernel(live.chosen),
            parameters=plain(
                parameter_widgets(live.chosen, area_lights=bool(live.scene.area_lights))
            ),
            changeable=plain(list(live.there.values())),
            commands={name: state.command(name) for name in ("view", "render", "reference")},
            notes=list(live.scene.features.notes),
        )

    def _draw(self, page: Page) -> None:
        # Timing stages synchronises the device after each, so that only one frame of eight pays for
        # it.
        by_stage = self._sent % 8 == 0
        try:
            shown = self.live.frame(by_stage=by_stage)
            # The first frame, or one after a wish of the page, sets the exposure; then it stays, so
            # that changes of light can be seen.
            if self._factor is None:
                frame = self.live.on_host(shown)
                self._factor = exposure(frame.airlight + frame.surface)
        except InputError as error:
            page.tell("mistake", message=" ".join(str(error).split()))
            self._wanted, self._show["run"], self._asked_at = 0, False, None
            self._shown = None  # what is shown is no frame of the scene as it is
            return
        self._shown, self._wanted = shown, max(self._wanted - 1, 0)
        self._news |= self.live.goes_on
        if by_stage:
            self._stages = shown.stages_ms
        # The picture is made on the device: only 8-bit pixels are copied.
        took = stopwatch()
        _, surface, airlight = shown.stages
        how = {"layer": self._show["layer"], "factor": self._exposed()}
        picture = self._pictures.of_frame(self.live.renderer.pixel, surface, airlight, **how)
        picture_ms, now = took().ms, time.perf_counter()
        # The page learns what the frame cost, and how long its last change took to appear.
        self._sent += 1
        page.show(
            picture,
            kind="frame",
            frame=self._sent,
            size=self._size(),
            frame_ms=shown.frame_ms,
            picture_ms=picture_ms,
            stages=self._stages,
            taken=self._moves,
            change_ms=None if self._asked_at is None else 1e3 * (now - self._asked_at),
        )
        if self._asked_at is not None:
            self._changed_at = now  # anyone who moves on waits for this frame first
        self._asked_at = None

    def _after(self, page: Page) -> None:
        """Tell where all stands, begin the reference and show what is
        known of it, when it is time.
        """
        now = time.perf_counter()
        if self._told < self._changed_at and now >= self._changed_at + _QUIET:
            self._tell_state(page)
        # While the scene changes, single frames are judged in some pixels.
        if self._moves_on:
            self._judge_motion(page)
        if self._reference_of is None and now >= self._changed_at + _STILL and self._is_shown:
            self._reference_of = dict(self.live.changes)
            self._moves_on, self._judged = False, None
            self.reference.start(self._given.scene, self._given.size, self._reference_of)
        if (
            self._news
            and now >= self._news_at + _NEWS
            and self._reference_of is not None
            and self._is_shown
        ):
            self._news, self._news_at = False, now
            assert self._shown is not None
            self._tell_error(page, self._shown)

    def _judge_motion(self, page: Page) -> None:
        """Tell the error of the frame that is judged when its reference is known, then
        begin with the newest one.
        """
        known = self.reference.known
        if (
            self._judged is not None
            and known is not None
            and (self.reference.done or self.reference.failure)
        ):
            # The judged frame has its reference: its error joins the mean over the motion.
            error, self._judged = view_error(known, self._judged), None
            if self.reference.done and error is not None and error.relative_rmse is not None:
                self._in_motion.append(error)
                rmse, interval = motion_error(self._in_motion)
                told = {
                    "rmse": rmse,
                    "interval": interval,
                    "frames": len(self._in_motion),
                    "pixels": error.known,
                }
                page.tell("motion", **plain(told))
        # A change that no frame shows yet has another reference. A frame that was not judged yet,
        # and that shows the last change, is judged in 256 pixels.
        new = self._sent > self._last_judged and self._is_shown
        if self._judged is None and self._shown is not None and new:
            with suppress(InputError):
                self._last_judged, self._judged = (
                    self._sent,
                    self.live.on_host(self._shown).airlight,
                )
                self.reference.start(self._given.scene, self._given.size, self.live.changes, 256)

    def _tell_error(self, page: Page, shown: Shown) -> None:
        # No reference: the page shows why.
        found = self.reference.known
        if self.reference.failure or found is None:
            page.tell("error", failure=self.reference.failure)
            return
        try:
            frame, mean = (self.live.on_host(each) for each in (shown, self.live.mean(shown)))
        except InputError as mistake:
            page.tell("error", failure=" ".join(str(mistake).split()))
            return
        # The error of the last frame, and of the mean of frames, which tells bias from noise.
        error, left = (view_error(found, each.airlight) for each in (frame, mean))
        page.tell(
            "error",
            failure="",
            error=plain(asdict(error)) if error else None,
            done=self.reference.done,
            # that the mean is of; 0 for a method whose frames are all the same
            frames=self.live.summed,
            mean=plain(left.relative_rmse) if left else None,
        )
        if error is None or self._show["other"] == "none":
            return
        # The second picture: the error or the reference, in which pixels that are not known take a
        # near one.
        if self._show["other"] == "error":
            test = found.filled(np.asarray(frame.airlight, dtype=np.float64))
            picture = rgba(error_map(found.filled(found.airlight), test))
        else:
            weights = LAYERS[self._show["layer"]]
            layers = found.filled(found.airlight), found.filled(found.surface)
            radiance = sum(
                weight * layer for weight, layer in zip(weights, layers, strict=True) if weight
            )
            picture = self._pictures.of_image(np.asarray(radiance), self._exposed())
        page.show(picture, kind="other", size=self._size(), known=error.known, pixels=error.pixels)

    def _state(self) -> ViewState:
        return replace(self._given, chosen=self.live.chosen, changes=self.live.changes)

    def _size(self) -> tuple[int, int]:
        return self.live.scene.camera.width, self.live.scene.camera.height

    def _exposed(self) -> float:
        return (self._factor or 1.0) * 2.0 ** float(self._show["exposure"])


def sparing(method: str, kernel: Any, given: Mapping[str, Any]) -> Configuration:
    """Return a configuration that names only what differs from the method's defaults."""
    # A command that repeats the view should hold only what the user changed.
    record = find_method(method)
    method_values, light_samples = method_parameters(record, given)
    now = values(light_samples) | values(method_values)
    usual = values(record.light_samples) | defaults(record)
    differing = {name: now[name] for name in given if now[name] != usual[name]}
    return configuration(
        method, str(kernel) if kernel and method_values.uses_kernel else None, differing
    )


def _chooses(message: Mapping[str, Any]) -> tuple[Any, ...]:
    """Return the choice that a message of the page makes, without its value."""
    return message.get("kind"), "method" in message, "kernel" in message, message.get("parameter")


def _number(value: Any) -> float:
    """Return a number of a page's message; 0 for anything else."""
    number = _float(value) if isinstance(value, int | float) else 0.0
    return number if np.isfinite(number) else 0.0


def _float(number: float) -> float:
    """Return a number of JSON, whose whole numbers may be larger than any float."""
    try:
        return float(number)
    except OverflowError:
        return math.inf


def _numbers(changes: Any) -> dict[str, Values]:
    """Return the changes of a page's message that have the form of changes."""
    if not isinstance(changes, dict):
        return {}
    # Anything of another form is dropped.
    lists = {name: value for name, value in changes.items() if isinstance(value, list)}
    return {
        name: tuple(_float(number) for number in value)
        for name, value in lists.items()
        if all(isinstance(number, int | float) for number in value)
    }
