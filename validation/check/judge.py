# SPDX-License-Identifier: BSD-3-Clause
"""Whether frames keep a relation: its error by blocks, against what noise and rounding do.

Blocks of 8 x 8 pixels have an error each: the difference of their means over the brightness that
the relation wants there, at least a twentieth of that of the image. A relation says of its own
pixels how far sampling parts them, and that is no error. The worst 2 % are left out, as edges of shadows lie
in other pixels of a changed frame. The root mean square of all others is the error of the relation.
It fails beyond

    3 x noise + rounding,

with *rounding* that of the format for each frame. The *noise* is the error of the same frame twice,
the floor. Where these two differ the renderer draws random numbers, and a changed frame may have
more noise than they: Cycles draws a lamp for each sample where there are two. The scatter of single
pixels within the blocks of the difference then counts too, as a root sum of squares. It counts for
nothing where both frames are the same: one wrong pixel is no noise of a renderer without any.

Where noise, and sampling in half of the blocks, exceed 5 %, nothing can be told: a fault of a
twentieth would be missed.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from airlight.errors import InputError, nearest
from airlight.validation.arrays import Array
from airlight.validation.check.check_file import Asked
from airlight.validation.check.relations import (
    RELATIONS,
    SIGNATURES,
    TOTAL,
    Sides,
    block_means,
)
from airlight.validation.columns import column

BLOCK = 8  #: pixels on a side of a block, in images of 8 blocks or more
_LEAST = 0.05  # of the mean brightness: darker blocks are judged as if they had it
_WORST = 0.02  # of the blocks, which edges of shadows may take
_FLOORS = 3.0  # a floor is one number of chance: three times as much is none
TELLING = 0.05  #: the largest fault that a check may miss without saying so

HOLDS, FAILS, UNKNOWN = "holds", "fails", "cannot be told"


@dataclass(frozen=True)
class Kept:
    """The answer of frames to a relation."""

    name: str = column("relation")
    verdict: str = column("verdict", meaning="holds, fails or cannot be told")
    error: float | None = column(
        "error", "1", "of blocks of 8 x 8 pixels beyond sampling, root mean square"
    )
    limit: float | None = column("limit", "1", "beyond which a relation fails: noise and rounding")
    ratio: float | None = column("ratio", "1", "sum of what is there over that of what is expected")
    worst: str = column(
        "worst at",
        "pixels",
        "column and row of the block with the largest error, where there is one",
    )
    points_to: str = column(
        "points to",
        meaning="what is likely wrong where a relation fails, or why it cannot be told",
    )

    @property
    def fails(self) -> bool:
        """Whether the relation is broken."""
        return self.verdict == FAILS


def judge(
    asked: Sequence[Asked],
    frames: Mapping[str, Mapping[str, Array]],
    *,
    again: Sequence[str] = (),
    rounding: float,
    layer: str | None = None,
    margin: float | None = None,
) -> tuple[Kept, ...]:
    """Return the answers to relations.

    `asked`: the relations; `frames`: layers by name, (height, width, 3), of each frame by name;
    `again`: two frames of one input; `rounding`: of a value, relative; `layer`: to judge in all
    relations that name none, by default that of each; `margin`: an error that is no fault, whatever
    made it.

    Raises InputError for frames of other sizes, or without a layer that a relation needs.
    """
    twice = (Asked("again", tuple(again)),) if again else ()
    for each in (*twice, *asked):
        _check(each)
    found: list[Kept] = []
    floors: dict[str, float] = {}
    for each in (*twice, *asked):
        relation = RELATIONS[each.name]
        # A layer that is named must be there; the usual one gives way to all light.
        named = each.layer or layer
        judged = named or _usual_layer(each, frames)
        values = _layers(each, frames, judged)
        if relation.alone and not named and judged != relation.layer:
            why = (
                f"frames have no layer {relation.layer}, of which alone it holds: write it, or "
                "name the layer of these frames in check.json"
            )
            found.append(Kept(each.name, UNKNOWN, None, None, None, "", why))
            continue
        for pair in twice:
            if judged not in floors:
                is_there = all(judged in frames[name] for name in pair.frames)
                own = judged if is_there else _usual_layer(pair, frames)
                sides = RELATIONS["again"].sides(_layers(pair, frames, own), pair)
                floors[judged] = block_errors(sides).error
        floor = floors.get(judged, 0.0)
        found.append(
            _answer(each, relation.sides(values, each), floor, rounding * len(values), margin)
        )
    return tuple(found)


def _check(asked: Asked) -> None:
    """Refuse a relation that there is not, and numbers that it cannot have."""
    if asked.name not in RELATIONS:
        raise InputError(
            f"relations: got {asked.name!r}, expected one of {', '.join(RELATIONS)}"
            f"{nearest(asked.name, RELATIONS)}"
        )
    counts = RELATIONS[asked.name].frames
    if len(asked.frames) not in counts:
        wanted = " or ".join(map(str, counts))
        raise InputError(f"{asked.name}: got {len(asked.frames)} frames, expected {wanted}")
    if sorted(asked.order) != [0, 1, 2]:
        raise InputError(
            f"{asked.name}: got the order {list(asked.order)}, expected each of 0, 1, 2"
        )
    if not (math.isfinite(asked.factor) and asked.factor > 0):
        raise InputError(f"{asked.name}: got the factor {asked.factor:g}, expected one above 0")
    if len(asked.value) not in (0, 1, 3) or not all(0 <= each < math.inf for each in asked.value):
        raise InputError(
            f"{asked.name}: got the value {list(asked.value)}, expected one radiance or three from 0 on"
        )


def _usual_layer(asked: Asked, frames: Mapping[str, Mapping[str, Array]]) -> str:
    """Return the layer that a relation judges where none is named: all light where a frame lacks
    its own, and that layer where a frame lacks all light too.
    """
    usual, chosen = RELATIONS[asked.name].layer, [frames[name] for name in asked.frames]
    is_there, is_total = (all(layer in each for each in chosen) for layer in (usual, TOTAL))
    return TOTAL if is_total and not is_there else usual


def _layers(asked: Asked, frames: Mapping[str, Mapping[str, Array]], layer: str) -> list[Array]:
    """Return a layer of the frames of a relation."""
    chosen = [frames[name] for name in asked.frames]
    for name, each in zip(asked.frames, chosen):
        if layer not in each:
            raise InputError(f"{name}: has no layer {layer}; it has {', '.join(each)}")
    values = [np.asarray(each[layer], dtype=np.float64) for each in chosen]
    sizes = {value.shape for value in values}
    if len(sizes) > 1 and asked.name not in ("size", "pan", "reciprocity"):
        raise InputError(f"{asked.name}: its frames have other sizes: expected one size")
    for name, value in zip(asked.frames, values):
        if not np.isfinite(value).all():
            raise InputError(f"{name}: {int((~np.isfinite(value)).sum())} values are not finite")
    return values


def _answer(
    asked: Asked, sides: Sides, floor: float, rounding: float, margin: float | None
) -> Kept:
    blocks = block_errors(sides)
    noise = math.hypot(floor, blocks.scatter) if floor > 0 else floor
    limit = _FLOORS * noise + rounding
    limit = limit if margin is None else max(limit, margin)
    # Without light there is nothing to compare, and no noise is known.
    if not math.isfinite(blocks.error) or (not math.isfinite(floor) and asked.name != "again"):
        return Kept(asked.name, UNKNOWN, None, None, None, "", "")
    if asked.name == "again":
        limit = TELLING / _FLOORS
        verdict = HOLDS if blocks.error <= limit else UNKNOWN
    elif blocks.error > limit:
        verdict = FAILS
    else:
        verdict = UNKNOWN if _FLOORS * noise + blocks.sampling > TELLING else HOLDS
    points_to = RELATIONS[asked.name].points_to if verdict == FAILS else ""
    ratio = blocks.ratio if math.isfinite(blocks.ratio) else None
    worst = f"{blocks.worst[0]}, {blocks.worst[1]}" if blocks.error else ""
    return Kept(asked.name, verdict, blocks.error, limit, ratio, worst, points_to)


@dataclass(frozen=True)
class BlockErrors:
    """The difference of two images by blocks."""

    error: float  #: root mean square beyond sampling, relative; NaN where nothing is lit
    sampling: float  #: median of what sampling explains, relative
    scatter: float  #: root mean square that independent noise of single pixels makes, relative
    ratio: float  #: sum of the one over that of the other
    worst: tuple[int, int]  #: column and row of the middle of the worst block [pixels]


def block_errors(sides: Sides) -> BlockErrors:
    """Return the errors of two images by blocks."""
    height, width = sides.wanted.shape[:2]
    size = max(1, min(BLOCK, height // BLOCK, width // BLOCK))
    sampling = np.broadcast_to(sides.sampling, sides.wanted.shape)
    got, wanted, spread = (block_means(each, size) for each in (sides.got, sides.wanted, sampling))
    known = np.isfinite(got) & np.isfinite(wanted)
    scale = float(np.abs(wanted[known]).mean()) if known.any() else 0.0
    if scale == 0 and not np.abs(got[known]).any():
        return BlockErrors(math.nan, 0.0, 0.0, math.nan, (0, 0))
    # Nothing is wanted, and something is there: its own brightness is the scale.
    scale = scale or float(np.abs(got[known]).mean())
    brightness = np.maximum(np.abs(wanted), _LEAST * scale)
    beyond = np.maximum(np.abs(got - wanted) - spread, 0.0) / brightness
    blocks = np.where(known, beyond, -1.0).max(axis=2)
    row, column_ = np.unravel_index(int(blocks.argmax()), blocks.shape)
    # A mean of n independent values has the variance (mean(d^2) - mean(d)^2)/(n - 1). Differences
    # that sampling explains are no noise.
    difference = sides.got - sides.wanted
    difference = np.sign(difference) * np.maximum(np.abs(difference) - sampling, 0.0)
    variance = block_means(difference**2, size) - block_means(difference, size) ** 2
    scatter = np.sqrt(np.maximum(variance, 0.0) / max(size**2 - 1, 1)) / brightness
    scatter = np.where(known, scatter, 0.0).max(axis=2)
    # Without the worst blocks.
    order = np.argsort(blocks, axis=None)
    order = order[blocks.ravel()[order] >= 0]
    order = order[: len(order) - int(_WORST * len(order))]
    kept, scattered = blocks.ravel()[order], scatter.ravel()[order]
    total = float(wanted[known].sum())
    return BlockErrors(
        float(np.sqrt(np.mean(kept**2))),
        float(np.median(spread[known] / brightness[known])),
        float(np.sqrt(np.mean(scattered**2))),
        float(got[known].sum()) / total if total else math.inf,
        (int((column_ + 0.5) * size * sides.side), int((row + 0.5) * size * sides.side)),
    )


def signature(found: Sequence[Kept]) -> str:
    """Return what the failing relations say together; empty where that is nothing in common.

    A larger set is as likely where nobody asked the rest of it, or nothing was told.
    """
    failing = {each.name for each in found if each.fails}
    untold = RELATIONS.keys() - {each.name for each in found if each.verdict == HOLDS}
    first = next((names for names, _ in SIGNATURES if names <= failing), None)
    if first is None:
        return ""
    return ", or ".join(
        words
        for names, words in sorted(SIGNATURES, key=lambda each: len(each[0]))
        if first <= names <= failing | untold
    )
