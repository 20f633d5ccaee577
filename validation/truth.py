# SPDX-License-Identifier: BSD-3-Clause
"""The truth of a scene, from the cache where it was computed before."""

from collections.abc import Callable
from dataclasses import fields

from reference.batches import Batches
from reference.cache import cache_key, load_arrays, store_arrays
from reference.quadrature import TruthImage, quadrature_image
from reference.scene import read_truth
from validation.monte_carlo import monte_carlo_batches

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
    """Return volpath's batches of a Mitsuba scene at its own size; see `validation.monte_carlo.monte_carlo_batches`."""
    run = monte_carlo_batches(
        scene,
        "volpath",
        batches=batches,
        samples=samples,
        first_seed=first_seed,
        enough=enough,
        progress=progress,
    )
    return run.batches
