# SPDX-License-Identifier: BSD-3-Clause
"""Mistakes in a scene file, by the names of its parts, and advice on the mistakes that Mitsuba
finds.
"""

from __future__ import annotations

import re
from pathlib import Path

import mitsuba as mi
import numpy as np

from airlight.errors import InputError
from airlight.validation.scenes.files.nodes import kind, of_kind, properties, reached, used

_PLACE = re.compile(r"\[[\w.]+(:\d+)?\]\s*")  # of Mitsuba's source, before its words
#: What Mitsuba says, and what to do about it; the first that fits counts.
_ADVICE = (
    (
        r'could not parse [\w ]*value "[^"]*\d,\d',
        "expected decimal points, such as 0.12: a comma separates numbers",
    ),
    (r"could not parse integer", "expected a whole number"),
    (
        r'could not parse floating point value "[-+]?[\d.]+"',
        "it is a number: the property is given twice, leave one out",
    ),
    (r"could not parse floating", "expected a number alone, without a unit"),
    (r"could not parse RGB", "expected one number, or three with commas between them"),
    (
        r"values in vector|exactly 1 or 3 elements|matrix must have",
        "numbers have decimal points, and commas or spaces between them",
    ),
    (r"specified multiple times", "leave one out"),
    (r"Could not map", "the file that it names is empty: write or copy it again"),
    (
        r"invalid lookat",
        'it looks along its own up, or at its own place; write another up, for example up="0, 1, 0"',
    ),
    (
        r"undefined parameter: \$(\w+)",
        r'give it a value in the file: <default name="\1" value="..."/>',
    ),
    (r"duplicate ID", "expected ids that differ: rename one of both, or leave it out"),
    (
        r'Plugin "\w+" not found',
        f"expected a plugin of Mitsuba {mi.__version__}: check the spelling, or replace it",
    ),
    (
        r"unreferenced propert",
        "expected properties that it has: check the spelling, or leave them out",
    ),
    (r"missing version attribute", 'expected <scene version="3.0.0"> as the first element'),
    (
        r"unsupported XML element",
        "expected elements of Mitsuba's format: check the spelling, or leave it out",
    ),
    (
        r"included file",
        "expected it beside the scene, or its path from there: copy it, or correct the name",
    ),
    (r"Parsing of XML file", "expected well-formed XML: repair it there, or export it again"),
    (r"read \d+ out of \d+ bytes", "a file that it names ends too early: write or copy it again"),
    (r"Scale factors in the camera", "remove the scale from the camera's to_world"),
    (r'Property "\w+" cannot be found', "add it"),
    (r"wrong type", "change the element to the expected type"),
    (r"Invalid RGB reflectance", "expected colours from 0 to 1"),
)
_COLOURS = re.compile("albedo|reflectance|color")
_SPECTRA = ("blackbody", "irregular", "regular")  # which Mitsuba evaluates at wavelengths alone


def in_words(error: Exception) -> str:
    """Return Mitsuba's message on a file that it cannot read in one line, with advice."""
    # Mitsuba's messages have several lines.
    reason = " ".join(str(error).split())
    reason = re.sub(r".*Traceback .*?\w*Error: ", "", reason)  # what a plugin in Python said
    reason = re.sub(r' in property "_arg_\d+"', "", _PLACE.sub("", reason))
    # The first that fits: special cases stand before general ones.
    for words, advice in _ADVICE:
        if match := re.search(words, reason):
            return f"{reason.rstrip('.!')}; {match.expand(advice)}"
    return reason


def check_files(state: mi.parser.ParserState, path: Path) -> None:
    """Refuse a scene that names a missing file, or a grid that Mitsuba does not read."""
    for index in used(state):
        props = properties(state, index)
        if "filename" not in props:
            continue
        file, plugin = str(props["filename"]), props.plugin_name()
        # Reading the name here must not hide from Mitsuba that a plugin does not know it.
        props.mark_queried("filename", False)
        name = _name(state, index)
        # As Mitsuba resolves it: beside the scene file, then in its own folders.
        place = Path(str(mi.file_resolver().resolve(file)))
        if not place.is_file():
            missing = (
                "does not exist" if place.is_absolute() else f"is not in {path.parent.resolve()}"
            )
            missing = "is a folder" if place.is_dir() else missing
            slashes = ", with '/' in place of backslashes" * ("\\" in file)
            raise InputError(
                f"scene {path}: {name} names the file {file}, which {missing}; expected its path "
                "from the scene's "
                f"folder{slashes}: copy it there, or correct the filename"
            )
        if plugin == "gridvolume" and not _is_grid(place):
            raise InputError(
                f"scene {path}: {name} names the file {file}, no grid of Mitsuba, which is not "
                "read; expected a .vol or .vdb file: read the values, (z, y, x), by a library of "
                f"that format, and write them by mi.VolumeGrid(values).write('{place.stem}.vol')"
            )


def _is_grid(path: Path) -> bool:
    with path.open("rb") as stream:
        return stream.read(3) == b"VOL"


def check_colours(state: mi.parser.ParserState) -> None:
    """Refuse colours of materials and albedos of media that are above 1 or below 0, and spectra
    that Mitsuba cannot evaluate as RGB.
    """
    for index in used(state):
        props = properties(state, index)
        if props.plugin_name() in _SPECTRA:
            raise InputError(
                f"{_name(state, index)} is a spectrum, which Mitsuba does not make into RGB; "
                "expected an 'rgb' value, or wavelengths and values in one <spectrum>, as in "
                'value="400:0.2, 700:0.6"'
            )
        for key in list(props.keys()):
            if props.type(key) != mi.Properties.Type.Color or not _COLOURS.search(key):
                continue
            colour = np.array(props[key], dtype=np.float64)
            props.mark_queried(key, False)
            if np.all((colour >= 0) & (colour <= 1)):
                continue
            # Values up to 255 are bytes that a program wrote for colours.
            bits = ": divide them by 255" if colour.max() > 2 and colour.min() >= 0 else ""
            raise InputError(
                f"{_name(state, index)} has {key} {', '.join(f'{value:g}' for value in colour)}; "
                "expected values from "
                f"0 to 1, of the light that arrives{bits}"
            )


def _name(state: mi.parser.ParserState, index: int) -> str:
    """Return the words for a node in a message: its id, or its type with the id of the shape,
    light or medium that uses it.
    """
    props = properties(state, index)
    part = kind(state, index).lower()
    if props.id() and not props.id().startswith("_"):
        return f"{'material' if part == 'bsdf' else part} '{props.id()}'"
    # A material or texture without an id is named after the part of the scene that uses it.
    for holder in ("Shape", "Emitter", "Medium"):
        for at in of_kind(state, holder):
            if index in reached(state, at):
                return f"{props.plugin_name()} of {holder.lower()} '{properties(state, at).id()}'"
    return f"a {props.plugin_name()} of the scene"
