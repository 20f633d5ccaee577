# SPDX-License-Identifier: BSD-3-Clause
"""The seed of a challenge, and what is the same for all of them."""

import hashlib
import re

from airlight.errors import InputError

FORMAT = "airlight-challenge/1"  #: of drawing and of files: with another one seeds are other scenes
SIZE = (160, 120)  #: of the images [pixels]
EACH = 8  #: scenes of a kind
KINDS = ("random", "certified", "engine")
_SEED = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}")


def seed_words(seed: object) -> str:
    """Return a seed as its word; refuse what is none."""
    word = str(seed).strip()
    if not _SEED.fullmatch(word):
        raise InputError(
            f"seed: got {word!r}, expected a whole number or a word of at most 64 letters, digits, "
            "dots and dashes, such as 7 or ci-2026"
        )
    return word


def seed_of_entry(words: str) -> str:
    """Return the seed that the words of an entry have: 16 digits of their SHA-256, in which spaces
    side by side count as one.
    """
    text = " ".join(words.split())
    if not text:
        raise InputError(
            "entry: got no words, expected the method and its commit, such as 'My method, commit "
            "1f2e3d'"
        )
    return hashlib.sha256(text.encode("utf-8")).hexdigest()[:16]


def check_seed(seed: str, entry: str, where: str) -> None:
    """Refuse words that are no seed, and a seed that is not that of the words of its entry."""
    seed_words(seed)
    if entry and seed != seed_of_entry(entry):
        raise InputError(
            f"{where}: the entry {entry!r} has the seed {seed_of_entry(entry)}, got {seed!r}; "
            "write the scenes again by --entry"
        )
