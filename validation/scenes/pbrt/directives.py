# SPDX-License-Identifier: BSD-3-Clause
"""The directives of a pbrt file with their parameters, those of included files in their place."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path
from types import MappingProxyType

import numpy as np

from airlight.errors import InputError, nearest
from airlight.validation.arrays import Array
from airlight.validation.scenes.pbrt.tokens import Place, Token, tokens


@dataclass(frozen=True)
class Parameter:
    """A parameter of a directive."""

    type: str  #: "float", "rgb", ...
    name: str
    values: tuple[str, ...]  #: as they are written, strings without quotes
    at: Place


@dataclass(frozen=True)
class Directive:
    """A directive: its name, what follows it, and its parameters by name."""

    name: str
    at: Place
    strings: tuple[str, ...] = ()
    numbers: tuple[float, ...] = ()
    parameters: Mapping[str, Parameter] = field(default_factory=lambda: MappingProxyType({}))

    @property
    def type(self) -> str:
        """The kind of shape, light or material; nothing where it does not say."""
        return self.strings[0] if self.strings else ""

    def error(self, words: str) -> InputError:
        """Return the refusal of the directive, by its file, line and name."""
        kind = "".join(f' "{each}"' for each in self.strings[:1])
        return InputError(f"{self.at}: {self.name}{kind}: {words}")


@dataclass(frozen=True)
class _Form:
    """The words, numbers and parameters that follow a name."""

    strings: tuple[int, int] = (0, 0)  #: the fewest and the most
    numbers: int = 0
    parameters: bool = False


_PLAIN, _NAMED, _TYPED = _Form(), _Form(strings=(1, 1)), _Form(strings=(1, 1), parameters=True)
_FORMS = {
    **dict.fromkeys(("AttributeBegin", "AttributeEnd", "TransformBegin", "TransformEnd"), _PLAIN),
    **dict.fromkeys(("WorldBegin", "WorldEnd", "ReverseOrientation", "Identity"), _PLAIN),
    **dict.fromkeys(("ObjectBegin", "ObjectInstance", "NamedMaterial", "ColorSpace"), _NAMED),
    **dict.fromkeys(("CoordinateSystem", "CoordSysTransform", "Include", "Import"), _NAMED),
    **dict.fromkeys(("Camera", "Film", "Sampler", "Integrator", "PixelFilter"), _TYPED),
    **dict.fromkeys(("Accelerator", "LightSource", "AreaLightSource", "Material"), _TYPED),
    **dict.fromkeys(("Shape", "MakeNamedMedium", "MakeNamedMaterial", "Attribute"), _TYPED),
    **dict.fromkeys(("Transform", "ConcatTransform"), _Form(numbers=16)),
    **dict.fromkeys(("Translate", "Scale"), _Form(numbers=3)),
    "ObjectEnd": _PLAIN,
    "Option": _Form(parameters=True),
    "Texture": _Form(strings=(3, 3), parameters=True),
    "MediumInterface": _Form(strings=(1, 2)),
    "LookAt": _Form(numbers=9),
    "Rotate": _Form(numbers=4),
    "TransformTimes": _Form(numbers=2),
    "ActiveTransform": _PLAIN,
}
_DEEPEST = 16  # files that include one another; a file that includes itself is found before


def directives(path: Path) -> Iterator[Directive]:
    """Yield the directives of a file and of the files that it includes.

    Raises InputError, by file and line, for an unknown directive, for one that is not complete, and
    for an included file that is missing.
    """
    yield from _directives(path, path.parent, (path.resolve(),))


def _directives(path: Path, folder: Path, within: tuple[Path, ...]) -> Iterator[Directive]:
    stream = _Stream(tokens(path))
    while (token := stream.next) is not None:
        directive = _directive(stream, token)
        if directive.name not in ("Include", "Import"):
            yield directive
            continue
        if directive.name == "Import":
            raise directive.error("is read on its own in pbrt; expected Include: replace it")
        # pbrt looks beside the first file, whichever file includes.
        included = folder / directive.type
        if not included.is_file():
            raise directive.error(
                f"there is no such file in {folder.resolve()}; expected its path from there: copy "
                "it, or correct the name"
            )
        if included.resolve() in within or len(within) >= _DEEPEST:
            raise directive.error("the file includes itself; expected a file without this line")
        yield from _directives(included, folder, (*within, included.resolve()))


class _Stream:
    """Tokens with the next one in sight."""

    def __init__(self, source: Iterator[Token]) -> None:
        self._source = source
        self.next = next(source, None)

    def take(self) -> Token:
        """Return the next token and go on; there must be one."""
        token = self.next
        assert token is not None
        self.next = next(self._source, None)
        return token

    def is_string(self) -> bool:
        """Return whether a string comes next."""
        return self.next is not None and self.next.kind == "string"


def _directive(stream: _Stream, token: Token) -> Directive:
    name, form = token.text, _FORMS.get(token.text)
    if token.kind != "word" or form is None:
        given = f'"{name}"' if token.kind == "string" else repr(name[:40])
        raise InputError(
            f"{token.at}: got {given}, expected a directive of pbrt, such as Shape"
            + nearest(name, _FORMS)
        )
    stream.take()
    directive = Directive(name, token.at)
    strings = list[str]()
    while len(strings) < form.strings[1] and stream.is_string():
        strings.append(stream.take().text)
    if len(strings) < form.strings[0]:
        raise directive.error("no name follows; expected one in double quotes")
    numbers = _numbers(stream, directive, form.numbers)
    parameters = _parameters(stream, directive) if form.parameters else {}
    if name == "ActiveTransform" and stream.next is not None:
        strings = [stream.take().text]
    return Directive(name, token.at, tuple(strings), numbers, MappingProxyType(parameters))


def _numbers(stream: _Stream, directive: Directive, count: int) -> tuple[float, ...]:
    """Return the numbers of a transform, with or without brackets around them."""
    words = list[str]()
    while len(words) < count and stream.next is not None and stream.next.kind in ("word", "list"):
        words += stream.take().text.split()
    try:
        numbers = tuple(float(word) for word in words)
    except ValueError:
        numbers = ()
    if len(numbers) != count or not np.all(np.isfinite(numbers)):
        raise directive.error(f"got {' '.join(words[:20])!r}; expected {count} finite numbers")
    return numbers


def _parameters(stream: _Stream, directive: Directive) -> dict[str, Parameter]:
    found = dict[str, Parameter]()
    while stream.is_string():
        head = stream.take()
        words = head.text.split()
        if len(words) != 2:
            raise InputError(
                f'{head.at}: {directive.name}: got "{head.text}", expected the type and the name '
                'of a parameter, such as "float radius"'
            )
        if words[1] in found:
            raise InputError(
                f'{head.at}: {directive.name}: "{words[1]}" is given twice; leave one out'
            )
        found[words[1]] = Parameter(words[0], words[1], _values(stream, head), head.at)
    return found


def _values(stream: _Stream, head: Token) -> tuple[str, ...]:
    """Return the values of a parameter: one, or those in brackets."""
    missing = InputError(f'{head.at}: "{head.text}" has no value; expected one, or a list in []')
    if stream.next is None:
        raise missing
    token = stream.take()
    if token.kind == "list":
        return tuple(token.text.split())
    if token.kind in ("string", "word"):
        return (token.text,)
    # A list with strings or comments in it comes token by token.
    values = list[str]()
    if token.text == "]":
        raise missing
    while stream.next is not None:
        token = stream.take()
        if token.kind == "bracket" and token.text == "]":
            return tuple(values)
        values += [token.text] if token.kind == "string" else token.text.split()
    raise InputError(f'{head.at}: the list of "{head.text}" has no end; expected a ]')


def check_names(directive: Directive, known: Sequence[str]) -> None:
    """Refuse parameters that are not known, by name and line."""
    for name, parameter in directive.parameters.items():
        if name not in known:
            words = f'the parameter "{parameter.type} {name}" is not read'
            advice = nearest(name, known) or (
                f"; expected {', '.join(known)}: remove it" if known else "; remove it"
            )
            kind = f' "{directive.type}"' if directive.type else ""
            raise InputError(f"{parameter.at}: {directive.name}{kind}: {words}{advice}")


def array(directive: Directive, types: str, name: str, width: int = 1) -> Array | None:
    """Return the numbers of a parameter, a multiple of `width`; None where it is not given.

    `types`: those that it may have, with spaces between them.
    """
    parameter = directive.parameters.get(name)
    if parameter is None:
        return None
    if parameter.type not in types.split():
        raise _wrong(directive, parameter, f"the type {' or '.join(types.split())}")
    try:
        values = np.array(parameter.values, dtype=np.float64)
    except ValueError:
        raise _wrong(directive, parameter, "numbers") from None
    if not len(values) or len(values) % width or not np.all(np.isfinite(values)):
        raise _wrong(directive, parameter, f"{width} finite numbers" + " each" * (width > 1))
    return values


def number(directive: Directive, name: str, default: float, types: str = "float") -> float:
    """Return the one number of a parameter."""
    values = array(directive, types, name)
    if values is None:
        return default
    if len(values) != 1:
        raise _wrong(directive, directive.parameters[name], "one number")
    return float(values[0])


def point(directive: Directive, name: str, default: Sequence[float]) -> Array:
    """Return the point of a parameter, (3,)."""
    values = array(directive, "point3 point", name, 3)
    if values is None:
        return np.array(default, dtype=np.float64)
    if len(values) != 3:
        raise _wrong(directive, directive.parameters[name], "one point, three numbers")
    return values


def word(directive: Directive, name: str, default: str) -> str:
    """Return the one string or truth value of a parameter."""
    parameter = directive.parameters.get(name)
    if parameter is None:
        return default
    if parameter.type not in ("string", "bool") or len(parameter.values) != 1:
        raise _wrong(directive, parameter, "one string")
    return parameter.values[0]


def truth(directive: Directive, name: str) -> bool:
    """Return a truth value, false where it is not given."""
    value = word(directive, name, "false")
    if value not in ("true", "false"):
        raise _wrong(directive, directive.parameters[name], "true or false")
    return value == "true"


def colour(
    directive: Directive, name: str, default: Sequence[float], *, light: bool = False
) -> Array:
    """Return a colour, RGB; a number stands for three equal ones.

    `light`: whether it is the colour of a light. pbrt multiplies `rgb` by the white of its colour
    space, and a spectrum is not, so that a constant one is no grey there.
    """
    parameter = directive.parameters.get(name)
    if parameter is None:
        return np.array(default, dtype=np.float64)
    if parameter.type == "texture":
        raise _wrong(directive, parameter, "one colour: replace the texture by its mean, as rgb")
    if parameter.type == "spectrum" and not light:
        # Pairs of a wavelength and a value: one value for all wavelengths is a grey.
        pairs = array(directive, "spectrum", name, 2)
        assert pairs is not None
        if np.ptp(pairs[1::2]) == 0:
            return np.full(3, pairs[1])
    if parameter.type not in ("rgb", "color", "float"):
        raise _wrong(directive, parameter, "rgb values, in linear sRGB")
    values = array(directive, "rgb color float", name)
    assert values is not None
    if len(values) not in (1, 3) or np.any(values < 0):
        raise _wrong(directive, parameter, "three values of 0 or more")
    return np.array(np.broadcast_to(values, 3))


def _wrong(directive: Directive, parameter: Parameter, expected: str) -> InputError:
    given = " ".join(chain(parameter.values[:6], ["..."] if len(parameter.values) > 6 else []))
    kind = f' "{directive.type}"' if directive.type else ""
    return InputError(
        f'{parameter.at}: {directive.name}{kind}: got "{parameter.type} {parameter.name}" '
        f"{given}; expected {expected}"
    )
