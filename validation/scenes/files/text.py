# SPDX-License-Identifier: BSD-3-Clause
"""The text of a scene file, looked at before Mitsuba reads it.

Mitsuba says of every file that is no XML that it found no element in it, takes an empty number for
0, and ends the process at elements that are nested too deeply, since its reader calls itself for
each.
"""

from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from xml.parsers import expat

from airlight.errors import InputError

#: How files begin that people give in place of a scene, what they are, and what to do.
_OTHERS = (
    (
        b"\x76\x2f\x31\x01",
        "an EXR image",
        "to judge it give the scene first: airlight compare SCENE IMAGE",
    ),
    (b"\x89PNG", "a PNG image", "give the scene that it shows"),
    (b"glTF", "a glTF file", "export the scene for Mitsuba 3"),
    (b"BLENDER", "a file of Blender", "export the scene from there by its add-on for Mitsuba 3"),
    (b"\x28\xb5\x2f\xfd", "a compressed file", "unpack it"),
    (b"\x1f\x8b", "a compressed file", "unpack it"),
    (b"PK", "a ZIP archive", "unpack it"),
)
# of the byte order, before UTF-8 and both kinds of UTF-16
_MARKS = (b"\xef\xbb\xbf", b"\xff\xfe", b"\xfe\xff")
_NUMBERS = {
    "float",
    "integer",
    "point",
    "vector",
    "rgb",
    "rotate",
    "scale",
    "translate",
    "lookat",
    "matrix",
}
_WORDS = {"name", "id"}  # attributes of these that are no numbers


def check_text(path: Path) -> None:
    """Refuse a file that is empty, no XML, nested too deeply, or has a number without digits."""
    text = path.read_bytes()
    where = f"scene {path}"
    if not text.strip():
        raise InputError(
            f"{where}: the file is empty; expected a Mitsuba XML file: export it again"
        )
    # Files of another kind are known by their first bytes.
    what, way = next(
        ((what, way) for start, what, way in _OTHERS if text.startswith(start)), ("", "")
    )
    if what:
        raise InputError(f"{where}: the file is {what}; expected a Mitsuba XML file: {way}")
    # Text in UTF-16 begins with a mark of its byte order, not with '<'.
    if not text.startswith(_MARKS) and not text.lstrip().startswith(b"<"):
        raise InputError(
            f"{where}: the file is no XML, it begins with {text.lstrip()[:16]!r}; expected a "
            "Mitsuba XML file: export "
            "the scene for Mitsuba 3"
        )
    _check_elements(text, where)


def _check_elements(text: bytes, where: str) -> None:
    depth = deepest = 0
    parser = expat.ParserCreate()

    def opens(name: str, attributes: dict[str, str]) -> None:
        nonlocal depth, deepest
        depth += 1
        deepest = max(deepest, depth)
        # Mitsuba takes an empty number for 0.
        for key, value in attributes.items():
            if name.lower() in _NUMBERS and key not in _WORDS and not value.strip():
                raise InputError(
                    f"{where}: {key} of <{name}> in line {parser.CurrentLineNumber} is empty; "
                    "expected a number: write "
                    "it, or remove the element"
                )

    def closes(name: str) -> None:
        nonlocal depth
        depth -= 1

    parser.StartElementHandler, parser.EndElementHandler = opens, closes
    try:
        parser.Parse(text, True)
    except expat.ExpatError as error:
        # Mitsuba takes some files that are not well-formed, and says best what
        # is wrong with the others.
        if not text.startswith(_MARKS) and not _decodes(text):
            raise InputError(
                f"{where}: line {error.lineno} has bytes that are no UTF-8; expected the encoding "
                "that the first line "
                "names, UTF-8 without one: save it as UTF-8"
            ) from None
    most = 200  # elements in one another; a scene has about ten
    if deepest > most:
        raise InputError(
            f"{where}: its elements are nested {deepest} deep; expected at most {most}"
        )


@dataclass(frozen=True)
class Named:
    """Words of a scene file that Mitsuba drops."""

    model: str | None  #: the value of the default of that name, the first as in Mitsuba
    engine: str  #: whose height fog it has; empty where none is named


def named_in(path: Path, default: str) -> Named:
    """Return the model that a scene file names by a default, and the engine of its height fog."""
    models, engines = list[str](), list[str]()
    parents = list[tuple[str, str]]()
    parser = expat.ParserCreate()

    def opens(element: str, attributes: dict[str, str]) -> None:
        name, value = attributes.get("name", ""), attributes.get("value", "")
        if element == "default" and name == default:
            models.append(value)
        if element == "string" and name == "engine" and parents[-1:] == [("volume", "heightfog")]:
            engines.append(value)
        parents.append((element, attributes.get("type", "")))

    parser.StartElementHandler = opens
    parser.EndElementHandler = lambda element: parents.pop()
    with suppress(expat.ExpatError):  # see `_check_elements`
        parser.Parse(path.read_bytes(), True)
    return Named(models[0] if models else None, engines[0] if engines else "")


def _decodes(text: bytes) -> bool:
    try:
        text.decode()
    except UnicodeDecodeError:
        return False
    return True
