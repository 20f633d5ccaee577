# SPDX-License-Identifier: BSD-3-Clause
r"""References of several machines as one.

A file holds for each value the mean m of its K batches and their standard error s, so the sum of
squared deviations is K (K - 1) s^2, and files add up as batches do: the spread within each and that
between their means (`reference.monte_carlo.batches.combined_moments`). Merging loses only the
rounding of files to single precision: the mean keeps a relative 2^-24 = 6e-8 or so, the standard
error likewise. The spread between two means that differ by rounding alone shows as a relative
standard error of the order of 6e-8, where the estimator has no noise at all.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from airlight.errors import InputError
from airlight.reference.monte_carlo.batches import (
    LAYERS,
    combined_moments,
    parse_seed_ranges,
    seed_ranges,
)
from airlight.reference.storage.exr import MODEL, TOTAL, Attribute, Image
from airlight.validation.arrays import Array
from airlight.validation.scenes.models import PHYSICAL_NAME, model_parts

#: Headers that must be the same in all files, and their meanings.
_SAME = {
    "scene_digest": "the scene or its size",
    "estimator": "the estimator",
    "batch_spp": "the samples a pixel of a batch",
    "version:mitsuba": "the version of Mitsuba",
}


@dataclass(frozen=True)
class _Part:
    name: str  # of the file
    image: Image
    seeds: tuple[int, ...]

    def moments(self, layer: str) -> tuple[int, Array, Array]:
        """Return the number of batches, their mean and the sum of their squared deviations."""
        count = len(self.seeds)
        mean, error = (
            np.asarray(self.image.layers[name], dtype=np.float64) for name in (layer, f"{layer}_se")
        )
        # s^2 = squares/(K (K - 1)), solved for the sum of squared deviations.
        return count, mean, error**2 * (count * (count - 1))


def merged_references(files: Sequence[tuple[str, Image]]) -> Image:
    """Return the reference of all batches of several files.

    Each has a name and an image: one of `validation.estimates.images.monte_carlo_reference`, or a
    merged one. Their order does not matter. Raises InputError for files that differ in how they
    were made, or that share a seed.
    """
    if len(files) < 2:
        raise InputError(f"got {len(files)} file to merge; expected at least two")
    # In the order of their seeds: the result does not depend on the order of the files.
    parts = sorted((_read(name, image) for name, image in files), key=lambda part: part.seeds)
    # Batches are added up file by file: the spread within each, and that between their means.
    for part in parts[1:]:
        _check_same(parts[0], part)
    seeds = _all_seeds(parts)
    # Files of clouds may have layers for sets of orders: all must have the same.
    held = [frozenset(part.image.layers) for part in parts]
    if any(names != held[0] for names in held):
        odd = sorted(held[0].union(*held) - held[0].intersection(*held))
        raise InputError(
            f"the files to merge differ in their layers: {', '.join(odd)}; make all with the same "
            "--orders"
        )
    # Those without a standard error are the same in all files; the total is written again.
    layers = {name: values for name, values in parts[0].image.layers.items() if name != TOTAL}
    for layer in [name for name in layers if f"{name}_se" in layers]:
        count, mean, squares = parts[0].moments(layer)
        for part in parts[1:]:
            other = part.moments(layer)
            mean, squares = combined_moments((count, mean, squares), other)
            count += other[0]
        layers[layer] = mean
        layers[f"{layer}_se"] = np.sqrt(squares / (count * (count - 1)))
    samples = int(parts[0].image.attributes["airlight:batch_spp"])
    attributes: dict[str, Attribute] = dict(parts[0].image.attributes) | {
        "airlight:spp": samples * len(seeds),
        "airlight:batches": len(seeds),
        "airlight:seed": seeds[0],
        "airlight:seeds": seed_ranges(seeds),
        "airlight:merged": len(parts),
    }
    return Image(layers, parts[0].image.depth, attributes)


def _read(name: str, image: Image) -> _Part:
    """Check that a file is a reference with batches."""
    header = image.attributes
    # A file of a quadrature, or of another program, lacks the header of batches.
    missing = [
        key
        for key in ("estimator", "scene_digest", "batch_spp", "batches", "seeds")
        if not _of(header, key)
    ]
    missing += [
        f"layer {layer}{suffix}"
        for layer in LAYERS
        for suffix in ("", "_se")
        if layer + suffix not in image.layers
    ]
    if missing:
        raise InputError(
            f"{name} is no Monte Carlo reference of `airlight reference`: it lacks "
            f"{', '.join(missing)}; "
            "compute it with --estimator single-scatter, volpath or cloud-paths"
        )
    try:
        seeds = parse_seed_ranges(_of(header, "seeds"))
    except ValueError as error:
        raise InputError(f"{name}: its header names no seeds: {error}; compute it again") from error
    # A standard error needs two batches, and a header must agree with itself.
    if str(len(seeds)) != _of(header, "batches") or len(seeds) < 2:
        raise InputError(
            f"{name}: its header names {len(seeds)} seeds and {_of(header, 'batches')} batches; "
            "compute it again"
        )
    if not _of(header, "batch_spp").isdecimal():
        raise InputError(
            f"{name}: its header names {_of(header, 'batch_spp')} samples a pixel of a batch; "
            "expected a whole number: compute it again"
        )
    return _Part(name, image, seeds)


def _of(header: Mapping[str, Attribute], key: str) -> str:
    return str(header.get(f"airlight:{key}", ""))


def _check_same(first: _Part, second: _Part) -> None:
    for key, meaning in _SAME.items():
        values = [_of(part.image.attributes, key) for part in (first, second)]
        if values[0] != values[1]:
            raise InputError(
                f"{first.name} and {second.name} differ in {meaning} ({values[0][:24]} and "
                f"{values[1][:24]}); "
                "merge references that were made alike"
            )
    models = [str(part.image.attributes.get(MODEL, PHYSICAL_NAME)) for part in (first, second)]
    if model_parts(models[0])["terms"] != model_parts(models[1])["terms"]:
        raise InputError(
            f"{first.name} and {second.name} are of two models, {models[0]} and {models[1]}; merge "
            "references that were made alike"
        )
    shapes = [part.image.layers[LAYERS[0]].shape for part in (first, second)]
    if shapes[0] != shapes[1]:
        raise InputError(
            f"{first.name} and {second.name} have images of two sizes, {shapes[0][1::-1]} and "
            f"{shapes[1][1::-1]}"
        )


def _all_seeds(parts: Sequence[_Part]) -> list[int]:
    """Return all seeds, ascending; the same batch twice would count as two."""
    owner: dict[int, str] = {}
    for part in parts:
        shared = [seed for seed in part.seeds if seed in owner]
        if shared:
            raise InputError(
                f"{owner[shared[0]]} and {part.name} share the seeds {seed_ranges(shared)}; "
                "compute one of them again with another --seed"
            )
        owner |= dict.fromkeys(part.seeds, part.name)
    return sorted(owner)
