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
    source         lights; constant:R,G,B: C (1 - exp(-a tau_c)) and no light of lamps and suns,
                   whose terms but for those of surfaces have no place beside it
    cap            none; the most that 1 - exp(-a tau_c) of a constant source can be, and the most
                   that it hides of a surface
    lobe           none; n[:START]: each sun adds E max(cos, 0)^n (1 - exp(-a tau_c)) to a constant
                   source, from the distance START on [m] where the ray reaches the fog, cos that of
                   the angle between ray and sun
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
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from functools import cached_property

from airlight.errors import InputError, nearest
from airlight.reference.scene.model_words import (
    READERS,
    light_path,
    split,
    switch,
    word_of,
    wrong,
)


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
                word = READERS[field.name](word_of(field.name), str(getattr(self, field.name)))
                object.__setattr__(self, field.name, word)
        if self.cap != "none" and not self.constant:
            raise wrong("cap", self.cap, "a constant source beside it")
        if self.lobe != "none" and not self.constant:
            raise wrong("lobe", self.lobe, "a constant source beside it")
        # No light of lamps and suns is in the fog of a constant source, nor is it faded.
        for name in ("phase", "fade", "lit", "lamps", "suns") if self.constant else ():
            value, usual = getattr(self, name), getattr(type(self), name)
            if value != usual:
                raise wrong(
                    name, value, f"{usual} beside a constant source: it has no effect there"
                )
        if self.constant and self.light_length:
            expected = (
                "on, off or a fraction beside a constant source: its light path is of surfaces"
            )
            raise wrong("light-path", self.light_path, expected)
        # Without attenuation and without an end the light of a lamp must fall as 1/r^2 at least.
        bare = self.camera_scale == 0 and self.light_scale == 0
        no_end = self.range == "none" and math.isinf(self.ends_of.far)
        if bare and no_end and self.law_of(surface=False).power < 2:
            raise wrong("law", self.law, "a range, an end, or attenuation beside it: it has no sum")

    @staticmethod
    def of(terms: Mapping[str, str], name: str = "") -> Model:
        """Return the model of terms by their words, such as {'light-path': 'off'}.

        Raises InputError for unknown terms.
        """
        by_word = {word_of(each): each for each in READERS}
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
            for each in READERS
            if getattr(self, each) != getattr(plain, each)
        )

    @property
    def title(self) -> str:
        """The words for a line: its name, or its terms."""
        return self.name or self.terms or "physical"

    def alone(self) -> tuple[tuple[str, Model], ...]:
        """Return each term that differs from the physical equation, as a model of its own."""
        plain, single = Model(), list[tuple[str, Model]]()
        for each in READERS:
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
        return light_path(self.light_path)[0]

    @cached_property
    def light_length(self) -> float:
        """The constant length M of light paths [m]; 0 for none."""
        return light_path(self.light_path)[1]

    @cached_property
    def camera_scale(self) -> float:
        """The fraction a of the depth between the fog and the camera."""
        return switch(self.camera_path)

    @cached_property
    def surface_paths(self) -> tuple[float, float]:
        """The fractions a and b of surfaces."""
        light = self.light_path if self.surface_light_path == "same" else self.surface_light_path
        camera = (
            self.camera_path if self.surface_camera_path == "same" else self.surface_camera_path
        )
        return switch(camera), light_path(light)[0]

    def law_of(self, *, surface: bool) -> Law:
        """Return the distance law, in the fog or on surfaces."""
        words = self.surface_law if surface and self.surface_law != "same" else self.law
        kind, numbers = split(words)
        if kind == "power":
            return Law(kind, power=numbers[0])
        if kind == "softened":
            return Law(kind, math.sqrt(numbers[0]), scale=numbers[1])
        return Law(kind, *numbers)

    @cached_property
    def range_of(self) -> Range | None:
        """The range of lamps; None without one."""
        kind, numbers = split(self.range)
        return Range(kind, numbers[0]) if numbers else None

    @cached_property
    def spot_of(self) -> tuple[str, float]:
        """The kind of the edge of spots, and the power of a rim."""
        kind, numbers = split(self.spot)
        return kind, numbers[0] if numbers else 1.0

    @cached_property
    def ends_of(self) -> Ends:
        """Where the fog begins and ends before the camera."""
        kind, numbers = split(self.ends)
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
        return split(self.source)[1] or None

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


#: The physical equation.
PHYSICAL = Model()
