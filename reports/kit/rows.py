# SPDX-License-Identifier: BSD-3-Clause
"""The certified rays of the kit: which rows of which file, and how close a test has to come.

A group is a quantity that a function under test returns for a row. The numbers of a row are the
words of the certified file, and are never read and printed again.
"""

import csv
import json
import math
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace

from airlight.validation.certified.files import certified_data

#: Relative tolerance in double precision. The certified values have 15 digits or more, and the
#: inputs are exact. A quadrature that has converged reaches 1e-12; 1e-9 leaves room for the
#: rounding of rays that pass a light closely, and no fault of an equation is that small.
DOUBLE = 1e-9
#: Relative tolerance in single precision of rays without cancellation: the error that the exported
#: kernel has at most on a device that rounds as Vulkan permits (`realtime.export.text.CONFORMING`).
SINGLE = 3e-5
#: Four roundings of single precision, times the factor by which a ray amplifies them.
ROUNDING = 2.0**-22
#: The largest such factor. Single precision keeps three digits there; beyond, a row would judge the
#: rounding and not the equation.
LARGEST = 1e4
#: The smallest value: float32 holds it with all its digits, also times sigma_t and an albedo.
SMALLEST = 1e-20

Cells = Mapping[str, str]


@dataclass(frozen=True)
class Column:
    """An input of a row."""

    name: str
    meaning: str  #: with its unit
    words: tuple[str, ...] = ()  #: the words that it may have; without any it is a number


@dataclass(frozen=True)
class Row:
    """A certified ray."""

    line: int  #: in its file: of the text, or of the list in JSON, from 1
    cells: tuple[str, ...]  #: the inputs, as the file has them
    value: str  #: as the file has it
    single: float  #: relative tolerance in single precision


@dataclass(frozen=True)
class Group:
    """Rows of one quantity."""

    name: str
    value: str  #: the quantity with its unit, as a formula
    file: str
    choice: str  #: which rows, and why
    reason: str  #: of the tolerance in single precision
    columns: tuple[Column, ...]
    rows: tuple[Row, ...] = ()

    def cells(self, row: Row) -> dict[str, str]:
        """Return the inputs of a row by name."""
        return dict(zip((column.name for column in self.columns), row.cells, strict=True))


def _numbers(words: str, meaning: str) -> tuple[Column, ...]:
    return tuple(Column(name, meaning) for name in words.split())


_ENDS = (
    Column("x0", "where the ray begins [m]"),
    Column("x1", "where it ends [m]; infinite: it has no end"),
)
_SIGMA = Column("sigma_t", "extinction [1/m]")
_G = Column("g", "mean cosine of Henyey and Greenstein's phase function, positive forward")
_RAY = (
    *_numbers("ox oy oz", "origin of the ray [m]"),
    *_numbers("dx dy dz", "its direction; divide by its length"),
    *_numbers("lx ly lz", "the light [m]"),
)
_FOOT = (
    Column("foot", "distance along the ray to the foot of the light's perpendicular [m]"),
    Column("height", "distance of the light from the ray [m]"),
)
_LOBES = (Column("phase", "phase function of mean 1", ("isotropic", "rayleigh", "hg")), _G)
_LAWS = ("power", "softened", "clamped", "sphere")
_WINDOWS = ("none", "quartic", "fourth", "square", "linear", "cut")
_CLOSE = (
    "3e-5, the error of the exported kernel on any device that keeps the bounds of Vulkan, and "
    "2^-22 (four roundings)"
)
#: Factors by which roundings grow.
_LOBE = "2/(1 - |g|)^2 (the lobe of the phase function)"
_NEAR = "2 distance/height of the light (the height of a ray that passes it closely cancels)"
_SHORT = "distance/(x1 - x0) (the length of a short ray cancels)"
_J = "J = int_x0^x1 exp(-sigma_t (x + r)) p(cos) / r^2 dx  [1/m]"


def groups() -> tuple[Group, ...]:
    """Return the groups of the kit."""
    return (_rays(), _feet(), _heights(), _points(), _spheres(), _models())


def _rays() -> Group:
    columns = (
        *_LOBES,
        *_RAY,
        *_ENDS,
        _SIGMA,
    )
    return _group(
        Group(
            "ray",
            f"{_J}, by ray and light",
            "airlight_integral_rays.csv",
            "the first 45 of each phase function that engines have",
            f"{_CLOSE} times {_NEAR} + {_LOBE} + {_SHORT}",
            columns,
        ),
        kind=lambda row: row["phase"],
        most=45,
        amplified=lambda row: 2 * _closeness(row) + _lobe(row) + _shortness(row),
    )


def _feet() -> Group:
    columns = (
        *_LOBES,
        *_FOOT,
        *_ENDS,
        _SIGMA,
    )
    return _group(
        Group(
            "foot",
            f"{_J}, by foot and height",
            "airlight_integral.csv",
            "the first 2 of each kind (beside the light, behind it, far, thick, ...) and phase "
            "function that engines have",
            f"{_CLOSE} times {_LOBE} + {_SHORT}",
            columns,
        ),
        kind=lambda row: row["tag"] + row["phase"],
        most=2,
        amplified=lambda row: _lobe(row) + _shortness(row),
        renamed={"t": "foot", "h": "height"},
    )


def _heights() -> Group:
    layers = [
        column
        for i in "12"
        for column in (
            Column(f"sigma_{i}", f"extinction of layer {i} at its base [1/m]"),
            Column(f"z_{i}", "its base [m]"),
            Column(f"H_{i}", "its scale height [m]"),
        )
    ]
    columns = (
        Column("light", "a point light, or a sun in the direction l", ("point", "sun")),
        Column("clamped", "1: below its base a layer has the extinction of its base"),
        _G,
        *_RAY,
        *_ENDS,
        *layers,
        Column("sigma_0", "constant extinction [1/m]"),
    )
    return _group(
        Group(
            "height_fog",
            "K = int_x0^x1 sigma(z) exp(-depth of both ways) p(cos) / r^2 dx  [1/m^2], of a sun "
            "without 1/r^2 and [1]; z is up, sigma(z) = sigma_0 + sum sigma_i exp(-(z - z_i)/H_i)",
            "height_fog_rays.csv",
            "the first 8 of each kind (grazing, near the light, above and below the base, suns, "
            "...) that single precision can hold",
            f"{_CLOSE} times coordinates/height of the light (positions are doubles, and are rounded) "
            f"+ {_LOBE} + {_SHORT} + 10 largest |z - z_i|/H_i (exponents of the density at the ends "
            "of both ways)",
            columns,
        ),
        kind=lambda row: row["tag"],
        most=8,
        amplified=lambda row: _places(row) + _lobe(row) + _shortness(row) + 10 * _steepness(row),
    )


def _points() -> Group:
    columns = (
        *_FOOT,
        *_ENDS,
        _SIGMA,
        _G,
        Column("axial", "component of the light's normal along the ray"),
        Column("across", "component of the normal from the light to its foot on the ray"),
    )
    return _group(
        Group(
            "area_point",
            "J of a point of an area light: the integrand of J times the cosine to its normal, "
            "where that is positive  [1/m]",
            "certified_area_lights.json:points",
            "all of them",
            f"{_CLOSE} times {_LOBE}",
            columns,
        ),
        amplified=_lobe,
        renamed={"J": "value"},
    )


def _spheres() -> Group:
    columns = (
        _SIGMA,
        *_FOOT,
        Column("radius", "radius of the sphere [m]; its centre is at the foot and height"),
        *_ENDS,
    )
    return _group(
        Group(
            "sphere",
            "K = int_x0^x1 exp(-sigma_t x) int exp(-sigma_t l) dw dx  [m], over the directions w "
            "to a sphere of radiance 1 at the distance l; isotropic",
            "certified_area_lights.json:spheres",
            "all of them",
            "3e-5",
            columns,
        ),
        amplified=lambda row: 0.0,
        renamed={"K": "value"},
    )


def _models() -> Group:
    columns = (
        Column("light", "a lamp, or a sun over an exponential layer", ("lamp", "sun")),
        *_FOOT,
        *_ENDS,
        _SIGMA,
        _G,
        Column("a", "fraction of the depth between camera and fog that attenuates"),
        Column("b", "fraction of the depth between fog and light that attenuates"),
        Column("path", "a constant length beside both [m]"),
        Column("law", "distance law f(r)", _LAWS),
        *_numbers("length power scale", "its parameters"),
        Column("window", "factor w(r) that ends the light", _WINDOWS),
        Column("end", "the distance at which it ends [m]"),
        Column("rise", "of a sun: rise of the ray"),
        Column("mu", "of a sun: its height"),
        Column("H", "of a sun: scale height of the layer [m]"),
    )
    return _group(
        Group(
            "model",
            "K = int_x0^x1 exp(-sigma_t (a x + b r + path)) p(cos) f(r) w(r) dx, of a sun "
            "int_x0^x1 sigma(z) exp(-a depth before - b depth to the sun) dx",
            "model_rays.csv",
            "the first 5 of each light, law and window; some end before the ray and are 0",
            f"{_CLOSE} times {_LOBE} + {_SHORT} + 10 end/(height + 0.01 end) (where the window "
            "ends, 1 - (r/end)^n cancels)",
            columns,
        ),
        kind=lambda row: row["light"] + row["law"] + row["window"],
        most=5,
        amplified=lambda row: _lobe(row) + _shortness(row) + 10 * _ending(row),
    )


def _group(
    group: Group,
    *,
    amplified: Callable[[Cells], float],
    kind: Callable[[Cells], str] = lambda row: "",
    most: int = 1_000_000,  # all
    renamed: Mapping[str, str] | None = None,
) -> Group:
    """Return a group with its rows: at most so many of a kind, in the order of the file."""
    counted: Counter[str] = Counter()
    rows: list[Row] = []
    for line, given in _read(group.file):
        row = {(renamed or {}).get(name, name): cell for name, cell in given.items()}
        # Rows that the group has no word for, those of a vacuum, which have no radiance, and those
        # that single precision cannot hold.
        if any(column.words and row[column.name] not in column.words for column in group.columns):
            continue
        if float(row.get("sigma_t", "1")) == 0:
            continue
        factor = amplified(row)
        if 0 < abs(float(row["value"])) < SMALLEST or factor > LARGEST:
            continue
        counted[kind(row)] += 1
        if counted[kind(row)] > most:
            continue
        cells = tuple(row[column.name] for column in group.columns)
        single = float(f"{SINGLE + ROUNDING * factor:.2g}")
        rows.append(Row(line, cells, row["value"], single))
    return replace(group, file=group.file.partition(":")[0], rows=tuple(rows))


def _read(file: str) -> Iterator[tuple[int, dict[str, str]]]:
    """Yield the rows of a file with their lines, all cells as words."""
    name, _, part = file.partition(":")
    if not part:
        with certified_data(name).open(newline="", encoding="utf-8") as stream:
            yield from enumerate(csv.DictReader(stream), start=2)
        return
    # Numbers of JSON stay the words that they are; no mean cosine is that of isotropic fog.
    text = certified_data(name).read_text(encoding="utf-8")
    for line, row in enumerate(json.loads(text, parse_float=str)[part], start=1):
        yield line, {key: "0.0" if value is None else str(value) for key, value in row.items()}


def _vector(row: Cells, point: str) -> list[float]:
    return [float(row[point + axis]) for axis in "xyz"]


def _closeness(row: Cells) -> float:
    """Return the distance of a light over its height over the ray."""
    origin, light = (_vector(row, point) for point in "ol")
    return math.dist(origin, light) / _height(row)


def _places(row: Cells) -> float:
    """Return the coordinates of a light and of a ray over their distance; 0 of a sun."""
    if row["light"] == "sun":
        return 0.0
    return sum(math.hypot(*_vector(row, point)) for point in "ol") / _height(row)


def _height(row: Cells) -> float:
    """Return the height of a light over the ray [m]."""
    origin, way, light = (_vector(row, point) for point in "odl")
    away = [a - b for a, b in zip(light, origin, strict=True)]
    across = [
        away[i - 2] * way[i - 1] - away[i - 1] * way[i - 2] for i in range(3)
    ]  # the product of both vectors
    return math.hypot(*across) / math.hypot(*way)


def _shortness(row: Cells) -> float:
    """Return the distance of a light and of the end of a ray over the length of the ray."""
    x0, x1 = float(row["x0"]), float(row["x1"])
    if math.isinf(x1):
        return 1.0
    if "lx" in row:
        distance = (
            math.dist(_vector(row, "o"), _vector(row, "l")) if row.get("light") != "sun" else 0
        )
    else:
        distance = abs(float(row["foot"]))
    return (x1 + distance) / (x1 - x0)


def _lobe(row: Cells) -> float:
    return float(2 / (1 - abs(float(row["g"]))) ** 2)


def _steepness(row: Cells) -> float:
    """Return the largest exponent of a density at the ends of a ray and at a light."""
    z, rise = float(row["oz"]), float(row["dz"])
    ends = [z, *(z + float(row[x]) * rise for x in ("x0", "x1") if math.isfinite(float(row[x])))]
    ends += [float(row["lz"])] if row["light"] == "point" else []
    return max(abs(end - float(row[f"z_{i}"])) / float(row[f"H_{i}"]) for end in ends for i in "12")


def _ending(row: Cells) -> float:
    end, height = float(row["end"]), float(row["height"])
    return end / (height + 0.01 * end) if math.isfinite(end) else 0.0
