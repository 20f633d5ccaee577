# SPDX-License-Identifier: BSD-3-Clause
"""A study: which scenes, methods, parameters, media and sizes, as a TOML file says it, and
the cells that come of it.

A cell is one combination of all of these; docs/many-scenes.md has the keys of a file. Every mistake
is refused by name before any work. The measurements of a report are a study too
(`validation/study/studies/`), with more keys:

    scenes = "all"                                          # of homogeneous fog with few lights: `FOG_SCENES`
    half = ["fence"]                                        # scenes that are compared at half the width
    methods = "quick"                                       # one of each kind
    metrics = "usual"                                       # without those of other tools and colours
    flip = "kinds"                                          # of the methods of "quick" alone
    times = "stages"                                        # all stages, frames after light, objects or colours changed
    timed_size = "800x600"                                  # of the frames that are timed
    points = 16                                             # of area lights in the references, for all rays alike
    seconds = 0.1                                           # on each of these times
    slow = 0.04                                             # a longer frame is timed stage by stage [s]
    frame_limit = 10                                        # a cell is left out if a frame would take longer [s]
    stability = 10_000                                      # rays on which kernels are tried
    growth = ["size", "map"]                                # by which work times are to grow (`growth.py`)

    [checks]                                                # of the references
    size = "64x48"
    margins = { single-scatter = 0.0005, volpath = 0.01 }   # of the relative bias, by estimator
    samples = { single-scatter = 128, volpath = 16 }        # a pixel in each batch, by estimator
    batches = 2048                                          # at most
    multiple = [8, 4]                                       # batches and samples, for multiple scattering
    patience = 18                                           # an estimator that has not decided is stopped [s]
"""

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cache, cached_property, partial
from pathlib import Path
from typing import Any, TypeVar

from airlight.errors import InputError, nearest
from airlight.realtime.methods.registry import FOG_METHODS, METHODS
from airlight.realtime.parameters import defaults
from airlight.validation.readers import (
    Reader,
    read_list,
    read_named,
    read_number,
    read_one_of,
    read_table,
    read_toml,
    read_whole,
    read_word,
    several,
)
from airlight.validation.scenes.changes import change_words
from airlight.validation.scenes.loading import parse_size
from airlight.validation.scenes.names import PREFIX, is_random, random_name
from airlight.validation.scenes.random.design import (
    LARGEST_SEED,
    read_ranges,
)
from airlight.validation.scenes.registry import FOG_SCENES, SCENES
from airlight.validation.study.configuration import (
    QUICK,
    Configuration,
    chosen_configurations,
    configuration,
    find_kernel,
    named_configurations,
)
from airlight.validation.study.settings import Checks, Measure, Settings

#: How frames are timed: 'none'; 'with' the computation of errors, briefly, whatever else runs on
#: the host; 'alone', where nothing else of the study runs there; 'stages': all stages, and frames
#: after light, objects or colours changed.
TIMES = ("none", "with", "alone", "stages")

#: The studies of reports, and the kinds of work by which times may grow.
STUDIES = ("quick", "default", "full")
GROWTH = ("size", "triangles", "lights", "map")

_Value = TypeVar("_Value")

_FOLDER = Path(__file__).parent / "studies"

_METHOD_SETS = ("all", "quick", "standard", "growth", "causes", "noise", "motion")
_LONGEST = 86400.0
_MOST_SCENES = 10_000_000
_MOST_SAMPLES = 256  # a pixel in a batch (DESIGN section 6.2)
_MOST_RAYS = 1 << 20  # see `validation.kernels.rays`


@dataclass(frozen=True)
class Cell:
    """One combination of a study: what becomes one row."""

    scene: str  #: built-in scene, 'random:SEED' or the path of a file
    size: tuple[int, int]  #: width and height [pixels]
    medium: tuple[str, ...]  #: changes of the medium, as `parse_changes` reads them
    chosen: Configuration
    measure: Measure = field(default_factory=Measure)
    #: kind and amount, of a step of `validation.study.growth`
    work: tuple[str, float] | None = None

    @property
    def image(self) -> "Cell":
        """The cell that stands for all cells of the same image, which share a reference."""
        return replace(self, chosen=Configuration("reference"), measure=Measure())


@dataclass(frozen=True)
class RandomScenes:
    """Which random scenes a study has."""

    count: int = 0
    first: int = 0  #: seed of the first
    ranges: Path | None = None  #: TOML file of what is drawn


@dataclass(frozen=True)
class Study(Settings):
    """A study file; the defaults are those of a study without a file."""

    random: RandomScenes = RandomScenes()
    half: tuple[str, ...] = ()  #: scenes that are compared at half the width
    configurations: tuple[Configuration, ...] = ()
    media: tuple[tuple[str, ...], ...] = ((),)
    #: of area lights in references, see `reference.quadrature.reference.reference_image`
    points: int | None = None
    timed: int | None = None  #: scenes that are timed alone, the first; None for all
    limit: float = 600.0  #: seconds that a cell or a reference may take
    retries: int = 3  #: how often a cell is begun again whose process died

    @property
    def settings(self) -> Settings:
        """The settings that a report shows, with the names of all scenes."""
        asked = {each.name: getattr(self, each.name) for each in fields(Settings)}
        return Settings(**asked | {"scenes": tuple(self.scene_names())})

    def at(self, size: tuple[int, int] | None) -> "Study":
        """Return the study with images and timed frames of another size
        [pixels]; itself for None.
        """
        return (
            self
            if size is None
            else replace(self, sizes=(size,), measure=replace(self.measure, timed_size=size))
        )

    def of(self, scene: str) -> "Study":
        """Return the study of one scene: those of `half` are compared at half the width.

        A batch of volpath has as many paths there as in others: launches would
        take all the time of fewer.
        """
        if scene not in self.half:
            return self
        # A quarter of the pixels needs four times the samples for as many paths.
        size, checked = (
            (max(1, width // 2), max(1, height // 2))
            for width, height in (self.sizes[0], self.checks.size)
        )
        samples = {
            name: (4 if name == "volpath" else 1) * count
            for name, count in self.checks.samples.items()
        }
        return replace(
            self,
            sizes=(size,),
            measure=replace(self.measure, timed_size=self.timed_size),
            checks=replace(self.checks, size=checked, samples=samples),
        )

    def asked_of(self, *names: str) -> list[str]:
        """Return those of some fields that are not as in a study without a file."""
        plain = Study()
        return [name for name in names if getattr(self, name) != getattr(plain, name)]

    def wants_flip(self, chosen: Configuration) -> bool:
        """Return whether HDR-FLIP of a configuration is asked for."""
        return self.flip == "all" or (self.flip == "kinds" and (chosen in QUICK or chosen.own))

    @property
    def scene_count(self) -> int:
        """How many scenes it has; a random one that is named too counts once."""
        return len(self.scenes) + self.random.count - sum(self._drawn(name) for name in self.scenes)

    @property
    def cells_by_scene(self) -> int:
        """How many cells a scene has."""
        return len(self.sizes) * len(self.media) * len(self.configurations)

    def scene_names(self) -> Iterator[str]:
        """Yield the scenes, each once, random ones last."""
        yield from (name for name in self.scenes if not self._drawn(name))
        yield from (f"{PREFIX}{seed}{self._options}" for seed in self._seeds)

    @property
    def _seeds(self) -> range:
        return range(self.random.first, self.random.first + self.random.count)

    @cached_property
    def _options(self) -> str:
        """The part after the seed in the names of its random scenes."""
        return random_name("", self.random.ranges).removeprefix(PREFIX)

    def _drawn(self, name: str) -> bool:
        seed = seed_of(name)
        return seed in self._seeds and name == f"{PREFIX}{seed}{self._options}"

    def images(self) -> Iterator[tuple[Cell, ...]]:
        """Yield the cells of one image after the other: they share a reference."""
        for scene, size, medium in itertools.product(self.scene_names(), self.sizes, self.media):
            yield tuple(
                Cell(scene, size, medium, each, replace(self.measure, flip=self.wants_flip(each)))
                for each in self.configurations
            )

    def timed_images(self) -> Iterator[tuple[Cell, ...]]:
        """Yield those `images` whose cells are timed alone."""
        if self.measure.times != "alone":
            return iter(())
        count = None if self.timed is None else self.timed * len(self.sizes) * len(self.media)
        return itertools.islice(self.images(), count)


def default_configurations() -> tuple[Configuration, ...]:
    """Return the configurations of a study without methods: the kinds of the quick
    report, default area lights.
    """
    kinds = [each for each in QUICK if "points" not in dict(each.parameters)]
    methods = {each.method for each in kinds}
    others = [name for name in FOG_METHODS if name not in methods]
    return (*kinds, *(configuration(name) for name in others))


def default_study(count: int) -> Study:
    """Return the study without a file: so many random scenes, every
    method once, 160 x 120 pixels.
    """
    read_whole("study", count, 1, _MOST_SCENES)
    return Study(
        f"random-{count}", random=RandomScenes(count), configurations=default_configurations()
    )


def read_study(path: Path) -> Study:
    """Return the study of a TOML file.

    Every name, type or value that a study cannot have is refused.
    """
    data = read_toml("study", path)
    try:
        study = parse_study(data, folder=path.parent, name=path.stem)
        if not study.scene_count:
            raise InputError("it has no scene; give scenes = [...], or count in [random]")
    except InputError as error:
        raise InputError(f"study {path}: {error}") from error
    return study


def parse_study(data: Mapping[str, object], *, folder: Path = Path(), name: str = "sweep") -> Study:
    """Return the study that a table describes, as `tomllib` reads it.

    Paths of scenes begin at `folder`.
    """
    # The keys of a study and of its measurements stand beside one another in the file: either
    # reader passes over the keys of the other.
    others = ("scenes", "random", "methods", "kernels", "maps", "parameters")
    settings = read_named("", data, _STUDY, *_MEASURE, *others)
    measure = read_named("", data, _MEASURE, *_STUDY, *others)
    # Keys that contradict one another.
    times = measure.get("times", "with")
    if "timed" in settings and times != "alone":
        raise InputError(
            f'timed: it is of times = "alone", got times = "{times}"; leave one of them out'
        )
    paths = settings.get("checks", Checks()).samples.get("volpath", 0)
    if settings.get("half") and 4 * paths > _MOST_SAMPLES:
        raise InputError(
            f"checks.samples.volpath: got {paths}, expected at most {_MOST_SAMPLES // 4} beside "
            "`half`, whose scenes have four times as many"
        )
    scenes = data.get("scenes", [])
    read_scene_name = partial(_scene, folder=folder)
    # Scenes at half the width are named as scenes are; a study of ours has more than it measures.
    settings["half"] = tuple(read_scene_name("half", each) for each in settings.get("half", ()))
    return Study(
        **{"name": name, **settings},
        scenes=tuple(FOG_SCENES)
        if scenes == "all"
        else several(read_scene_name, 0)("scenes", scenes),
        random=_random(data.get("random", {}), folder),
        configurations=_configurations(data),
        measure=Measure(**{_FIELDS.get(name, name): value for name, value in measure.items()}),
    )


@cache
def standard_study(name: str) -> Study:
    """Return a study of ours by its name, that of a file in `studies/`."""
    return read_study(_FOLDER / f"{name}.toml")


def _configurations(data: Mapping[str, object]) -> tuple[Configuration, ...]:
    """Return the combinations of methods, kernels, maps and parameters."""
    # A word stands for a set of configurations that are complete. Together with kernels, maps or
    # parameters it only names the methods.
    parameters = read_table("parameters", data.get("parameters", {}))
    asked = data.get("methods", "all")
    if isinstance(asked, str):
        read_one_of("methods", asked, names=_METHOD_SETS)
        sets = {"all": default_configurations, "standard": chosen_configurations}
        standard = sets[asked]() if asked in sets else named_configurations(asked)
        if not (parameters or "kernels" in data or "maps" in data):
            return standard
        names = list(dict.fromkeys(each.method for each in standard))
    else:
        names = list(several(read_word)("methods", asked))
    # Every name is checked before anything is combined: the message then says which is wrong.
    for method in names:
        configuration(method)  # refuses unknown names
    stray = [method for method in parameters if method not in names]
    if stray:
        raise InputError(
            f"parameters.{stray[0]}: the study has no method of that name{nearest(stray[0], names)}"
        )
    # None stands for a method's default, where the file says nothing.
    kernels: list[str | None] = [None]
    if "kernels" in data:
        kernels = [read_word("kernels", word) for word in read_list("kernels", data["kernels"])]
    for kernel in kernels:
        if kernel is not None:
            find_kernel(kernel)
    sides: list[int | None] = [None]
    if "maps" in data:
        sides = [read_whole("maps", side, 1, 16384) for side in read_list("maps", data["maps"])]
    chosen = [
        each
        for method in names
        for each in _of_method(
            method, kernels, sides, read_table(f"parameters.{method}", parameters.get(method, {}))
        )
    ]
    # A key that no method has is a mistake of the file, not a study of less.
    if "kernels" in data and not any(each.kernel for each in chosen):
        raise InputError("kernels: none of the methods calls one; leave them out")
    if "maps" in data and not any("map" in dict(each.parameters) for each in chosen):
        raise InputError("maps: none of the methods has a shadow map; leave them out")
    return tuple(dict.fromkeys(chosen))


def _of_method(
    method: str,
    kernels: Sequence[str | None],
    sides: Sequence[int | None],
    parameters: Mapping[str, object],
) -> Iterator[Configuration]:
    """Yield the configurations of a method: kernels, maps and parameters, each with each.

    `sides`: of shadow maps [texels]; `parameters`: a value or a list of values by name.
    """
    if "map" in parameters and sides != [None]:
        raise InputError(f"parameters.{method}.map: `maps` says it too; give one of them")
    lists = {
        name: value if isinstance(value, list) else [value] for name, value in parameters.items()
    }
    for name, values in lists.items():
        if not values:
            raise InputError(
                f"parameters.{method}.{name}: got no value; leave it out for the default"
            )
    has_map = "map" in defaults(METHODS[method]) if method in METHODS else False
    if has_map and sides != [None]:
        lists["map"] = list(sides)
    for combination in itertools.product(*lists.values()):
        settings = dict(zip(lists, combination))
        plain = configuration(method, None, settings)
        # With these parameters the method draws no map: one configuration stands for all sides,
        # and equal ones are dropped by the caller.
        if "map" in lists and sides != [None] and map_side(plain) is None:
            plain = configuration(
                method, None, {name: value for name, value in settings.items() if name != "map"}
            )
        for kernel in kernels if plain.kernel else [None]:
            yield configuration(method, kernel, dict(plain.parameters))


def seed_of(scene: str) -> int | None:
    """Return the seed of a random scene; None for others."""
    seed = scene.removeprefix(PREFIX).partition(",")[0]
    return int(seed) if is_random(scene) and seed.isascii() and seed.isdigit() else None


def map_side(chosen: Configuration) -> int | None:
    """Return the side of the shadow map of a configuration [pixels]; None
    for a method without one.
    """
    if chosen.method not in METHODS:
        return None
    values = defaults(METHODS[chosen.method]) | dict(chosen.parameters)
    drawn = "map" in values and values.get("shadow", "map") == "map"
    return int(values["map"]) if drawn and isinstance(values["map"], int) else None


def _scene(what: str, value: object, *, folder: Path) -> str:
    word = read_word(what, value)
    if word in SCENES:
        if SCENES[word].clouds:
            raise InputError(
                f"{what}: {word} scatters light many times; a sweep is of single scattering, leave "
                "it out"
            )
        return word
    if is_random(word):
        seed = seed_of(word)
        if seed is None or seed > LARGEST_SEED:
            raise InputError(
                f"{what}: got {word!r}, expected random:SEED with a whole number from 0 to "
                f"{LARGEST_SEED:g}"
            )
        return word
    path = folder / word
    if not path.is_file():
        raise InputError(
            f"{what}: got {word!r}, expected a built-in scene, random:SEED or a Mitsuba XML or "
            "pbrt file beside the study" + nearest(word, SCENES)
        )
    return str(path.resolve())


def _random(value: object, folder: Path) -> RandomScenes:
    settings = read_named("random.", read_table("random", value), _RANDOM)
    if "ranges" in settings:
        settings["ranges"] = (folder / settings["ranges"]).resolve()
        read_ranges(settings["ranges"])  # refuses what cannot be drawn
    scenes = RandomScenes(**settings)
    if scenes.count and scenes.first + scenes.count - 1 > LARGEST_SEED:
        raise InputError(
            f"random: got {scenes.count} scenes from random:{scenes.first} on, expected seeds up "
            f"to {LARGEST_SEED:g}"
        )
    return scenes


def _medium(what: str, item: object) -> tuple[str, ...]:
    changes: dict[str, tuple[float, ...]] = {}
    for name, value in read_table(what, item).items():
        if not name.partition(".")[0].startswith("medium"):
            raise InputError(
                f"media: got {name!r}, expected medium.sigma_t, medium.albedo or medium.g; quote "
                "the name"
            )
        numbers: list[Any] = value if isinstance(value, list) else [value]
        if not numbers or not all(type(number) in (int, float) for number in numbers):
            raise InputError(
                f"media: got {value!r} for {name}, expected a number or a list of numbers"
            )
        changes[name] = tuple(float(number) for number in numbers)
    return tuple(change_words(changes))


def _size(what: str, value: object) -> tuple[int, int]:
    size = parse_size(read_word(what, value))
    if not all(1 <= side <= 16384 for side in size):
        raise InputError(
            f"{what}: got {size[0]}x{size[1]}, expected at least 1x1 and at most 16384 pixels on a "
            "side"
        )
    return size


def _flip(what: str, value: object) -> str:
    words = {True: "all", False: "none", "kinds": "kinds"}
    if not isinstance(value, bool | str) or value not in words:
        raise InputError(f'{what}: got {value!r}, expected true, false or "kinds"')
    return words[value]


def _pair(what: str, value: object) -> tuple[int, ...]:
    if not isinstance(value, list) or len(value) != 2:
        raise InputError(f"{what}: got {value!r}, expected two whole numbers")
    # A standard error needs two batches.
    batches, samples = value
    return read_whole(what, batches, 2, 1 << 16), read_whole(what, samples, 1, _MOST_SAMPLES)


def _checks(what: str, value: object) -> Checks:
    checks = Checks(**read_named(f"{what}.", read_table(what, value), _CHECKS))
    if checks.margins.keys() != checks.samples.keys():
        raise InputError(
            f"{what}: margins and samples name other estimators; name the same in both"
        )
    return checks


def _by_estimator(read: Reader[_Value]) -> Reader[dict[str, _Value]]:
    """Return a reader of values by the estimators that can check a reference."""
    names = dict.fromkeys(Checks().margins, read)
    return lambda what, value: read_named(f"{what}.", read_table(what, value), names)


_seconds = partial(read_number, least=0, most=_LONGEST)

#: Readers of the values of a study file by the names of the fields that they fill: of the study,
#: its measurements, its random scenes, and the checks of its references.
_STUDY: Mapping[str, Reader[Any]] = {
    "name": read_word,
    "half": several(read_word, 0),
    "sizes": several(_size),
    "media": several(_medium),
    "points": partial(read_whole, least=1, most=1024),
    "flip": _flip,
    "timed": partial(read_whole, least=1, most=_MOST_SCENES),
    "limit": partial(read_number, least=1e-3, most=_LONGEST),
    "retries": partial(read_whole, least=0, most=100),
    "checks": _checks,
    "stability": partial(read_whole, least=0, most=_MOST_RAYS),
    "growth": several(partial(read_one_of, names=GROWTH), 0),
}
_MEASURE: Mapping[str, Reader[Any]] = {
    "times": partial(read_one_of, names=TIMES),
    "timed_size": _size,
    "seconds": _seconds,
    "slow": _seconds,
    "frame_limit": _seconds,
    "metrics": lambda what, value: read_one_of(what, value, names=("usual", "all")) == "all",
}
_RANDOM: Mapping[str, Reader[Any]] = {
    "count": partial(read_whole, least=0, most=_MOST_SCENES),
    "first": partial(read_whole, least=0, most=2**62),
    "ranges": read_word,
}
_CHECKS: Mapping[str, Reader[Any]] = {
    "size": _size,
    "margins": _by_estimator(partial(read_number, least=1e-9, most=1)),
    "samples": _by_estimator(partial(read_whole, least=1, most=_MOST_SAMPLES)),
    "batches": partial(read_whole, least=2, most=1 << 16),
    "multiple": _pair,
    "patience": _seconds,
}
# of `Measure`, where they are not as in the file
_FIELDS = {"frame_limit": "limit", "metrics": "every_metric"}
