# SPDX-License-Identifier: BSD-3-Clause
"""Faults of lights and shadows."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from airlight.validation.arrays import Array
from airlight.validation.engine.fault import (
    Change,
    Fault,
    Number,
    Values,
    of_fog_alone,
    of_surfaces_alone,
    scenery_number,
    short,
    with_law,
    with_scenery,
)
from airlight.validation.engine.prediction import Guess, Predictor
from airlight.validation.fog_model.view import Scenery


def _window(factor: Callable[..., Array]) -> Change:
    """Return a function that gives the light a factor, by the distance from it
    and the numbers of a fault.
    """
    return lambda predictor, guess, p: replace(
        guess, fog=replace(guess.fog, window=lambda r: factor(r, *p))
    )


def _within(change: Callable[[Array], Array]) -> Callable[[Array, float], Array]:
    """Return a factor by the distance, of a function of the distance over a range."""
    return lambda r, end: change(np.minimum(r / end, 1.0))


def _softened(r: Array, size: float) -> Array:
    return r**2 / (r**2 + size)


def _of_a_disk(r: Array, radius: float) -> Array:
    """Return the light of a disk at a point that it faces, as a fraction of
    the light of a point light.
    """
    return 2 * r**2 / (r**2 + radius**2 + r * np.sqrt(r**2 + radius**2))


def _ranges(predictor: Predictor, guess: Guess) -> Sequence[Values]:
    """Return ranges of lights to begin with, by the usual distance from a light."""
    # Distances of the nodes in the fog; of lit surface points where no ray has fog.
    r = np.concatenate(
        [each.nodes.r for each in predictor.light.model(predictor.seen, Scenery(), 0).lights]
    )
    if not len(r):
        r = np.concatenate(
            [e.surface.r for e in predictor.light.model(predictor.seen, Scenery(), 1).lights]
        )
    far = float(np.median(r)) if len(r) else 1.0
    return [(far * part,) for part in (0.5, 1.0, 2.0, 4.0)]


def at_position(predictor: Predictor, guess: Guess, p: Values) -> Guess:
    """Return a guess with the first light off by a vector."""
    x, y, z = (short(value) for value in p)
    return replace(guess, scenery=replace(guess.scenery, moved=((x, y, z),)))


def position_held(predictor: Predictor, guess: Guess, p: Values, at: Values) -> Guess:
    """Return a guess with the light at p, and shadows as they are where it is at another place.

    The edge of a spot's cone moves more of the fog than all else: there nothing is held.
    """
    if predictor.reference.lights[0].axis is not None:
        return at_position(predictor, guess, p)
    # The paths belong to the light at `at`; the fog moves the light from there to p.
    guess_at = at_position(predictor, guess, at)
    x, y, z = (value - before for value, before in zip(p, guess_at.scenery.moved[0], strict=True))
    return replace(guess_at, fog=guess_at.fog.put(("moved", 0), (x, y, z)))


PLACE = tuple(Number(-1e3, 1e3, (0.0,), step=0.003, stride=0.1) for _ in range(3))

LIGHTS = (
    Fault("no-shadow", "nothing casts a shadow", with_scenery(shadows=False), needs=("shapes",)),
    Fault(
        "no-shadow",
        "nothing casts a shadow in the fog, on surfaces it does",
        of_fog_alone(with_scenery(shadows=False)),
        needs=("both",),
    ),
    Fault(
        "no-shadow",
        "nothing casts a shadow on surfaces, in the fog it does",
        of_surfaces_alone(with_scenery(shadows=False)),
        needs=("both",),
    ),
    *(
        Fault("distance-law", words, with_law(distance_power=power), needs=("lamps",))
        for words, power in (
            ("the light falls as one over the distance, not over its square", 1.0),
            ("the light does not fall with the distance", 0.0),
        )
    ),
    *(
        Fault(
            "distance-law",
            words,
            _window(law),
            (Number(1e-6, 1e3, (0.01, 0.1, 1.0), scale="log"),),
            needs=("lamps",),
        )
        for words, law in (
            (
                "the light falls as 1/(r^2 + e) with e = {0:.3g} m^2: it is softened near its "
                "source",
                _softened,
            ),
            (
                "the light falls as 2/(r^2 + R^2 + r sqrt(r^2 + R^2)), that of a disk of the "
                "radius R = {0:.3g} m that "
                "faces every point: a soft falloff",
                _of_a_disk,
            ),
        )
    ),
    Fault(
        "distance-law",
        "the light falls as 1/(r^2 + e) with e = {0:.3g} m^2, and ends by (1 - (r/R)^4)^2 with R = "
        "{1:.4g} m",
        _window(lambda r, size, end: _softened(r, size) * (1 - np.minimum(r / end, 1.0) ** 4) ** 2),
        (Number(1e-6, 1e3, scale="log"), Number(1e-3, 1e6, scale="log")),
        begin=lambda predictor, guess: [
            (size, *end) for size in (0.1, 1.0) for end in _ranges(predictor, guess)
        ],
        needs=("lamps",),
    ),
    *(
        Fault(
            "light-range",
            f"lights have a range: {words} {{0:.4g}} m",
            _window(_within(change)),
            (Number(1e-3, 1e6, scale="log"),),
            begin=_ranges,
            needs=("lamps",),
        )
        for words, change in (
            ("they fall off by (1 - (r/R)^4)^2 with R =", lambda s: (1 - s**4) ** 2),
            ("they fall off by 1 - (r/R)^4 with R =", lambda s: 1 - s**4),
            ("they fall off by (1 - (r/R)^2)^2 with R =", lambda s: (1 - s**2) ** 2),
            ("they fall off by 1 - r/R with R =", lambda s: 1 - s),
            ("they end at", lambda s: (s < 1).astype(float)),
        )
    ),
    *(
        Fault("spot-angle", words, with_scenery(cone=factor), needs=("spots",))
        for words, factor in (
            (
                "the angles of spots are twice what they should be: a half angle was taken for a "
                "whole one",
                2.0,
            ),
            (
                "the angles of spots are half of what they should be: a whole angle was taken for "
                "a half one",
                0.5,
            ),
        )
    ),
    Fault(
        "spot-angle",
        "the angles of spots are {0:.4g} times what they should be",
        scenery_number("cone"),
        (Number(0.2, 4.0, (0.8, 1.25), scale="log", step=0.02),),
        costly=1,
        needs=("spots",),
    ),
    Fault(
        "spot-falloff",
        "spots have a hard edge, without falloff",
        with_scenery(edge="hard"),
        needs=("soft spots",),
    ),
    Fault(
        "spot-falloff",
        "spots fall off from their axis on, not from the beam's edge",
        with_scenery(edge="smooth"),
        needs=("spots",),
    ),
    *(
        Fault(
            "spot-falloff",
            f"spots fall off {words}",
            with_scenery(edge=edge),
            needs=("soft spots",),
        )
        for words, edge in (
            ("as a line in the cosine, not in the angle", "linear"),
            ("squared in the cosine, as glTF has it, not as a line in the angle", "square"),
            ("smoothly in the cosine, by 3 x^2 - 2 x^3, not as a line in the angle", "smoothstep"),
        )
    ),
    Fault(
        "spot-falloff",
        "spots fall off as Blender's with a blend of {0:.3g}, which its own is 0.15: smoothly by "
        "the cosine",
        scenery_number("blend"),
        (Number(0.01, 1.0, (0.15, 0.5, 1.0), step=0.01),),
        costly=1,
        needs=("spots",),
    ),
    Fault(
        "light-radius",
        "point lights are spheres of the radius {0:.3g} m",
        scenery_number("radius"),
        (Number(0.0, 10.0, (0.05, 0.2, 0.5), step=0.01),),
        costly=2,
        needs=("point lights",),
    ),
    Fault(
        "light-position",
        "the first light is off by ({0:.3g}, {1:.3g}, {2:.3g}) m",
        at_position,
        PLACE,
        held=position_held,
        costly=1,
        needs=("lamps",),
    ),
)
