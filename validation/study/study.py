# SPDX-License-Identifier: BSD-3-Clause
"""A study: which scenes, methods, parameters, media and sizes, as a TOML file says it, and the cells that come of it.

    name = "steps"
    scenes = ["sphere-spot", "windows", "own/hall.xml"]     # built-in scenes and Mitsuba XML files
    sizes = ["160x120"]
    methods = ["shadow-planes", "ray-march"]                # or "all", one of each kind, or "standard", as `bench`
    kernels = ["exact", "taylor"]                           # of the methods that call one
    maps = [256, 1024]                                      # sides of shadow maps, of the methods that have one
    media = [{}, { "medium.sigma_t" = 0.17 }]               # changes as of `--change`; {} is the scene's own
    flip = false                                            # HDR-FLIP takes about a second a cell
    times = "with"                                          # or "none", or "alone"
    # timed = 150                                           # with "alone": how many scenes, the first; else all
    limit = 600                                             # seconds that a cell or a truth may take
    retries = 3                                             # how often a cell is begun again whose process died

    [random]
    count = 100                                             # random:0 to random:99
    first = 0
    meshes = "meshes"                                       # a folder, as of `--meshes`
    ranges = "ranges.toml"                                  # a file, as of `--ranges`

    [parameters.ray-march]
    steps = [16, 100]                                       # a list has a cell for each of its values
    shadow = "map"

A cell is one combination of all of these. Every mistake is refused by name before any work.
"""

import itertools
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from analytic.errors import InputError, nearest
from realtime.methods.registry import METHODS
from validation.random_scenes.ranges import ranges_from, read_ranges
from validation.scenes.changes import change_words
from validation.scenes.loading import parse_size
from validation.scenes.random_scene import PREFIX, is_random, random_name
from validation.scenes.registry import SCENES
from validation.study.configuration import QUICK, STANDARD, Configuration, configuration, find_kernel
from validation.study.row import TIMES

SIZE = (160, 120)  #: of the images where a study gives none [pixels]

_METHOD_SETS = ("all", "standard")
_LONGEST = 86400.0
_MOST_RETRIES = 100
_MOST_SCENES = 10_000_000


@dataclass(frozen=True)
class Cell:
    """One combination of a study: what becomes one row."""

    scene: str  #: built-in scene, 'random:SEED' or the path of a file
    size: tuple[int, int]  #: width and height [pixels]
    medium: tuple[str, ...]  #: changes of the medium, as `parse_changes` reads them
    chosen: Configuration
    flip: bool = False  #: whether HDR-FLIP is asked for
    times: str = "with"  #: one of `validation.study.row.TIMES`

    @property
    def image(self) -> "Cell":
        """The cell that stands for all cells of the same image, which share a truth."""
        return replace(self, chosen=Configuration("truth"), flip=False, times="none")


@dataclass(frozen=True)
class RandomScenes:
    """Which random scenes a study has."""

    count: int = 0
    first: int = 0  #: seed of the first
    meshes: Path | None = None  #: folder of meshes that take part
    ranges: Path | None = None  #: TOML file of what is drawn


@dataclass(frozen=True)
class Study:
    """What a study file says; the defaults are those of a study without a file."""

    name: str = "sweep"
    scenes: tuple[str, ...] = ()
    random: RandomScenes = RandomScenes()
    sizes: tuple[tuple[int, int], ...] = (SIZE,)
    configurations: tuple[Configuration, ...] = ()
    media: tuple[tuple[str, ...], ...] = ((),)
    flip: bool = False
    times: str = "with"
    timed: int | None = None  #: scenes that are timed alone, the first; None for all
    limit: float = 600.0  #: seconds that a cell or a truth may take
    retries: int = 3  #: how often a cell is begun again whose process died

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
        """What follows the seed in the names of its random scenes."""
        return random_name(PREFIX, self.random.meshes, self.random.ranges).removeprefix(PREFIX)

    def _drawn(self, name: str) -> bool:
        seed = seed_of(name)
        return seed in self._seeds and name == f"{PREFIX}{seed}{self._options}"

    def images(self) -> Iterator[tuple[Cell, ...]]:
        """Yield the cells of one image after the other: they share a truth."""
        for scene, size, medium in itertools.product(self.scene_names(), self.sizes, self.media):
            yield tuple(Cell(scene, size, medium, each, self.flip, self.times) for each in self.configurations)

    def timed_images(self) -> Iterator[tuple[Cell, ...]]:
        """Yield those `images` whose cells are timed alone."""
        if self.times != "alone":
            return iter(())
        count = None if self.timed is None else self.timed * len(self.sizes) * len(self.media)
        return itertools.islice(self.images(), count)


def default_configurations() -> tuple[Configuration, ...]:
    """Return what a study without methods measures: the kinds of the quick report, lights with extent as by default."""
    kinds = [each for each in QUICK if "points" not in dict(each.parameters)]
    known = {each.method for each in kinds}
    others = [name for name, record in METHODS.items() if name not in known and not record.renders_clouds]
    return (*kinds, *(configuration(name) for name in others))


def default_study(count: int, first: int = 0) -> Study:
    """Return the study without a file: `count` random scenes from a seed on, every method once, 160 x 120 pixels."""
    _number("--random", count, 1, _MOST_SCENES)
    scenes = RandomScenes(count, first)
    return Study(f"random-{count}", random=scenes, configurations=default_configurations())


def read_study(path: Path, *, count: int | None = None) -> Study:
    """Return the study of a TOML file; `count` random scenes in place of those that it names, if given.

    Raises
    ------
    InputError
        For a file that cannot be read, and for every name, type or value that a study cannot have.
    """
    try:
        text = path.read_text(encoding="utf-8")
        data = tomllib.loads(text)
    except FileNotFoundError:
        raise InputError(f"study: there is no file {path}; wanted a TOML file, see docs/many-scenes.md") from None
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise InputError(f"study {path}: it cannot be read: {error}") from error
    try:
        study = parse_study(data, folder=path.parent, name=path.stem)
        if count is not None:
            study = replace(study, random=replace(study.random, count=_number("--random", count, 1, _MOST_SCENES)))
        if not study.scene_count:
            raise InputError("it has no scene; give scenes = [...], or count in [random], or --random N")
    except InputError as error:
        raise InputError(f"study {path}: {error}") from error
    return study


def parse_study(data: Mapping[str, Any], *, folder: Path = Path(), name: str = "sweep") -> Study:
    """Return the study that a table describes.

    Parameters
    ----------
    data
        What `tomllib` reads.
    folder
        Where relative paths of scenes begin.
    name
        Of the study, where it gives none.

    Raises
    ------
    InputError
        As `read_study`.
    """
    known = ("name", "scenes", "random", "sizes", "methods", "kernels", "parameters", "maps", "media", "flip", "times")
    _known("", data, (*known, "timed", "limit", "retries"))
    sizes = tuple(parse_size(_word("sizes", size)) for size in _list("sizes", data.get("sizes", ["160x120"])))
    for size in sizes:
        if not all(1 <= side <= 16384 for side in size):
            raise InputError(f"sizes: got {size[0]}x{size[1]}, wanted at least 1x1 and at most 16384 pixels on a side")
    times = _one_of("times", data.get("times", "with"), TIMES)
    if "timed" in data and times != "alone":
        raise InputError(f'timed: it is of times = "alone", got times = "{times}"; leave one of them out')
    given = Study(
        name=_word("name", data.get("name", name)),
        scenes=tuple(_scene(item, folder) for item in _list("scenes", data.get("scenes", []), empty=True)),
        random=_random(data.get("random", {}), folder),
        sizes=_once("sizes", sizes),
        configurations=_configurations(data),
        media=_once("media", tuple(_medium(item) for item in _list("media", data.get("media", [{}])))),
        flip=_truth_value("flip", data.get("flip", False)),
        times=times,
        timed=_number("timed", data["timed"], 1, _MOST_SCENES) if "timed" in data else None,
        limit=float(_number("limit", data.get("limit", 600), 1e-3, _LONGEST, whole=False)),
        retries=_number("retries", data.get("retries", 3), 0, _MOST_RETRIES),
    )
    return replace(given, scenes=_once("scenes", given.scenes))


def _configurations(data: Mapping[str, Any]) -> tuple[Configuration, ...]:
    """Return the combinations of methods, kernels, maps and parameters."""
    parameters = _table("parameters", data.get("parameters", {}))
    asked = data.get("methods", "all")
    if isinstance(asked, str):
        _one_of("methods", asked, _METHOD_SETS)
        standard = STANDARD if asked == "standard" else default_configurations()
        if not (parameters or "kernels" in data or "maps" in data):
            return standard
        names = list(dict.fromkeys(each.method for each in standard))
    else:
        names = list(_once("methods", tuple(_word("methods", word) for word in _list("methods", asked))))
    for method in names:
        configuration(method)  # refuses unknown names
    stray = [method for method in parameters if method not in names]
    if stray:
        raise InputError(f"parameters.{stray[0]}: the study has no method of that name{nearest(stray[0], names)}")
    kernels = [_word("kernels", word) for word in _list("kernels", data["kernels"])] if "kernels" in data else [None]
    for kernel in kernels:
        if kernel is not None:
            find_kernel(kernel)
    sides = _list("maps", data["maps"]) if "maps" in data else [None]
    for side in sides:
        _number("maps", 1 if side is None else side, 1, 16384)
    chosen = [
        each
        for method in names
        for each in _of_method(method, kernels, sides, _table(f"parameters.{method}", parameters.get(method, {})))
    ]
    if "kernels" in data and not any(each.kernel for each in chosen):
        raise InputError("kernels: none of the methods calls one; leave them out")
    if "maps" in data and not any("map" in dict(each.parameters) for each in chosen):
        raise InputError("maps: none of the methods has a shadow map; leave them out")
    return tuple(dict.fromkeys(chosen))


def _of_method(
    method: str, kernels: Sequence[str | None], sides: Sequence[int | None], parameters: Mapping[str, Any]
) -> Iterator[Configuration]:
    """Yield the configurations of a method: kernels, maps and parameters, each with each."""
    if "map" in parameters and sides != [None]:
        raise InputError(f"parameters.{method}.map: `maps` says it too; give one of them")
    lists = {name: value if isinstance(value, list) else [value] for name, value in parameters.items()}
    for name, several in lists.items():
        if not several:
            raise InputError(f"parameters.{method}.{name}: got no value; leave it out for the default")
    has_map = "map" in METHODS[method].defaults if method in METHODS else False
    if has_map and sides != [None]:
        lists["map"] = list(sides)
    for combination in itertools.product(*lists.values()):
        settings = dict(zip(lists, combination))
        plain = configuration(method, None, settings)
        if "map" in lists and sides != [None] and map_side(plain) is None:  # parameters do without a map
            plain = configuration(method, None, {name: value for name, value in settings.items() if name != "map"})
        for kernel in kernels if plain.kernel else [None]:
            yield configuration(method, kernel, dict(plain.parameters))


def seed_of(scene: str) -> int | None:
    """Return the seed of a random scene; None for others."""
    seed = scene.removeprefix(PREFIX).partition(",")[0]
    return int(seed) if is_random(scene) and seed.isascii() and seed.isdigit() else None


def map_side(chosen: Configuration) -> int | None:
    """Return the side of the shadow map of a configuration [pixels]; None for a method without one."""
    if chosen.method not in METHODS:
        return None
    known = METHODS[chosen.method].defaults | dict(chosen.parameters)
    uses = "map" in known and known.get("shadow", "map") == "map"
    return int(known["map"]) if uses and isinstance(known["map"], int) else None


def _scene(item: Any, folder: Path) -> str:
    word = _word("scenes", item)
    if word in SCENES:
        if SCENES[word].clouds:
            raise InputError(f"scenes: {word} scatters light many times; a sweep is of single scattering, leave it out")
        return word
    if is_random(word):
        if seed_of(word) is None:
            raise InputError(f"scenes: got {word!r}, wanted random:SEED with a whole number from 0 on")
        return word
    path = folder / word
    if not path.is_file():
        raise InputError(
            f"scenes: got {word!r}, wanted a built-in scene, random:SEED or a Mitsuba XML file beside the study"
            + nearest(word, SCENES)
        )
    return str(path.resolve())


def _random(table: Any, folder: Path) -> RandomScenes:
    given = _table("random", table)
    _known("random.", given, [item.name for item in fields(RandomScenes)])
    count = _number("random.count", given.get("count", 0), 0, _MOST_SCENES)
    first = _number("random.first", given.get("first", 0), 0, 2**62)
    places = {name: folder / _word(f"random.{name}", given[name]) for name in ("meshes", "ranges") if name in given}
    drawn = RandomScenes(count, first, **{name: place.resolve() for name, place in places.items()})
    if drawn.ranges is not None:
        read_ranges(drawn.ranges)  # refuses what cannot be drawn
    if drawn.meshes is not None:
        ranges_from({"meshes": str(drawn.meshes)}, "random")
    return drawn


def _medium(item: Any) -> tuple[str, ...]:
    changes: dict[str, tuple[float, ...]] = {}
    for name, value in _table("media", item).items():
        if not name.partition(".")[0].startswith("medium"):
            raise InputError(f"media: got {name!r}, wanted medium.sigma_t, medium.albedo or medium.g; quote the name")
        numbers = value if isinstance(value, list) else [value]
        if not numbers or not all(type(number) in (int, float) for number in numbers):
            raise InputError(f"media: got {value!r} for {name}, wanted a number or a list of numbers")
        changes[name] = tuple(float(number) for number in numbers)
    return tuple(change_words(changes))


def _known(prefix: str, data: Mapping[str, Any], names: Sequence[str]) -> None:
    for name in data:
        if name not in names:
            raise InputError(f"got {prefix}{name}, wanted one of {', '.join(names)}{nearest(name, names)}")


def _table(what: str, value: Any) -> Mapping[str, Any]:
    if not isinstance(value, dict):
        raise InputError(f"{what}: got {value!r}, wanted a table of names and values")
    return value


def _list(what: str, value: Any, *, empty: bool = False) -> list[Any]:
    if not isinstance(value, list) or not (value or empty):
        raise InputError(f"{what}: got {value!r}, wanted a list" + ("" if empty else " with at least one entry"))
    return value


def _word(what: str, value: Any) -> str:
    if not isinstance(value, str) or not value.strip():
        raise InputError(f"{what}: got {value!r}, wanted a word")
    return value


def _one_of(what: str, value: Any, names: Sequence[str]) -> str:
    if value not in names:
        raise InputError(f"{what}: got {value!r}, wanted one of {', '.join(names)}")
    return value


def _truth_value(what: str, value: Any) -> bool:
    if not isinstance(value, bool):
        raise InputError(f"{what}: got {value!r}, wanted true or false")
    return value


def _number(what: str, value: Any, least: float, most: float, *, whole: bool = True) -> Any:
    if type(value) not in ((int,) if whole else (int, float)) or not least <= value <= most:
        kind = "a whole number" if whole else "a number"
        raise InputError(f"{what}: got {value!r}, wanted {kind} from {least:g} to {most:g}")
    return value


def _once(what: str, items: tuple[Any, ...]) -> tuple[Any, ...]:
    for number, item in enumerate(items):
        if item in items[:number]:
            raise InputError(f"{what}: {item!r} is there twice; leave one out")
    return items
