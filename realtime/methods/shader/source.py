# SPDX-License-Identifier: BSD-3-Clause
r"""The shader of a user: GLSL with lines `#pragma airlight`, which other compilers ignore.

    #pragma airlight set NAME DEFAULT "help"        a parameter, a #define before the text: another value compiles again
    #pragma airlight uniform NAME DEFAULT "help"    a parameter that is a uniform
    #pragma airlight pass NAME size=AxB[xC] format=rgba16f|rgba32f|r32f
    #pragma airlight shadows none                   it knows no shadows
    #pragma airlight frames N                       frames that a history needs before the image counts

A size is made of numbers, W, H, W/n and H/n, rounded up. A pass in 2D is a function ``vec4 NAME(Ray
ray)``, one in 3D ``vec4 NAME(ivec3 cell, ivec3 cells)``. Lines ``#include "file"`` are resolved
beside the file that has them.

Drivers differ in what they make of the second number of `#line` (Mesa 22.3 forgets it), so every
text has lines of its own: the user's file from 1, an included one from a separate million.
"""

import keyword
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import takewhile
from pathlib import Path

from airlight.errors import InputError

SUFFIX = ".glsl"
_BLOCK = 1_000_000  # line numbers of a text: the user's file, ours, and each included file
OWN_LINES = _BLOCK  #: first line of the texts before and behind the user's
_FORMATS = ("rgba16f", "rgba32f", "r32f")
_DIRECTIVE = re.compile(r"^[ \t]*#[ \t]*(\w+)[ \t]*(.*?)[ \t]*$")
_PARAMETER = re.compile(r'(\w+)\s+([^\s"]+)(?:\s+"([^"]*)")?$')
_PASS = re.compile(r"(\w+)\s+size=([\w/]+)(?:\s+format=(\w+))?$")
_TERM = re.compile(r"(?:(0*[1-9]\d*)|([WH])(?:/(0*[1-9]\d*))?)$")
# Mesa '0:14(12): error: ..', NVIDIA '0(14) : error C1008: ..', others 'ERROR: 0:14: ..'
_ERRORS = (
    re.compile(r"^\d+:(\d+)\(\d+\): (?:preprocessor )?error: (.*)$", re.MULTILINE),
    re.compile(r"^\d+\((\d+)\) : error \w+: (.*)$", re.MULTILINE),
    re.compile(r"^ERROR: \d+:(\d+): (.*)$", re.MULTILINE),
)
# a uniform's initial value
_INITIAL = r"\buniform\b[^;]*\b{}\s*(?:\[[^\]]*\]\s*)?=(?!=)"
_WAYS_OUT = {
    "texture2D": "add `#define texture2D texture`",
    "texture3D": "add `#define texture3D texture`",
}


@dataclass(frozen=True)
class Pass:
    """An image that a function of the user's makes before the picture."""

    name: str
    size: tuple[str, ...]  #: two or three terms
    format: str

    def pixels(self, width: int, height: int) -> tuple[int, ...]:
        """Return the size for a picture of that size [pixels]."""
        return tuple(_evaluated(term, width, height) for term in self.size)


@dataclass(frozen=True)
class ShaderParameter:
    """A parameter of a shader."""

    name: str
    default: bool | int | float
    help: str
    uniform: bool


@dataclass(frozen=True)
class ShaderSource:
    """A shader as it was read."""

    path: Path
    text: str  #: of the file, included ones in their places
    files: tuple[Path, ...]  #: that it was read from, its own first
    lines: tuple[tuple[str, ...], ...]  #: of these files
    extensions: tuple[str, ...] = ()
    parameters: tuple[ShaderParameter, ...] = ()
    passes: tuple[Pass, ...] = ()
    shadows: bool = True
    frames: int = 1
    words: frozenset[str] = field(default=frozenset(), repr=False)  #: all names in its code

    def mistake(self, log: str) -> str:
        """Return the driver's message by the user's file and line, and the line itself."""
        # The first error by one of the three forms of messages.
        for pattern in _ERRORS:
            matched = pattern.search(log)
            if matched:
                number, words = int(matched[1]), " ".join(matched[2].split())
                if words.endswith("candidates are:"):  # They follow one a line, set in.
                    following = map(pattern.match, log[matched.end() :].splitlines()[1:])
                    candidates = takewhile(
                        lambda words: words.startswith(" "),
                        (line[2] if line else "" for line in following),
                    )
                    words += " " + "; ".join(map(str.strip, candidates))
                words += "".join(f"; {way}" for name, way in _WAYS_OUT.items() if name in words)
                # The block says which file the line is in. Block 1 is text of ours: then the
                # message has no line of the user's.
                place, line = divmod(number, _BLOCK)
                if place == 0 or 2 <= place <= len(self.files):
                    chosen = max(place - 1, 0)
                    lines = self.lines[chosen]
                    source_line = lines[line - 1].strip() if 0 < line <= len(lines) else ""
                    return f"{self.files[chosen].name}, line {line}: {words}" + (
                        f": {source_line}" if source_line else ""
                    )
                return f"{self.path.name}: {words}"
        # No form fits: the first line that speaks of an error, or all of it.
        lines_of_log = [line.strip() for line in log.splitlines() if "error" in line.lower()]
        return f"{self.path.name}: {lines_of_log[0] if lines_of_log else ' '.join(log.split())}"

    def check_unset(self, names: Sequence[str]) -> None:
        """Refuse uniforms, samplers and buffers that the driver reads and
        nothing sets: they would be 0.

        Parameters
        ----------
        names
            Their names. One that the text gives an initial value is set.

        Raises
        ------
        InputError
            With the names that are not set.
        """
        unset = [
            name for name in names if not re.search(_INITIAL.format(re.escape(name)), self.text)
        ]
        if unset:
            raise InputError(
                f"method {self.path}: {self.path.name}: nothing sets {', '.join(unset)}; give a "
                "uniform a value, "
                "`uniform float NAME = 1.0;`, or make it a parameter, `#pragma airlight uniform "
                "NAME 1.0`; samplers "
                "and buffers are those that airlight gives"
            )


def is_shader(name: str) -> bool:
    """Return whether the name of a method is the name of a shader's file."""
    return name.endswith(SUFFIX)


def is_users(name: str) -> bool:
    """Return whether the name of a method, or of a kernel, names a user's code."""
    return ":" in name or is_shader(name)


def read_shader(path: Path) -> ShaderSource:
    """Read a shader and what it includes.

    Raises
    ------
    InputError
        For a file that cannot be read, a line of ours that means nothing, and a
        function that is not there.
    """
    # The reader goes through the file and what it includes, and collects the pragmas on its way.
    reader = _Reader(f"method {path}")
    text = reader.read(path, ())
    source = ShaderSource(
        path, text, tuple(reader.files), tuple(reader.lines), tuple(reader.extensions), tuple(reader.parameters),
        tuple(reader.passes), reader.shadows, reader.frames, frozenset(re.findall((
            r"[A-Za-z_]\w*"
        ), text)),
    )  # fmt: skip
    wanted = [("vec3", "airlight", "Ray ray")]
    for each in source.passes:
        wanted.append(
            ("vec4", each.name, "Ray ray" if len(each.size) == 2 else "ivec3 cell, ivec3 cells")
        )
    # A function that a stage calls must be there; the driver would name a line of ours.
    for kind, name, arguments in wanted:
        if not re.search(rf"\b{kind}\s+{name}\s*\([^()]*\)\s*\{{", text):
            raise InputError(f"method {path}: {path.name}: no function {kind} {name}({arguments})")
    return source


class _Reader:
    """Collects the declarations in the files of a shader."""

    def __init__(self, what: str) -> None:
        self.what = what
        self.files: list[Path] = []
        self.lines: list[tuple[str, ...]] = []
        self.extensions: list[str] = []
        self.parameters: list[ShaderParameter] = []
        self.passes: list[Pass] = []
        self.shadows, self.frames = True, 1

    def read(self, path: Path, within: tuple[Path, ...]) -> str:
        try:
            # editors of Windows write a byte order mark
            text = path.read_text(encoding="utf-8-sig")
        except (OSError, UnicodeDecodeError) as error:
            words = (
                error.strerror
                if isinstance(error, OSError) and error.strerror
                else "it is no text in UTF-8"
            )
            raise InputError(f"{self.what}: {path} cannot be read: {words}") from error
        # Before the included files are read: blocks of lines are in this order.
        self.files.append(path)
        self.lines.append(tuple(text.splitlines()))
        # The user's file has block 0, our texts block 1, the n-th included file block n + 1.
        first = 0 if not within else len(self.files) * _BLOCK
        out = [f"#line {first + 1}"]
        # Mesa miscounts lines of comments
        for number, code in enumerate(_without_comments(text).splitlines(), 1):
            matched = _DIRECTIVE.match(code)
            word, rest = (matched[1], matched[2]) if matched else ("", "")
            place = f"{self.what}: {path.name}, line {number}"
            if word == "include":
                name = re.fullmatch(r'"([^"]+)"', rest)
                if name is None:
                    raise InputError(f'{place}: got `#include {rest}`, expected `#include "file"`')
                other = path.parent / name[1]
                # `within` holds the files that include this one: a circle would never end.
                if other.resolve() in (each.resolve() for each in (*within, path)):
                    raise InputError(f"{place}: {name[1]} includes itself")
                if not other.is_file():
                    raise InputError(f"{place}: there is no file {other}")
                out += [self.read(other, (*within, path)), f"#line {first + number + 1}"]
                continue
            if word == "extension":
                self.extensions.append(f"#extension {rest}")
            ours = word == "pragma" and rest.split(None, 1)[:1] == ["airlight"]
            if ours:
                self._pragma(rest.removeprefix("airlight").strip(), place)
            # `#version` and extensions stand at the top of the whole text, and our lines are no
            # code: all of them stay, empty.
            out.append("" if ours or word in ("version", "extension") else code)
        return "\n".join(out)

    def _pragma(self, text: str, place: str) -> None:
        word, _, rest = text.partition(" ")
        rest = rest.strip()
        if word in ("set", "uniform"):
            self.parameters.append(_parameter(rest, place, uniform=word == "uniform"))
            # Each name is one field of the method's class.
            if len({each.name for each in self.parameters}) < len(self.parameters):
                raise InputError(
                    f"{place}: two parameters are called {self.parameters[-1].name}; rename one"
                )
        elif word == "pass":
            self.passes.append(_pass(rest, place))
        elif word == "shadows" and rest == "none":
            self.shadows = False
        elif word == "frames" and rest.isdecimal() and 0 < int(rest) <= 1000:
            self.frames = int(rest)
        else:
            raise InputError(
                f"{place}: got `#pragma airlight {text}`, expected set, uniform, pass, `shadows "
                "none` or `frames N` "
                "with N from 1 to 1000"
            )


def _parameter(text: str, place: str, *, uniform: bool) -> ShaderParameter:
    matched, word = _PARAMETER.match(text), "uniform" if uniform else "set"
    value: bool | int | float | None = None
    # A default is a truth value, a whole number or a number, whichever it first reads as; that is
    # the type of the parameter.
    if matched and matched[1].isidentifier() and not keyword.iskeyword(matched[1]):
        value = {"true": True, "false": False}.get(matched[2])
        for kind in (int, float) if value is None else ():
            try:
                value = kind(matched[2])
                break
            except ValueError:
                continue
    if matched is None or value is None:
        raise InputError(
            f'{place}: got `{word} {text}`, expected `{word} NAME DEFAULT "help"`, such as `{word} '
            "STEPS 16`"
        )
    return ShaderParameter(matched[1], value, matched[3] or "", uniform)


def _pass(text: str, place: str) -> Pass:
    matched = _PASS.match(text)
    terms = tuple(matched[2].split("x")) if matched else ()
    if matched is None or len(terms) not in (2, 3) or not all(map(_TERM.match, terms)):
        raise InputError(
            f"{place}: got `pass {text}`, expected `pass NAME size=W/2xH/2` or `pass NAME "
            "size=80x60x64`"
        )
    if (matched[3] or _FORMATS[0]) not in _FORMATS:
        raise InputError(
            f"{place}: got the format {matched[3]}, expected one of {', '.join(_FORMATS)}"
        )
    return Pass(matched[1], terms, matched[3] or _FORMATS[0])


def _evaluated(term: str, width: int, height: int) -> int:
    matched = _TERM.match(term)
    assert matched is not None
    if matched[1]:
        return int(matched[1])
    # W/n and H/n are rounded up.
    return -(-(width if matched[2] == "W" else height) // int(matched[3] or 1))


def _without_comments(text: str) -> str:
    """Return the text with spaces in place of comments; lines stay where they are, and so does
    what stands in quotes, such as an address in the help of a parameter.
    """

    def blank(found: re.Match[str]) -> str:
        return found[0] if found[0].startswith('"') else re.sub(r"[^\n]", " ", found[0])

    parts = r'"[^"\n]*"|//[^\n]*|/\*.*?(?:\*/|\Z)'
    return re.sub(parts, blank, text, flags=re.DOTALL)
