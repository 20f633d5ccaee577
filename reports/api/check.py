# SPDX-License-Identifier: BSD-3-Clause
"""`airlight.check`: relations between frames, which need no reference."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from airlight.errors import InputError
from airlight.reports.api.inputs import (
    File,
    KernelLike,
    MethodLike,
    ModelLike,
    Progress,
    Size,
    Words,
    chosen_model,
    configuration_of,
    exclude,
    listed,
    one_error,
    pixels_of,
    telling,
)
from airlight.reports.tables.record import Result
from airlight.reports.tables.table import Table, numbers, table, words

if TYPE_CHECKING:
    from airlight.reference.scene.model import Model
    from airlight.validation.arrays import Array
    from airlight.validation.check.check_file import Asked
    from airlight.validation.check.judge import Kept

_SIZE = (64, 48)  #: of frames that are rendered here [pixels]
# Relative rounding of a value by the precision of a method: places of 32 m are known to 2e-6 m in
# float32, and the airlight of a ray that passes a light closely follows them.
_ROUNDING = {"single": 2e-4, "double": 1e-6}


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class RelationsKept(Result):
    """The answers of frames to relations."""

    checked: str  #: the folder, or the scene and the method
    scene: str | None
    kept: "tuple[Kept, ...]"  #: a row for each relation
    signature: str  #: what failing relations say together; empty where that is nothing
    notes: tuple[str, ...] = ()  #: relations that a method cannot be asked, and why

    def __getitem__(self, name: str) -> "Kept":
        """Return the answer to a relation, such as 'units'."""
        return {each.name: each for each in self.kept}[name]

    @property
    def title(self) -> str:
        """The folder, or the scene and the method."""
        return self.checked

    @property
    def scene_name(self) -> str | None:
        """The scene, where one was named."""
        return self.scene

    @property
    def tables(self) -> Sequence[Table]:
        """A row for each relation."""
        columns = (
            *words(name="relation", verdict="answer"),
            *numbers(error="error", limit="limit", how={"percent": True, "digits": 2}),
            *numbers(ratio="ratio", how={"digits": 4}),
            *words(worst="worst at"),
            *words(points_to="points to", how={"long": True}),
        )
        return [table(self.checked, columns, [vars(each) for each in self.kept])]

    @property
    def lines(self) -> Sequence[str]:
        """How many hold, and what failing ones say together."""
        count = {
            verdict: sum(each.verdict == verdict for each in self.kept)
            for verdict in ("holds", "fails", "cannot be told")
        }
        total = f"{count['holds']} of {len(self.kept)} relations hold, {count['fails']} fail"
        untold = count["cannot be told"]
        said = [f"{total}, {untold} cannot be told." if untold else f"{total}.", *self.notes]
        return [*said, f"Together: {self.signature}."] if self.signature else said

    @property
    def failures(self) -> Sequence[str]:
        """The relations that fail."""
        return [f"{each.name} fails: {each.points_to}" for each in self.kept if each.fails]

    def to_dict(self) -> dict[str, Any]:
        """Return the answers."""
        from airlight.validation.columns import plain

        return plain({"relations": self.kept, "signature": self.signature})


@one_error
def check(
    what: File,
    method: MethodLike | None = None,
    kernel: KernelLike | None = None,
    *,
    model: ModelLike | None = None,
    engine: str | None = None,
    adapters: File | None = None,
    only: Words = (),
    size: Size = _SIZE,
    precision: Literal["single", "double"] | None = None,
    margin: float | None = None,
    progress: Progress = None,
    **parameters: Any,
) -> RelationsKept:
    """Check a renderer without a reference: frames whose ratio, difference or sum is known.

    Twice the light is twice the image; a camera that turns sees the same rays; no length is
    special. Sixteen such relations hold in every scene of single scattering, and need no number of
    it. `airlight describe SCENE --variants all -o DIR` writes scenes to render, with the file
    check.json that names their frames; or write that file for frames of your own. With `--method`
    a method of ours or of yours renders the frames. With `--model` they are references of an
    engine's own equation: what fails then, no algorithm can make hold. With `--engine` an engine
    of `airlight capture` renders the frames.

    The exit status is 1 if a relation fails. Each row says what that points to.

    Parameters
    ----------
    what
        The folder of a check.json, or the file; with `--method`, `--model` or `--engine` a
        built-in scene of fog.
    method
        Render and check this method: one of `airlight list methods`, or a user's as
        MODULE:FUNCTION, FILE.py:FUNCTION or FILE.glsl; from Python also a function.
    kernel
        Airlight kernel of the method, see `airlight list kernels`.
    model
        Check this equation, such as godot:range=9, see `airlight list models`, or terms such as
        light-path=off. Its lengths stay as they are where `units` doubles those of the scene.
    engine
        Render the frames in an engine, the name of an adapter of `airlight capture`, such as
        three; `--set` takes its settings. Relations of scenes that it cannot have are left out.
    adapters
        With an engine: the folder of the adapters; by default docs/adapters of the clone.
    only
        Check these relations alone, such as units,pan.
    size
        Without frames of your own: their width and height [pixels], or WxH.
    precision
        With a method: its precision; by default double for a built-in one, single for a user's.
    margin
        The largest error of a relation that is no fault, such as 0.01; by default what noise and
        rounding make.
    progress
        Called with (fraction done, what); True shows a bar.
    parameters
        Parameters of the method, or settings of the engine.

    Raises
    ------
    InputError
        For a file or a frame that cannot be read, and a relation that there is not.
    MissingError
        If a program that an engine needs is missing.

    References
    ----------
    Chen, Cheung, Yiu 1998, Metamorphic testing; Donaldson, Lascu 2016, for shader compilers.
    """
    from airlight.realtime.methods.shader.source import is_users
    from airlight.validation.check.relations import RELATIONS

    chosen = listed("only", only) if only else []
    for name in chosen:
        if name not in RELATIONS:
            raise InputError(f"only: got {name!r}, expected some of {', '.join(RELATIONS)}")
    if margin is not None and not 0 < margin < 1:
        raise InputError(f"margin: got {margin:g}, expected a fraction above 0, such as 0.01")
    pixels = pixels_of(size)
    assert pixels is not None
    if adapters is not None and engine is None:
        raise InputError("adapters: they render for an engine; add --engine NAME")
    if engine is not None:
        beside = {"method": method, "kernel": kernel, "model": model, "precision": precision}
        exclude("engine", "renders the frames", beside)
        with telling(progress, f"{what} in {engine}") as tell:
            return _engine(str(what), engine, parameters, adapters, chosen, pixels, margin, tell)
    if model is not None:
        others = {"method": method, "kernel": kernel, "precision": precision, **parameters}
        exclude("model", "is no method", others)
        equation = chosen_model(model)
        assert equation is not None
        with telling(progress, f"{what}: {equation.title}") as tell:
            return _model(str(what), equation, chosen, pixels, margin, tell)
    if method is None:
        others = {"kernel": kernel, "precision": precision, "size": pixels != _SIZE, **parameters}
        exclude("check", "without a method the frames are there already", others)
        return _files(Path(what), chosen, margin)
    asked = configuration_of(method, kernel, parameters)
    # A user's code may be written for single precision alone, as shaders are.
    usual: Literal["single", "double"] = "single" if is_users(asked.method) else "double"
    with telling(progress, f"{what}: {asked.label}") as tell:
        how = precision or usual
        return _method(str(what), asked, chosen, pixels, how, margin, tell)


def _files(path: Path, only: Sequence[str], margin: float | None) -> RelationsKept:
    """Judge the frames that check.json names."""
    from airlight.reference.storage.exr import read_exr
    from airlight.validation.check.check_file import ROUNDING, read_check
    from airlight.validation.check.judge import judge, signature

    given = read_check(path)
    folder = path if path.is_dir() else path.parent
    asked = _chosen(given.relations, only, given.again)
    names = dict.fromkeys((*given.again, *(name for each in asked for name in each.frames)))
    frames = {name: _layers(read_exr(folder / name).layers) for name in names}
    kept = judge(
        asked,
        frames,
        again=given.again,
        rounding=ROUNDING[given.format],
        layer=given.layer,
        margin=margin,
    )
    return RelationsKept(checked=str(path), scene=given.scene, kept=kept, signature=signature(kept))


def _layers(layers: Mapping[str, Any]) -> "dict[str, Array]":
    """Return layers with all light among them."""
    if "total" in layers or not {"airlight", "surface"} <= layers.keys():
        return dict(layers)
    return {**layers, "total": layers["airlight"] + layers["surface"]}


def _chosen(asked: "Sequence[Asked]", only: Sequence[str], again: Sequence[str]) -> "list[Asked]":
    """Return the relations that are asked for by name; `again` is judged wherever it has frames."""
    names = list(dict.fromkeys([*(["again"] if again else []), *(each.name for each in asked)]))
    if not names:
        raise InputError("check.json asks for no relation; expected some, see docs/checks.md")
    missing = [name for name in only if name not in names]
    if missing:
        raise InputError(
            f"only: {', '.join(missing)} is none of the relations that are asked for here: "
            f"{', '.join(names)}"
        )
    return [each for each in asked if not only or each.name in only]


def _method(
    scene: str,
    chosen: Any,
    only: Sequence[str],
    size: tuple[int, int],
    precision: str,
    margin: float | None,
    tell: Any,
) -> RelationsKept:
    """Render the frames of a method, and judge them."""
    from airlight.realtime.methods.registry import METHODS
    from airlight.reports.machine.environment import activate

    activate()
    if chosen.method in METHODS and METHODS[chosen.method].renders_clouds:
        raise InputError(f"check: {chosen.label} scatters many times; expected a method of fog")
    draws = True

    def frame(changed: Any, number: int) -> "dict[str, Array]":
        nonlocal draws
        # A noisy method draws other numbers for each frame; one that draws none refuses a run.
        try:
            return _frame(changed, chosen, precision, number if draws else 0)
        except InputError:
            if not (draws and number):
                raise
            image = _frame(changed, chosen, precision, 0)
            draws = False
            return image

    by = f"{chosen.label}, {precision} precision"
    return _rendered(scene, by, frame, only, size, _ROUNDING[precision], margin, tell)


def _model(
    scene: str,
    model: "Model",
    only: Sequence[str],
    size: tuple[int, int],
    margin: float | None,
    tell: Any,
) -> RelationsKept:
    """Compute the references of an equation, and judge them."""
    from airlight.reports.machine.environment import activate

    activate()
    import mitsuba as mi

    from airlight.reference.quadrature.reference import reference_of

    def frame(changed: Any, number: int) -> "dict[str, Array]":
        image = reference_of(mi.load_dict(changed), model)
        return {"airlight": image.airlight, "surface": image.surface}

    by, rounding = f"the equation of {model.title}", _ROUNDING["double"]
    edge = _edge(model)
    return _rendered(scene, by, frame, only, size, rounding, margin, tell, falloff=edge)


def _edge(model: "Model") -> str:
    """Return the edge of the spots of an equation, which the camera in their place then has too."""
    kind, power = model.spot_of
    return {"angle": "linear", "rim": f"rim:{power!r}"}.get(kind, kind)


def _engine(
    scene: str,
    engine: str,
    settings: Mapping[str, Any],
    adapters: Any,
    only: Sequence[str],
    size: tuple[int, int],
    margin: float | None,
    tell: Any,
) -> RelationsKept:
    """Render the frames in an engine, and judge them."""
    from airlight.reference.storage.exr import read_exr
    from airlight.reference.storage.files import temporary_folder
    from airlight.reports.api.capture import capture
    from airlight.validation.check.check_file import ROUNDING
    from airlight.validation.scenes.models import model_of

    with temporary_folder() as folder:
        file = folder / "frame.exr"
        capture_of = partial(capture, engine, output=file, adapters=adapters)
        # The scene as it is says which edge the spots of the engine have, and whether it has noise.
        first = capture_of(scene, size=size, settings=dict(settings))
        edge = None if first.model is None else _edge(model_of(first.model))
        seed = first.settings.get("seed")

        def frame(changed: Any, number: int) -> "dict[str, Array]":
            # A renderer with noise draws other numbers for each frame.
            drawn = {} if seed is None else {"seed": int(seed) + number}
            capture_of(changed, settings={**settings, **drawn})
            return {name: values.astype(float) for name, values in read_exr(file).layers.items()}

        by = f"{first.engine} {first.version}"
        rounding = ROUNDING["half"]  # of the buffers of rasterisers
        return _rendered(scene, by, frame, only, size, rounding, margin, tell, falloff=edge)


def _rendered(
    scene: str,
    by: str,
    frame: "Callable[[Any, int], dict[str, Array]]",
    only: Sequence[str],
    size: tuple[int, int],
    rounding: float,
    margin: float | None,
    tell: Any,
    *,
    falloff: str | None = "linear",
) -> RelationsKept:
    """Judge the frames of changed scenes; `frame` returns the layers of one, by its number, and
    `falloff` is that of spots to the edge of their cones, None where it is not known.
    """
    from airlight.validation.check.judge import judge, signature
    from airlight.validation.check.variants import variants

    made = variants(scene, size, falloff or "linear")
    asked = _chosen(made.asked, only, made.again)
    names = dict.fromkeys((*made.again, *(name for each in asked for name in each.frames)))
    frames, refused = {}, dict[str, str]()
    if falloff is None:  # the camera in the place of a spot has its edge
        why = "the engine does not say which equation it solves, nor which edge its spots have"
        refused |= {"seen": why, "swapped": why}
    for number, name in enumerate(names):
        if name in refused:
            continue
        tell(number / len(names), name)
        try:
            frames[name] = _layers(frame(made.scenes[name](), number))
        except InputError as error:
            # A method may not know a light of a changed scene; the scene as it is it must know.
            if name in made.again:
                raise
            refused[name] = str(error)
    able = [each for each in asked if not refused.keys() & {*each.frames}]
    kept = judge(able, frames, again=made.again, rounding=rounding, margin=margin)
    left_out = tuple(
        f"{each.name} is left out: {refused[name]}"
        for each in asked
        for name in each.frames
        if name in refused
    )
    return RelationsKept(
        checked=f"{scene} by {by}",
        scene=scene,
        kept=kept,
        signature=signature(kept),
        notes=tuple(dict.fromkeys(left_out)),
    )


def _frame(scene: Any, chosen: Any, precision: Any, run: int) -> "dict[str, Array]":
    """Return the layers of a frame of a method."""
    from airlight.reports.api.render import render

    image: Any = render(
        scene,
        chosen.method,
        chosen.kernel,
        precision=precision,
        run=run,
        **dict(chosen.parameters),
    )
    return {"airlight": image.airlight, "surface": image.surface}
