# SPDX-License-Identifier: BSD-3-Clause
"""The truth of a scene, from the cache where it was computed before."""

from collections.abc import Callable
from dataclasses import fields
from typing import Any

import numpy as np

from reference.batches import Batches, merged
from reference.cache import cache_key, load_arrays, store_arrays
from reference.quadrature import TruthImage, quadrature_image
from reference.scene import read_truth
from reference.volpath import volpath_batch

Progress = Callable[[int, int, str], None]


def truth_image(
    scene, *, samples: int = 256, shadow_scale: float = 1.0, progress: Progress | None = None
) -> TruthImage:
    """Return the quadrature truth of a Mitsuba scene at its own size.

    Parameters
    ----------
    scene
        The `mi.Scene`.
    samples, shadow_scale, progress
        See `reference.quadrature.quadrature_image`.
    """
    key = cache_key(scene, "quadrature", {"samples": samples, "shadow_scale": shadow_scale})
    stored = load_arrays(key)
    names = {field.name for field in fields(TruthImage)}
    if stored is not None and set(stored) == names:
        scalars = {"transitions": int(stored["transitions"]), "missed": float(stored["missed"])}
        return TruthImage(**({name: stored[name] for name in names} | scalars))
    image = quadrature_image(read_truth(scene), samples=samples, shadow_scale=shadow_scale, progress=progress)
    store_arrays(key, {name: getattr(image, name) for name in names})
    return image


def volpath_batches(
    scene,
    *,
    batches: int,
    samples: int,
    first_seed: int = 0,
    enough: Callable[[Batches], bool] | None = None,
    progress: Progress | None = None,
) -> Batches:
    """Return volpath's batches of a Mitsuba scene at its own size.

    Finished batches are kept: a run that was interrupted, or that asks for more batches, goes on from them.

    Parameters
    ----------
    scene
        The `mi.Scene`.
    batches
        How many at most, at least 2.
    samples
        Samples a pixel in each, at most 256.
    first_seed
        Seed of the first batch; the others count up.
    enough
        Asked after every eighth batch whether to stop.
    progress
        Called with (done, total, what) after every batch.
    """
    if batches < 2:
        raise ValueError(f"batches: got {batches}, wanted at least 2 for a standard error")
    truth = read_truth(scene)
    key = cache_key(scene, "volpath", {"samples": samples, "first_seed": first_seed})
    done = _stored_batches(key, samples)
    while done is None or len(done.seeds) < batches:
        number = 0 if done is None else len(done.seeds)
        if done is not None and enough is not None and number % 8 == 0 and enough(done):
            break
        batch = volpath_batch(truth, first_seed + number, samples)
        done = batch if done is None else merged(done, batch)
        store_arrays(key, {name: np.asarray(getattr(done, name)) for name in _BATCH_ARRAYS})
        if progress is not None:
            progress(number + 1, batches, "volpath")
    return done


_BATCH_ARRAYS = ("seeds", "mean", "squares", "totals")


def _stored_batches(key: str, samples: int) -> Batches | None:
    stored: dict[str, Any] | None = load_arrays(key)
    if stored is None or set(stored) != set(_BATCH_ARRAYS):
        return None
    seeds = tuple(int(seed) for seed in stored["seeds"])
    return Batches(seeds, samples, stored["mean"], stored["squares"], stored["totals"])
