# SPDX-License-Identifier: BSD-3-Clause
"""The equation of a renderer as terms: facts about it, and no physics.

An engine does not solve the physical equation. It leaves the light path out, softens the distance
law, or gives lights a range. A `Model` says which equation it solves. With the distance x along a
ray from the camera, r from a light, the optical depths tau_c from the camera and tau_l from the
light, and V the visibility, a lamp of intensity I adds

    L = lamps  int_near^end  q(x) albedo sigma_t p/(4 pi) I edge f(r) w(r) V
                             exp(-a tau_c - b tau_l - sigma_t M) dx,

and a sun of irradiance E adds the same with E for I edge f(r) w(r), and `suns` for `lamps`. The terms:

    light-path     on, off, a fraction b of the depth, or length:M, a constant length M [m] with the
                   extinction at the point, and b = 0
    camera-path    on, off, or a fraction a of the depth
    law            f(r): power:d = r^-d; softened:e[:s] = s/(r^2 + e), e in [m^2]; clamped:r0[:d] =
                   max(r, r0)^-d; sphere:R0 = 2/(r^2 + R0^2 + r sqrt(r^2 + R0^2)), a disk of the
                   radius R0 that faces every point
    range          w(r), with s = r/R, and 0 beyond R: quartic:R = (1 - s^4)^2; fourth:R = 1 - s^4;
                   square:R = (1 - s^2)^2; linear:R = 1 - s; cut:R = 1
    spot           the edge of spots from the cosines c, cb and cc of the angle to the axis, of the
                   beam and of the cutoff: angle, Mitsuba's, linear in the angle; with
                   t = (c - cc)/(cb - cc) within 0 and 1, cosine-squared = t^2, cosine-smooth =
                   t^2 (3 - 2 t); rim:k = 1 - ((1 - c)/(1 - cc))^k
    phase          scene; a phase function by name, such as hg:0.3; cornette-shanks, with the g of
                   the scene; none: lamps scatter without one, p = 4 pi, and suns keep theirs
    depth          distance; axis: the depth z along the camera's axis stands for x in attenuation
                   and steps; axis-ends: rays end at the depth of the surface, taken for a distance;
                   axis-lookup: they end where the depth is the distance of the surface
    ends           none; planes:NEAR:FAR or spheres:NEAR:FAR: the fog begins and ends there [m]
    fade           none; START:END: q falls along a line in the depth z, 1 at START and 0 at END [m];
                   it is above 1 before START, and no ambient light or constant source has it
    source         lights; constant:R,G,B: C (1 - exp(-a tau_c)) and no light of lamps and suns
    cap            none; the most that 1 - exp(-a tau_c) of a constant source can be
    lobe           none; n[:START]: each sun adds E max(cos, 0)^n (1 - exp(-a tau_c)) to a constant
                   source, from the distance START on [m], cos that of the angle between ray and sun
    ambient        none; R,G,B: A adds int albedo sigma_t A exp(-a tau_c) dx [W/(m^2 sr)]
    lit            off; k: L = 1 - exp(-k X), X the sum over lights without the albedo: what is lit
                   is what is dense
    lamps, suns    factors on the light of lamps and of suns in the fog
    surface.*      of surfaces: light-path (on, off or a fraction), camera-path, law; `same` as in
                   the fog, where a constant length counts as off. Ranges and edges of spots hold
                   for surfaces too, and surface.factor multiplies what they reflect

Two estimators know these terms, each by a derivation of its own; `volpath` knows the physical
equation alone.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from functools import cached_property

from airlight.analytic.phase import phase_from_words
from airlight.errors import InputError, nearest

#: fields and words of terms: 'light_path' is 'light-path', 'surface_law' is 'surface.law'
SURFACE = "surface_"


@dataclass(frozen=True)
class Law:
    """How the light of a lamp falls with the distance."""

    kind: str  #: power, softened, clamped or sphere
    length: float = 0.0  #: sqrt(e) of a softened law, r0 of a clamped one, R0 of a sphere [m]
    power: float = 2.0  #: d, 2 of softened ones and of spheres
    scale: float = 1.0  #: s of a softened law

    @property
    def is_physical(self) -> bool:
        """Whether it is the inverse square."""
        return (self.kind == "power" or self.length == 0) and self.power == 2 and self.scale == 1

    @property
    def is_finite(self) -> bool:
        """Whether it is finite at the light. (Rays through a light of a power below 1 would have a
        sum too, which no panel reaches.)
        """
        return self.length > 0


@dataclass(frozen=True)
class Range:
    """Up to where lamps shine."""

    kind: str  #: quartic, fourth, square, linear or cut
    end: float  #: R [m]


@dataclass(frozen=True)
class Ends:
    """Where the fog begins and ends before the camera."""

    near: float = 0.0  #: [m]
    far: float = math.inf  #: [m]
    planes: bool = False  #: across the camera's axis; else distances from the camera


@dataclass(frozen=True)
class Lobe:
    """A power of the cosine about the direction of a sun."""

    power: float
    start: float = 0.0  #: distance from which on it counts [m]


@dataclass(frozen=True)
class Model:
    """The equation that a renderer solves, by terms; the physical equation by default.

    Parameters
    ----------
    light_path
        on, off, a fraction from 0 to 1, or length:M [m].
    camera_path
        on, off, or a factor from 0 on.
    law
        power:d, softened:e[:s] [m^2], clamped:r0[:d] [m] or sphere:R0 [m].
    range
        none, or quartic:R, fourth:R, square:R, linear:R or cut:R [m].
    spot
        angle, cosine-squared, cosine-smooth or rim:k.
    phase
        scene, cornette-shanks, none, or the words of a phase function.
    depth
        distance, axis, axis-ends or axis-lookup.
    ends
        none, planes:NEAR:FAR or spheres:NEAR:FAR [m].
    fade
        none, or START:END [m].
    source
        lights, or constant:R,G,B [W/(m^2 sr)].
    cap
        none, or a number from 0 to 1.
    lobe
        none, or n[:START].
    ambient
        none, or R,G,B [W/(m^2 sr)].
    lit
        off, or a number above 0.
    lamps, suns
        Factors on their light in the fog [1].
    surface_light_path, surface_camera_path, surface_law
        Those of surfaces; same: as in the fog.
    surface_factor
        Factor on the light of surfaces [1].
    name
        The name in results; empty for terms without a name.

    Raises
    ------
    InputError
        For words that no term has, and numbers out of range.

    Examples
    --------
    >>> import airlight
    >>> model = airlight.Model(light_path="off", law="softened:1:16")
    >>> model.terms
    'light-path=off,law=softened:1:16'
    """

    light_path: str = "on"
    camera_path: str = "on"
    law: str = "power:2"
    range: str = "none"
    spot: str = "angle"
    phase: str = "scene"
    depth: str = "distance"
    ends: str = "none"
    fade: str = "none"
    source: str = "lights"
    cap: str = "none"
    lobe: str = "none"
    ambient: str = "none"
    lit: str = "off"
    lamps: str = "1"
    suns: str = "1"
    surface_light_path: str = "same"
    surface_camera_path: str = "same"
    surface_law: str = "same"
    surface_factor: str = "1"
    name: str = ""

    def __post_init__(self) -> None:
        # Words of one meaning become one, so that equal models have equal keys.
        for field in fields(self):
            if field.name != "name":
                word = _READERS[field.name](word_of(field.name), str(getattr(self, field.name)))
                object.__setattr__(self, field.name, word)
        if self.cap != "none" and not self.constant:
            raise _wrong("cap", self.cap, "a constant source beside it")
        if self.lobe != "none" and not self.constant:
            raise _wrong("lobe", self.lobe, "a constant source beside it")
        # Without attenuation and without an end the light of a lamp must fall as 1/r^2 at least.
        bare = self.camera_scale == 0 and self.light_scale == 0
        endless = self.range == "none" and math.isinf(self.ends_of.far)
        if bare and endless and self.law_of(surface=False).power < 2:
            raise _wrong(
                "law", self.law, "a range, an end, or attenuation beside it: it has no sum"
            )

    @staticmethod
    def of(terms: Mapping[str, str], name: str = "") -> Model:
        """Return the model of terms by their words, such as {'light-path': 'off'}.

        Raises InputError for unknown terms.
        """
        by_word = {word_of(each): each for each in _READERS}
        for word in terms:
            if word not in by_word:
                raise InputError(
                    f"model: no term is called '{word}'{nearest(word, by_word) or '.'} Use one of "
                    + ", ".join(by_word)
                )
        return Model(**{by_word[word]: value for word, value in terms.items()}, name=name)

    @property
    def is_physical(self) -> bool:
        """Whether all terms are those of the physical equation."""
        return replace(self, name="") == Model()

    @property
    def terms(self) -> str:
        """The terms that differ from the physical equation, as words."""
        plain = Model()
        return ",".join(
            f"{word_of(each)}={getattr(self, each)}"
            for each in _READERS
            if getattr(self, each) != getattr(plain, each)
        )

    @property
    def title(self) -> str:
        """The words for a line: its name, or its terms."""
        return self.name or self.terms or "physical"

    def alone(self) -> tuple[tuple[str, Model], ...]:
        """Return each term that differs from the physical equation, as a model of its own."""
        plain, single = Model(), list[tuple[str, Model]]()
        for each in _READERS:
            if getattr(self, each) == getattr(plain, each) or each in ("cap", "lobe"):
                continue
            kept = {each: getattr(self, each)}
            # A cap and a lobe belong to the source that they change.
            if each == "source":
                kept |= {"cap": self.cap, "lobe": self.lobe}
            single.append((word_of(each), replace(plain, **kept)))
        return tuple(single)

    # The meanings of the words, each read once.

    @cached_property
    def light_scale(self) -> float:
        """The fraction b of the depth between a light and the fog."""
        return _light_path(self.light_path)[0]

    @cached_property
    def light_length(self) -> float:
        """The constant length M of light paths [m]; 0 for none."""
        return _light_path(self.light_path)[1]

    @cached_property
    def camera_scale(self) -> float:
        """The fraction a of the depth between the fog and the camera."""
        return _switch(self.camera_path)

    @cached_property
    def surface_paths(self) -> tuple[float, float]:
        """The fractions a and b of surfaces."""
        light = self.light_path if self.surface_light_path == "same" else self.surface_light_path
        camera = (
            self.camera_path if self.surface_camera_path == "same" else self.surface_camera_path
        )
        return _switch(camera), _light_path(light)[0]

    def law_of(self, *, surface: bool) -> Law:
        """Return the distance law, in the fog or on surfaces."""
        words = self.surface_law if surface and self.surface_law != "same" else self.law
        kind, numbers = _split(words)
        if kind == "power":
            return Law(kind, power=numbers[0])
        if kind == "softened":
            return Law(kind, math.sqrt(numbers[0]), scale=numbers[1])
        return Law(kind, *numbers)

    @cached_property
    def range_of(self) -> Range | None:
        """The range of lamps; None without one."""
        kind, numbers = _split(self.range)
        return Range(kind, numbers[0]) if numbers else None

    @cached_property
    def spot_of(self) -> tuple[str, float]:
        """The kind of the edge of spots, and the power of a rim."""
        kind, numbers = _split(self.spot)
        return kind, numbers[0] if numbers else 1.0

    @cached_property
    def ends_of(self) -> Ends:
        """Where the fog begins and ends before the camera."""
        kind, numbers = _split(self.ends)
        return Ends(numbers[0], numbers[1], kind == "planes") if numbers else Ends()

    @cached_property
    def fade_of(self) -> tuple[float, float] | None:
        """The depths at which the fade is 1 and 0 [m]."""
        if self.fade == "none":
            return None
        start, end = (float(cell) for cell in self.fade.split(":"))
        return start, end

    @cached_property
    def constant(self) -> tuple[float, ...] | None:
        """The colour of a constant source; None where lights are the source."""
        return _split(self.source)[1] or None

    @cached_property
    def ambient_of(self) -> tuple[float, ...] | None:
        """The colour of the ambient light."""
        return None if self.ambient == "none" else tuple(map(float, self.ambient.split(",")))

    @cached_property
    def most(self) -> float:
        """The most that a constant source covers [1]."""
        return 1.0 if self.cap == "none" else float(self.cap)

    @cached_property
    def lobe_of(self) -> Lobe | None:
        """The lobe of suns about a constant source."""
        return None if self.lobe == "none" else Lobe(*map(float, self.lobe.split(":")))

    @cached_property
    def lit_scale(self) -> float | None:
        """The k of a lit density."""
        return None if self.lit == "off" else float(self.lit)

    @cached_property
    def factors(self) -> tuple[float, float, float]:
        """The factors on lamps and on suns in the fog, and on surfaces."""
        return float(self.lamps), float(self.suns), float(self.surface_factor)


def word_of(field: str) -> str:
    """Return the word of a term by the name of its field."""
    surface = field.startswith(SURFACE)
    return "surface." * surface + field.removeprefix(SURFACE if surface else "").replace("_", "-")


# Reading of words. Each reader takes the word of its term for messages, and returns the value in
# the one way in which equal values are written.


def _wrong(term: str, value: str, expected: str) -> InputError:
    return InputError(f"model: {term} is '{value}'; expected {expected}")


def _numbers(term: str, cells: list[str], value: str, expected: str) -> list[float]:
    try:
        numbers = [float(cell) for cell in cells]
    except ValueError:
        raise _wrong(term, value, expected) from None
    if any(math.isnan(number) or number < 0 for number in numbers):
        raise _wrong(term, value, f"{expected}, and no number below 0")
    return numbers


def _split(words: str) -> tuple[str, tuple[float, ...]]:
    """Return the kind of a value that was read, and its numbers."""
    kind, _, rest = words.partition(":")
    return kind, tuple(float(cell) for cell in rest.replace(",", ":").split(":") if cell)


def _text(number: float) -> str:
    return f"{number:.12g}" if float(f"{number:.12g}") == number else repr(number)


def _switch(word: str) -> float:
    """Return the factor of a path that was read."""
    return {"on": 1.0, "off": 0.0}[word] if word in ("on", "off") else float(word)


def _light_path(word: str) -> tuple[float, float]:
    """Return the fraction b and the length M of a light path that was read."""
    return (0.0, _split(word)[1][0]) if word.startswith("length") else (_switch(word), 0.0)


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
                raise _wrong(term, value, expected)
            return f"length:{_text(number)}"
        (number,) = _numbers(term, [word], value, expected)
        if not number <= most or math.isinf(number):
            raise _wrong(term, value, expected)
        return {0.0: "off", 1.0: "on"}.get(number, _text(number))

    return read


def _choice(
    kinds: Mapping[str, tuple[float | None, ...]], expected: str, positive: bool = True
) -> Callable[[str, str], str]:
    """Return a reader of kinds with numbers: None for one that is needed, else its default."""

    def read(term: str, value: str) -> str:
        kind, *cells = value.strip().lower().replace(",", ":").split(":")
        if kind not in kinds:
            raise _wrong(term, value, expected)
        defaults = kinds[kind]
        given = _numbers(term, cells, value, expected)
        needed = sum(default is None for default in defaults)
        if not needed <= len(given) <= len(defaults):
            raise _wrong(term, value, expected)
        numbers = [*given, *defaults[len(given) :]]
        if positive and any(number == 0 for number in given[:1]):
            raise _wrong(term, value, f"{expected}, with numbers above 0")
        return ":".join([kind, *(_text(number) for number in numbers if number is not None)])

    return read


def _law(term: str, value: str) -> str:
    expected = "power:d, softened:e[:s], clamped:r0[:d] or sphere:R0"
    kinds: dict[str, tuple[float | None, ...]] = {
        "power": (2.0,),
        "softened": (None, 1.0),
        "clamped": (None, 2.0),
        "sphere": (None,),
    }
    word = _choice(kinds, expected, positive=False)(term, value)
    if any(math.isinf(number) for number in _split(word)[1]):
        raise _wrong(term, value, expected)
    # Lengths of 0 leave a power.
    kind, numbers = _split(word)
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
    near, far = _split(word)[1]
    if not near < far:
        raise _wrong(term, value, f"{expected}, FAR behind NEAR")
    return "none" if (near, far) == (0.0, math.inf) else word


def _fade(term: str, value: str) -> str:
    expected = "none, or START:END in metres, one behind the other"
    if value.strip().lower() == "none":
        return "none"
    numbers = _numbers(term, value.split(":"), value, expected)
    if len(numbers) != 2 or not numbers[0] < numbers[1] < math.inf:
        raise _wrong(term, value, expected)
    return ":".join(map(_text, numbers))


def _colour(term: str, value: str, expected: str) -> str:
    cells = value.split(",") if "," in value else value.split(":")
    numbers = _numbers(term, cells, value, expected)
    if len(numbers) == 1:
        numbers *= 3
    if len(numbers) != 3 or not all(math.isfinite(number) for number in numbers):
        raise _wrong(term, value, expected)
    return ",".join(map(_text, numbers))


def _source(term: str, value: str) -> str:
    expected = "lights, or constant:R,G,B"
    kind, _, rest = value.strip().lower().partition(":")
    if kind == "lights" and not rest:
        return "lights"
    if kind != "constant":
        raise _wrong(term, value, expected)
    return f"constant:{_colour(term, rest, expected)}"


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
        raise _wrong(term, value, expected)
    return ":".join(map(_text, (*numbers, 0.0)[:2]))


def _number(none: str, least: float, most: float, expected: str) -> Callable[[str, str], str]:
    def read(term: str, value: str) -> str:
        if value.strip().lower() == none:
            return none
        (number,) = _numbers(term, [value], value, expected)
        if not least <= number <= most or math.isinf(number):
            raise _wrong(term, value, expected)
        # The most that a source can cover is no cap.
        return none if number == most else _text(number)

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
_READERS: Mapping[str, Callable[[str, str], str]] = {
    "light_path": _path(length=True, most=1.0),
    "camera_path": _path(length=False, most=math.inf),
    "law": _law,
    "range": _choice(_WINDOWS, "none, or quartic:R, fourth:R, square:R, linear:R or cut:R"),
    "spot": _choice(_EDGES, "angle, cosine-squared, cosine-smooth or rim:k"),
    "phase": _phase,
    "depth": _choice(_DEPTHS, "distance, axis, axis-ends or axis-lookup"),
    "ends": _ends,
    "fade": _fade,
    "source": _source,
    "cap": _number("none", 0.0, 1.0, "none, or a number from 0 to 1"),
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

#: The physical equation.
PHYSICAL = Model()
