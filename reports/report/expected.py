# SPDX-License-Identifier: BSD-3-Clause
"""How long the parts of a report will take, so that progress counts time from the start and not parts.

A part that is kept takes no time. One that this machine computed before takes as long as then, though the code has
changed since. Of all others is known what they took on one machine (`_TYPICAL`): only the ratios of these count, for
progress puts the time so far beside the share of it that should be over.
"""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from validation.configurations.methods import Configuration
from validation.frames.result_cache import CacheEntry, ResultCache, cache_entry, expected_seconds
from validation.frames.scene_study import Effort, wants_flip
from validation.scenes.random_scene import is_random
from validation.scenes.registry import SCENES

#: Rough seconds of a default report on two threads of an AMD EPYC: the truth, its checks, multiple scattering, and
#: each configuration.
_TYPICAL: Mapping[str, tuple[float, float, float, float]] = {
    "open-fog": (1.0, 5.0, 1.5, 1.0),
    "sphere-spot": (1.5, 12.0, 10.0, 2.0),
    "colonnade": (8.0, 25.0, 20.0, 5.0),
    "two-pens": (6.0, 25.0, 22.0, 4.0),
    "three-media": (12.0, 45.0, 60.0, 7.0),
    "clutter": (15.0, 50.0, 25.0, 8.0),
    "hall": (15.0, 50.0, 25.0, 10.0),
    "omni-box": (8.0, 30.0, 20.0, 5.0),
    "tangle": (20.0, 60.0, 25.0, 40.0),
    "windows": (10.0, 45.0, 25.0, 6.0),
    "penumbra-plane": (80.0, 60.0, 60.0, 20.0),
    "fence": (300.0, 60.0, 60.0, 40.0),
    "soft-hall": (1200.0, 60.0, 60.0, 60.0),
    "overlap": (480.0, 60.0, 60.0, 30.0),
}
_USUAL = (6.0, 25.0, 20.0, 4.0)  #: the same of any other scene
_OTHERS = {
    "stability": 20.0,
    "papers": 8.0,
    "scaling": 80.0,
}
PAGE_SECONDS = 1.0  #: to pack the images of a scene and draw its part of the page
_PIXELS = 320 * 240  #: of the images of these runs
_LEAST = 0.01  #: to read a kept result [s]


@dataclass(frozen=True)
class SceneEntries:
    """The places in the cache of all that is measured in a scene, which need not be loaded for this."""

    cache: ResultCache
    name: str
    path: Path | None  #: of the user's own scene
    effort: Effort

    @classmethod
    def of(cls, cache: ResultCache, name_or_path: str, effort: Effort) -> "SceneEntries":
        """Return the places of a scene's results, as it is named on the command line."""
        path = None if name_or_path in SCENES or is_random(name_or_path) else Path(name_or_path)
        return cls(cache, path.stem if path else name_or_path, path, effort)

    def part(self, kind: str, fingerprint: Mapping[str, Any] | None = None) -> CacheEntry:
        """Return the place of the 'truth', of its checks ('agreement'), or of 'multiple' scattering."""
        asked = {
            "truth": ("image",),
            "agreement": ("checked", "margins", "samples", "batches", "patience"),
            "multiple": ("multiple",),
        }[kind]
        return self._entry(kind, self._settings(*asked), fingerprint)

    def method(self, chosen: Configuration, fingerprint: Mapping[str, Any] | None = None) -> CacheEntry:
        """Return the place of a configuration."""
        asked = asdict(chosen) | self._settings("image", "timed", "seconds", "slow", "limit")
        return self._entry("method", asked | {"flip": wants_flip(self.effort, chosen)}, fingerprint)

    def image(self, label: str, fingerprint: Mapping[str, Any] | None = None) -> CacheEntry:
        """Return the place of an image from elsewhere."""
        return self._entry("image", {"label": label} | self._settings("image", "flip"), fingerprint)

    def _settings(self, *names: str) -> dict[str, Any]:
        return {name: getattr(self.effort, name) for name in names}

    def _entry(self, kind: str, asked: Mapping[str, Any], fingerprint: Mapping[str, Any] | None) -> CacheEntry:
        identity = {"scene": self.name, "path": str(self.path.resolve()) if self.path else None, "asked": asked}
        entry = cache_entry(self.cache, kind, identity=identity, fingerprint=fingerprint)
        # Only loading a user's scene shows whether it has changed, so assume that it is measured again.
        return replace(entry, made_by="") if self.path and not fingerprint else entry


def shares(seconds: Mapping[str, float]) -> dict[str, tuple[float, float]]:
    """Return where each part begins and ends, as shares of the time that all of them take in turn."""
    spent = [max(_LEAST, value) for value in seconds.values()]
    total = sum(spent)
    bounds = [sum(spent[:number]) / total for number in range(len(spent))] + [1.0]
    return dict(zip(seconds, itertools.pairwise(bounds)))


def scene_seconds(
    entries: SceneEntries, configurations: Sequence[Configuration], *, complete: bool = False
) -> dict[str, float]:
    """Return what the parts of a scene will take: the truth and what is asked of it by name, a method by its label.

    Parameters
    ----------
    entries
        Of the scene.
    configurations
        What will be measured.
    complete
        Whether all of them will be: before a scene is loaded nobody knows which variants it has no use for, and one
        that was never measured where others were is taken for such a one.
    """
    parts = ("truth", "agreement", "multiple")
    typical = dict(zip((*parts, "method"), _TYPICAL.get(entries.name, _USUAL)))
    width, height = entries.effort.image
    scale = width * height / _PIXELS
    seconds = {part: _or(expected_seconds(entries.part(part)), scale * typical[part]) for part in parts}
    known = {chosen.label: expected_seconds(entries.method(chosen)) for chosen in configurations}
    unknown = scale * typical["method"]
    if not complete and any(value is not None for value in known.values()):
        unknown = 0.0
    return seconds | {label: _or(value, unknown) for label, value in known.items()}


def other_seconds(entry: CacheEntry, kind: str) -> float:
    """Return what a result that belongs to no scene will take."""
    return _or(expected_seconds(entry), _OTHERS[kind])


def _or(value: float | None, otherwise: float) -> float:
    return otherwise if value is None else value
