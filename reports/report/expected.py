# SPDX-License-Identifier: BSD-3-Clause
"""How long the parts of a report will take, so that progress counts time from the start and not parts.

A part that is kept takes no time. Of the others is known what they took on one machine (`_TYPICAL`): only the ratios of
these count, for progress puts the time so far beside the share of it that should be over.
"""

import itertools
from collections.abc import Mapping

from reference.storage.kept import is_kept

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


def shares(seconds: Mapping[str, float]) -> dict[str, tuple[float, float]]:
    """Return where each part begins and ends, as shares of the time that all of them take in turn."""
    spent = [max(_LEAST, value) for value in seconds.values()]
    total = sum(spent)
    bounds = [sum(spent[:number]) / total for number in range(len(spent))] + [1.0]
    return dict(zip(seconds, itertools.pairwise(bounds)))


def scene_seconds(
    name: str, size: tuple[int, int], keys: Mapping[str, str], *, complete: bool = False
) -> dict[str, float]:
    """Return what the parts of a scene will take by name: 'truth', 'agreement', 'multiple', and labels of methods.

    Parameters
    ----------
    name
        Of the scene.
    size
        Of its images [pixels].
    keys
        Of its results, by the names of the parts.
    complete
        Whether all of them will be asked for: before a scene is loaded nobody knows which variants it has no use for,
        and one that is missing where others are kept is taken for such a variant.
    """
    *parts, method = (size[0] * size[1] / _PIXELS * seconds for seconds in _TYPICAL.get(name, _USUAL))
    typical = dict(zip(("truth", "agreement", "multiple"), parts))
    known = {part: is_kept(key) for part, key in keys.items()}
    if not complete and any(known[part] for part in known.keys() - typical.keys()):
        method = 0.0
    return {part: 0.0 if known[part] else typical.get(part, method) for part in keys}


def other_seconds(key: str, kind: str) -> float:
    """Return what a result that belongs to no scene will take."""
    return 0.0 if is_kept(key) else _OTHERS[kind]
