# SPDX-License-Identifier: BSD-3-Clause
"""The words of a model's terms: what each may be, and the one way in which equal values are written.

A reader takes the name of its term, for messages, and the words of a user. It returns the words
that a `reference.scene.model.Model` keeps, or refuses them.
"""

import math
from collections.abc import Callable, Mapping

from airlight.analytic.phase import phase_from_words
from airlight.errors import InputError

SURFACE = "surface_"  #: what the fields of terms of surfaces begin with


def word_of(field: str) -> str:
    """Return the word of a term by the name of its field."""
    surface = field.startswith(SURFACE)
    return "surface." * surface + field.removeprefix(SURFACE if surface else "").replace("_", "-")


def wrong(term: str, value: str, expected: str) -> InputError:
    """Return the refusal of a term."""
    return InputError(f"model: {term} is '{value}'; expected {expected}")


def _numbers(term: str, cells: list[str], value: str, expected: str) -> list[float]:
    try:
        numbers = [float(cell) + 0.0 for cell in cells]  # -0 is 0
    except ValueError:
        raise wrong(term, value, expected) from None
    if any(math.isnan(number) or number < 0 for number in numbers):
        raise wrong(term, value, f"{expected}, and no number below 0")
    return numbers


def split(words: str) -> tuple[str, tuple[float, ...]]:
    """Return the kind of a value that was read, and its numbers."""
    kind, _, rest = words.partition(":")
    return kind, tuple(float(cell) for cell in rest.replace(",", ":").split(":") if cell)


def _text(number: float) -> str:
    return f"{number:.12g}" if float(f"{number:.12g}") == number else repr(number)


def switch(word: str) -> float:
    """Return the factor of a path that was read."""
    return {"on": 1.0, "off": 0.0}[word] if word in ("on", "off") else float(word)


def light_path(word: str) -> tuple[float, float]:
    """Return the fraction b and the length M of a light path that was read."""
    return (0.0, split(word)[1][0]) if word.startswith("length") else (switch(word), 0.0)


def _path(*, length: bool, most: float) -> Callable[[str, str], str]:
    expected = "on, off, or a factor" if most > 1 else "on, off, or a fraction from 0 to 1"
    expected += ", or length:M in metres" if length else ""

    def read(term: str, value: str) -> str:
        word = value.strip().lower()
        if word in ("on", "off"):
            return word
        kind, _, rest = word.partition(":")
        if length and kind == "length":
            (number,) = _numbers(term, [rest], value, expected)
            if math.isinf(number):
                raise wrong(term, value, expected)
            return f"length:{_text(number)}"
        (number,) = _numbers(term, [word], value, expected)
        if not number <= most or math.isinf(number):
            raise wrong(term, value, expected)
        return {0.0: "off", 1.0: "on"}.get(number, _text(number))

    return read


def _choice(
    kinds: Mapping[str, tuple[float | None, ...]], expected: str, positive: bool = True
) -> Callable[[str, str], str]:
    """Return a reader of kinds with numbers: None for one that is needed, else its default."""

    def read(term: str, value: str) -> str:
        kind, *cells = value.strip().lower().replace(",", ":").split(":")
        if kind not in kinds:
            raise wrong(term, value, expected)
        defaults = kinds[kind]
        given = _numbers(term, cells, value, expected)
        needed = sum(default is None for default in defaults)
        if not needed <= len(given) <= len(defaults):
            raise wrong(term, value, expected)
        numbers = [*given, *defaults[len(given) :]]
        if positive and any(number == 0 for number in given[:1]):
            raise wrong(term, value, f"{expected}, with numbers above 0")
        return ":".join([kind, *(_text(number) for number in numbers if number is not None)])

    return read


def _range(term: str, value: str) -> str:
    word = _choice(_WINDOWS, "none, or quartic:R, fourth:R, square:R, linear:R or cut:R")(
        term, value
    )
    # Lamps that shine without an end have no range.
    return "none" if word.endswith(":inf") else word


def _law(term: str, value: str) -> str:
    expected = "power:d, softened:e[:s], clamped:r0[:d] or sphere:R0"
    kinds: dict[str, tuple[float | None, ...]] = {
        "power": (2.0,),
        "softened": (None, 1.0),
        "clamped": (None, 2.0),
        "sphere": (None,),
    }
    word = _choice(kinds, expected, positive=False)(term, value)
    if any(math.isinf(number) for number in split(word)[1]):
        raise wrong(term, value, expected)
    # Lengths of 0 leave a power.
    kind, numbers = split(word)
    if kind == "clamped" and numbers[0] == 0:
        return f"power:{_text(numbers[1])}"
    if (kind == "sphere" and numbers == (0.0,)) or (kind == "softened" and numbers == (0.0, 1.0)):
        return "power:2"
    return word


def _surface_law(term: str, value: str) -> str:
    return "same" if value.strip().lower() == "same" else _law(term, value)


def _surface_path(read: Callable[[str, str], str]) -> Callable[[str, str], str]:
    return lambda term, value: "same" if value.strip().lower() == "same" else read(term, value)


def _phase(term: str, value: str) -> str:
    word = value.strip().lower()
    if word not in ("scene", "none", "cornette-shanks"):
        phase_from_words(word)  # refuses what is none
    return word


def _ends(term: str, value: str) -> str:
    expected = "none, planes:NEAR:FAR or spheres:NEAR:FAR"
    if value.strip().lower() == "none":
        return "none"
    word = _choice({"planes": (None, None), "spheres": (None, None)}, expected, positive=False)(
        term, value
    )
    near, far = split(word)[1]
    if not near < far:
        raise wrong(term, value, f"{expected}, FAR behind NEAR")
    return "none" if (near, far) == (0.0, math.inf) else word


def _fade(term: str, value: str) -> str:
    expected = "none, or START:END in metres, one behind the other"
    if value.strip().lower() == "none":
        return "none"
    numbers = _numbers(term, value.split(":"), value, expected)
    if len(numbers) != 2 or not numbers[0] < numbers[1] < math.inf:
        raise wrong(term, value, expected)
    return ":".join(map(_text, numbers))


def _colour(term: str, value: str, expected: str) -> str:
    cells = value.split(",") if "," in value else value.split(":")
    numbers = _numbers(term, cells, value, expected)
    if len(numbers) == 1:
        numbers *= 3
    if len(numbers) != 3 or not all(math.isfinite(number) for number in numbers):
        raise wrong(term, value, expected)
    return ",".join(map(_text, numbers))


def _source(term: str, value: str) -> str:
    expected = "lights, or constant:R,G,B"
    kind, _, rest = value.strip().lower().partition(":")
    if kind == "lights" and not rest:
        return "lights"
    if kind != "constant":
        raise wrong(term, value, expected)
    return f"constant:{_colour(term, rest, expected)}"


def _cap(term: str, value: str) -> str:
    word = _number("none", 0.0, 1.0, "none, or a number from 0 to 1")(term, value)
    return "none" if word == "1" else word  # all that a source can cover


def _ambient(term: str, value: str) -> str:
    word = value.strip().lower()
    if word == "none":
        return word
    colour = _colour(term, word, "none, or R,G,B")
    return "none" if colour == "0,0,0" else colour


def _lobe(term: str, value: str) -> str:
    if value.strip().lower() == "none":
        return "none"
    expected = "none, or n[:START]"
    numbers = _numbers(term, value.split(":"), value, expected)
    if not 1 <= len(numbers) <= 2 or not all(math.isfinite(number) for number in numbers):
        raise wrong(term, value, expected)
    return ":".join(map(_text, (*numbers, 0.0)[:2]))


def _number(none: str, least: float, most: float, expected: str) -> Callable[[str, str], str]:
    def read(term: str, value: str) -> str:
        if value.strip().lower() == none:
            return none
        (number,) = _numbers(term, [value], value, expected)
        if not least <= number <= most or math.isinf(number):
            raise wrong(term, value, expected)
        return _text(number)

    return read


_WINDOWS: Mapping[str, tuple[float | None, ...]] = {
    "none": (),
    "quartic": (None,),
    "fourth": (None,),
    "square": (None,),
    "linear": (None,),
    "cut": (None,),
}
_EDGES: Mapping[str, tuple[float | None, ...]] = {
    "angle": (),
    "cosine-squared": (),
    "cosine-smooth": (),
    "rim": (1.0,),
}
_DEPTHS: Mapping[str, tuple[float | None, ...]] = {
    "distance": (),
    "axis": (),
    "axis-ends": (),
    "axis-lookup": (),
}

#: By the name of a field, what reads its words; in the order in which terms are told.
READERS: Mapping[str, Callable[[str, str], str]] = {
    "light_path": _path(length=True, most=1.0),
    "camera_path": _path(length=False, most=math.inf),
    "law": _law,
    "range": _range,
    "spot": _choice(_EDGES, "angle, cosine-squared, cosine-smooth or rim:k"),
    "phase": _phase,
    "depth": _choice(_DEPTHS, "distance, axis, axis-ends or axis-lookup"),
    "ends": _ends,
    "fade": _fade,
    "source": _source,
    "cap": _cap,
    "lobe": _lobe,
    "ambient": _ambient,
    "lit": _number("off", 1e-300, 1e300, "off, or a number above 0"),
    "lamps": _number("1", 0.0, 1e300, "a factor"),
    "suns": _number("1", 0.0, 1e300, "a factor"),
    "surface_light_path": _surface_path(_path(length=False, most=1.0)),
    "surface_camera_path": _surface_path(_path(length=False, most=math.inf)),
    "surface_law": _surface_law,
    "surface_factor": _number("1", 0.0, 1e300, "a factor"),
}
