# SPDX-License-Identifier: BSD-3-Clause
"""The folder of an entry: entry.toml, perhaps times.json and challenge.json, and the images."""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from airlight.errors import InputError, nearest
from airlight.reference.storage.exr import layer, read_exr
from airlight.reports.challenge.folder import FILE, LAYER, Challenge, read_challenge
from airlight.reports.challenge.record import CANNOT, Entry
from airlight.reports.challenge.seed import SIZE, check_seed, seed_of_entry, seed_words
from airlight.reports.data.records import read_json
from airlight.validation.arrays import Array, Bools
from airlight.validation.metrics.errors import wrong_pixels
from airlight.validation.readers import (
    Reader,
    by_name,
    read_named,
    read_number,
    read_toml,
    read_word,
)

ENTRY, TIMES = "entry.toml", "times.json"  #: in the folder of an entry
_LONGEST = 1e7  # of a frame [s], some months


@dataclass(frozen=True)
class EntryFolder:
    """An entry as it was found."""

    folder: Path
    entry: Entry
    challenge: Challenge | None  #: None where there is no challenge.json
    times: Mapping[str, float]  #: of a frame by scene [s]; empty where none is given
    cannot: Mapping[str, str]  #: why a scene has no image, by its name


def read_entry(folder: Path) -> EntryFolder:
    """Read an entry; its images are read later, one by one.

    Raises InputError for an entry without a method or a seed, and for two seeds.
    """
    if not folder.is_dir():
        raise InputError(
            f"entry: there is no folder {folder}; expected one with {ENTRY}, {FILE} and the images"
        )
    if not (folder / ENTRY).is_file():
        raise InputError(
            f'entry: {folder} has no {ENTRY}; expected a file with a line such as method = "My '
            'method, commit 1f2e3d"'
        )
    challenge = read_challenge(folder / FILE) if (folder / FILE).is_file() else None
    said, cannot = _said(folder / ENTRY)
    # The seed is in challenge.json, in entry.toml, or made of the words of the entry; where it is
    # said twice it is the same.
    words = " ".join((said.get("entry") or (challenge.entry if challenge else "")).split())
    seed = said.get("seed") or (challenge.seed if challenge else "")
    seed = seed or (seed_of_entry(words) if words else "")
    if not seed:
        raise InputError(
            f"entry: {folder} has no {FILE}, and {ENTRY} no seed; expected the file that `airlight "
            'challenge new` wrote, or a line such as seed = "7"'
        )
    check_seed(seed, words, str(folder / ENTRY))
    if challenge is not None and (challenge.seed, challenge.entry) != (seed, words):
        raise InputError(
            f"entry: {folder / ENTRY} says the seed {seed!r}, {FILE} says {challenge.seed!r}; "
            "expected one of both: leave it out of the first"
        )
    facts = {name: said.get(name, "") for name in ("method", "authors", "machine", "settings")}
    if not facts["method"]:
        raise InputError(f"{folder / ENTRY}: it names no method; expected a line method = ...")
    return EntryFolder(
        folder, Entry(**facts, seed=seed, entry=words), challenge, _times(folder / TIMES), cannot
    )


def _said(file: Path) -> tuple[dict[str, str], dict[str, str]]:
    """Return what entry.toml says, as words, and its reasons by the names of scenes."""
    readers: dict[str, Reader[str]] = {
        "method": read_word,
        "authors": _words,
        "machine": read_word,
        "settings": _words,
        "seed": lambda what, value: seed_words(value),
        "entry": read_word,
    }
    try:
        data = read_toml("entry", file)
        reasons = by_name(_reason)(CANNOT, data.get(CANNOT, {}))
        return read_named("", data, readers, CANNOT), reasons
    except InputError as error:
        raise InputError(f"{file}: {error}") from None


def _reason(what: str, value: object) -> str:
    """Return why a method cannot have a scene, as one line."""
    if not isinstance(value, str) or not value.strip():
        raise InputError(f"{what}: got {value!r}, expected the reason in words")
    return " ".join(value.split())


def _words(what: str, value: object) -> str:
    """Return a word, words of a list, or values of a table, as one line."""
    if isinstance(value, dict):
        return ", ".join(f"{name}={each}" for name, each in value.items())
    if isinstance(value, list):
        return ", ".join(read_word(what, each) for each in value)
    return read_word(what, value)


def _times(file: Path) -> dict[str, float]:
    """Return the times of times.json, nothing where there is no such file."""
    if not file.is_file():
        return {}
    wanted = "seconds of a frame by the name of its scene"
    found = read_json(file, wanted)
    if not isinstance(found, dict):
        raise InputError(f"{file}: got {type(found).__name__}, expected {wanted}")
    return {
        str(name): float(read_number(f"{file}: {name}", value, 0, _LONGEST))
        for name, value in found.items()
    }


def check_whole(found: EntryFolder, names: Sequence[str]) -> None:
    """Refuse an entry in which a scene has neither an image nor a reason or both, one without any
    image, and reasons and times of other scenes.
    """
    for name in found.cannot:
        if name not in names:
            raise InputError(
                f"{found.folder / ENTRY}: got {CANNOT}.{name}, expected the name of a scene, such "
                f"as {names[0]}{nearest(name, names)}"
            )
    if len(found.cannot) == len(names):
        raise InputError(
            f"{found.folder / ENTRY}: {CANNOT} names all {len(names)} scenes; expected an image of "
            "one at least: a method that can have none has no entry"
        )
    images = [name for name in names if (found.folder / f"{name}.exr").is_file()]
    if both := [f"{name}.exr" for name in images if name in found.cannot]:
        raise InputError(
            f"entry: {found.folder} has {', '.join(both)}, and {ENTRY} says that the method cannot "
            f"have {'it' if len(both) == 1 else 'them'}; expected one of both: leave the other out"
        )
    missing = [f"{name}.exr" for name in names if name not in {*images, *found.cannot}]
    if missing:
        raise InputError(
            f"entry: {found.folder} lacks {len(missing)} of {len(names)} images: "
            f"{', '.join(missing)}; an entry is whole: render these too, or say in {ENTRY} under "
            f"[{CANNOT}] why the method cannot have them"
        )
    if stray := sorted(set(found.times) - set(images)):
        raise InputError(
            f"{found.folder / TIMES}: got {', '.join(stray)}, expected names of scenes with an "
            f"image, such as {images[0]}"
        )


def read_airlight(path: Path) -> Array:
    """Return the airlight of an image of an entry, (height, width, 3) [W/(m^2 sr)]."""
    image = read_exr(path)
    values = np.asarray(layer(image, LAYER, path), dtype=np.float64)
    width, height = SIZE
    if values.shape != (height, width, 3):
        raise InputError(
            f"{path} has {values.shape[1]} x {values.shape[0]} pixels; expected {width} x {height}"
        )
    if image.window is not None:
        raise InputError(f"{path} holds a part of the frame; expected all of its pixels")
    wrong: Bools = np.asarray(~np.isfinite(values).all(axis=2))
    for fault in wrong_pixels(wrong, "not finite"):
        raise InputError(f"{path}: {fault}; expected finite radiance in all pixels")
    return values


def images_digest(folder: Path, names: Sequence[str], cannot: Mapping[str, str]) -> str:
    """Return the digest of the images of an entry: SHA-256 over lines `sha256  name`, and `cannot
    name  reason` for a scene without an image.

    No SHA-256 begins with `cannot`, and a reason is one line: two entries have one text only where
    they say and show the same.
    """
    lines = [
        f"{CANNOT}  {name}.exr  {cannot[name]}\n"
        if name in cannot
        else f"{hashlib.sha256((folder / f'{name}.exr').read_bytes()).hexdigest()}  {name}.exr\n"
        for name in sorted(names)
    ]
    return hashlib.sha256("".join(lines).encode()).hexdigest()
