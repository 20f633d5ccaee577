# SPDX-License-Identifier: BSD-3-Clause
"""Batches of a Monte Carlo estimator, from the cache where they were traced before.

Every batch is kept as soon as it is finished, so a run that was interrupted or killed goes on from
there. Eight batches whose seeds begin at a multiple of eight are kept as one block, which takes a
quarter of the room. The result of a run depends on its seeds and their number alone, never on the
cache: blocks and the batches in them are always added up in the same order, and a run of fewer
batches than are kept uses those alone (up to seven that are only kept within a block are traced
again).
"""

import errno
import os
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from airlight.analytic.clock import Spent, stopwatch
from airlight.errors import InputError
from airlight.reference.monte_carlo.batches import LARGEST_SEED, LAYERS, Batches, merged
from airlight.reference.monte_carlo.cloud_paths.integrator import cloud_paths_batch, set_layers
from airlight.reference.monte_carlo.cloud_paths.opacity import seen_clouds
from airlight.reference.monte_carlo.single_scatter.integrator import single_scatter_batch
from airlight.reference.monte_carlo.volpath import volpath_batch, volpath_orders_batch
from airlight.reference.quadrature.reference import check_camera, check_rays
from airlight.reference.quadrature.surface import surface_hits
from airlight.reference.scene.clouds import read_clouds
from airlight.reference.scene.model import PHYSICAL, Model
from airlight.reference.scene.read import read_reference
from airlight.reference.storage.cache import cache_folder
from airlight.reference.storage.files import NO_SPACE
from airlight.reference.storage.scene_digest import scene_content
from airlight.reference.storage.store import (
    Content,
    Inputs,
    add_spent,
    counted,
    drop,
    is_damaged,
    is_kept,
    load,
    store,
)
from airlight.validation.arrays import Counted

Trace = Callable[[int], Batches]  # from the seed

ESTIMATORS = ("single-scatter", "volpath", "cloud-paths")
BLOCK = 8  #: batches in a block


@dataclass(frozen=True)
class Run:
    """The result of a run."""

    batches: Batches
    cached: int  #: batches that were in the cache
    damaged: int  #: files of the cache that were damaged; their batches have been traced again


#: Batches that other processes trace: from seeds to their batches and what these took, where what
#: is missing is traced here; and how many seeds are asked for at once.
Elsewhere = tuple[Callable[[list[int]], Iterator[tuple[Batches, Spent]]], int]
#: Estimator, samples a batch, and their counts by pixel or None -> who traces such batches.
ElsewhereFor = Callable[[str, int, NDArray[np.integer] | None], Elsewhere]


@dataclass(frozen=True)
class BatchInputs(Inputs):
    """The inputs of the batches of an estimator, beside their seeds."""

    scene: Content
    samples: int  #: a pixel in each batch
    max_depth: int
    orders: tuple[str, ...] | None
    counts: NDArray[np.integer] | None
    model: Model = PHYSICAL  #: the equation, whose name counts for nothing

    def __post_init__(self) -> None:
        object.__setattr__(self, "model", replace(self.model, name=""))


# Only the modules of the estimators count: this module hands the inputs on as they are.
class SingleScatterInputs(BatchInputs):
    """The inputs of batches by `single-scatter`."""

    kind = "single-scatter"
    modules = ("airlight.reference.monte_carlo.single_scatter.integrator",)


class VolpathInputs(BatchInputs):
    """The inputs of batches by `volpath`."""

    kind = "volpath"
    modules = ("airlight.reference.monte_carlo.volpath",)


class CloudPathInputs(BatchInputs):
    """The inputs of batches by `cloud-paths`."""

    kind = "cloud-paths"
    modules = ("airlight.reference.monte_carlo.cloud_paths.integrator",)


_INPUTS = {each.kind: each for each in (SingleScatterInputs, VolpathInputs, CloudPathInputs)}


def monte_carlo_batches(
    scene,
    estimator: str,
    *,
    batches: int,
    samples: int,
    first_seed: int = 0,
    max_depth: int = 2,
    counts: NDArray[np.integer] | None = None,
    orders: tuple[str, ...] | None = None,
    model: Model = PHYSICAL,
    enough: Callable[[Batches], bool] | None = None,
    go_on: Callable[[int], bool] | None = None,
    progress: Counted | None = None,
    elsewhere: Elsewhere | None = None,
) -> Run:
    """Return batches, radiances [W/(m^2 sr)], of a Mitsuba scene at its own size.

    The estimator is 'single-scatter', 'volpath' or 'cloud-paths'. There are 2 `batches` at least,
    of at most 256 `samples` a pixel; the first has the seed `first_seed`, the others count up. For
    volpath alone there are `max_depth`, the most edges of a path
    (`reference.monte_carlo.volpath.volpath_batch`), and `counts`, samples of each pixel in each
    batch, (layers, pixels), with the mean `samples` (`reference.monte_carlo.batches`). `orders` are
    names of disjoint sets of orders of scattering, '3-4', each with its own layer: for a scene of
    clouds, by 'volpath' or 'cloud-paths'. Only 'single-scatter' knows another `model` than the
    physical equation.

    `enough` is asked after every block, whose last seed is one less than a multiple of eight,
    whether to stop; `go_on` with the number of finished batches before each one that is traced,
    from the third on. `progress` is called with (done, total, estimator) after every batch that was
    traced. `elsewhere` traces batches in other processes; what these do not bring is traced here.
    """
    if batches < 2:
        raise ValueError(f"batches: got {batches}, expected at least 2 for a standard error")
    if batches > LARGEST_SEED:
        raise InputError(
            f"samples: got {batches * samples} a pixel, in {batches} batches of {samples}; "
            "expected at most "
            f"{LARGEST_SEED * samples}: each batch has its own seed"
        )
    if not 0 <= first_seed <= LARGEST_SEED - batches:
        raise InputError(
            f"seed: got {first_seed} for {batches} batches, which count up; expected 0 to "
            f"{LARGEST_SEED - batches}"
        )
    # Batches lie in the cache under the key of all inputs; the seed is the name within it.
    folder = _INPUTS[estimator](scene_content(scene), samples, max_depth, orders, counts, model).key
    layers, trace = batch_tracer(
        scene,
        estimator,
        samples=samples,
        max_depth=max_depth,
        counts=counts,
        orders=orders,
        model=model,
    )
    tally: Counter[str] = Counter()

    def kept_or_traced(seed: int) -> Batches | None:
        batch = _load(folder, range(seed, seed + 1), samples, layers, tally)
        if batch is None:
            # The first two batches are always traced: without them there is no standard error.
            if go_on is not None and tally["done"] >= 2 and not go_on(tally["done"]):
                return None
            spent = stopwatch()
            batch = trace(seed)
            _store(folder, batch, spent())
            if progress is not None:
                progress(tally["done"] + 1, batches, estimator)
        tally["done"] += 1
        return batch

    try:
        done, asked = None, first_seed
        for seeds in _blocks(first_seed, batches):
            # Other processes are asked for the missing batches of several blocks at once. They
            # store what they bring; the loop below then reads it like any batch of the cache.
            if elsewhere is not None and seeds[-1] >= asked:
                bring, at_once = elsewhere
                asked = seeds[0] + max(at_once, len(seeds))
                wanted = range(seeds[0], min(first_seed + batches, asked))
                waited = stopwatch()
                lacking = [seed for seed in wanted if not _has(folder, seed)]
                # Batches of the cache are done, too; those of earlier rounds are among them.
                here = seeds[0] - first_seed + len(wanted) - len(lacking)
                for number, (batch, spent) in enumerate(bring(lacking), 1):
                    _store(folder, batch, spent)
                    tally["brought"] += 1
                    if progress is not None:
                        progress(here + number, batches, estimator)
                add_spent(Spent() - waited())  # what they spent counts, when their batches are read
            # Blocks are added up in the order of their seeds, so that the sum does not depend on
            # the cache.
            block, whole = _block(
                folder, seeds, samples, layers, tally=tally, batch_of=kept_or_traced
            )
            if block is not None:
                done = block if done is None else merged(done, block)
            if not whole or (
                enough is not None and 2 <= tally["done"] < batches and enough(_all(done))
            ):
                break
    # Finished work stays in the cache: the message says how to go on.
    except OSError as error:
        if error.errno not in NO_SPACE:
            raise
        reason = os.strerror(error.errno or errno.ENOSPC)
        hint = "make room, or name another folder by AIRLIGHT_CACHE_DIR, and run again to go on"
        raise OSError(
            error.errno, f"{reason}; {_kept(tally)}; {hint}", str(cache_folder())
        ) from error
    return Run(_all(done), max(0, tally["cached"] - tally["brought"]), tally["damaged"])


def batch_tracer(
    scene,
    estimator: str,
    *,
    samples: int,
    max_depth: int = 2,
    counts: NDArray[np.integer] | None = None,
    orders: tuple[str, ...] | None = None,
    model: Model = PHYSICAL,
) -> tuple[tuple[str, ...], Trace]:
    """Return the layers of a batch, and the function that traces one from its seed;
    see `monte_carlo_batches`.
    """
    check_model(model, estimator)
    if orders is None:
        # Scenes with infinite radiance are refused: no number of samples gives their mean.
        reference = read_reference(scene, model)
        check_camera(reference)
        check_rays(reference, surface_hits(reference).distance)
        if estimator == "volpath":
            return LAYERS, lambda seed: volpath_batch(
                reference, seed, samples, max_depth=max_depth, counts=counts
            )
        if estimator == "single-scatter" and max_depth == 2 and counts is None:
            return LAYERS, lambda seed: single_scatter_batch(reference, seed, samples)
    else:
        from airlight.validation.slab.request import order_range

        # `volpath` has no layer `surface_straight`, the last one.
        clouds, sets, layers = (
            read_clouds(scene),
            [(name, order_range(name)) for name in orders],
            set_layers(orders),
        )
        if estimator == "volpath":
            return layers[:-1], lambda seed: volpath_orders_batch(clouds, seed, samples, sets=sets)
        if estimator == "cloud-paths":
            seen = seen_clouds(clouds).meets
            return layers, lambda seed: cloud_paths_batch(
                clouds, seed, samples, sets=sets, mask=seen
            )
    given = f"estimator: got {estimator!r} with max_depth {max_depth} and orders {orders}"
    raise ValueError(f"{given}, expected one of {', '.join(ESTIMATORS)}")


def check_model(model: Model, estimator: str) -> None:
    """Refuse a model of an estimator that knows the physical equation alone."""
    if not model.is_physical and estimator in ("volpath", "cloud-paths"):
        law = "Mitsuba's own law" if estimator == "volpath" else "its law"
        raise InputError(
            f"model: got {model.title}, but {estimator} solves {law}, which is physical; take "
            "quadrature or single-scatter, or --model physical"
        )


def _has(folder: str | None, seed: int) -> bool:
    """Return whether the batch of a seed is kept, alone or in its block."""
    start = seed // BLOCK * BLOCK
    return any(
        is_kept(_name(folder, seeds))
        for seeds in (range(seed, seed + 1), range(start, start + BLOCK))
    )


def _all(done: Batches | None) -> Batches:
    assert done is not None, "the first two batches are always traced"
    return done


def _blocks(first_seed: int, batches: int) -> Iterator[range]:
    """Cut the seeds at the multiples of `BLOCK`."""
    start, end = first_seed, first_seed + batches
    while start < end:
        stop = min(end, (start // BLOCK + 1) * BLOCK)
        yield range(start, stop)
        start = stop


def _block(
    folder: str | None,
    seeds: range,
    samples: int,
    layers: tuple[str, ...],
    *,
    tally: Counter[str],
    batch_of: Callable[[int], Batches | None],
) -> tuple[Batches | None, bool]:
    """Return the batches of some seeds added up, and whether they are all there."""
    # Only a whole block is kept as one file; batches at both ends of a run stay single.
    full = len(seeds) == BLOCK
    block = _load(folder, seeds, samples, layers, tally) if full else None
    if block is not None:
        tally["done"] += BLOCK
        return block, True
    # A block took the time of its batches, cached or traced.
    with counted() as ledger:
        for seed in seeds:
            batch = batch_of(seed)
            if batch is None:
                return block, False
            block = batch if block is None else merged(block, batch)
        spent = ledger.spent()
    if full and block is not None:
        _store(folder, block, spent)
        # The block holds all of them now.
        for seed in seeds:
            drop(_name(folder, range(seed, seed + 1)))
    return block, True


def _name(folder: str | None, seeds: range) -> str | None:
    return (
        None
        if folder is None
        else f"{folder}/{seeds[0]:06d}" + (f"-{seeds[-1]:06d}" if len(seeds) > 1 else "")
    )


def _store(folder: str | None, batches: Batches, spent: Spent) -> None:
    arrays = {"mean": batches.mean, "totals": batches.totals}
    # One batch has no spread.
    arrays |= {"squares": batches.squares} if len(batches.seeds) > 1 else {}
    store(_name(folder, range(batches.seeds[0], batches.seeds[-1] + 1)), arrays, spent)


def _load(
    folder: str | None, seeds: range, samples: int, layers: tuple[str, ...], tally: Counter[str]
) -> Batches | None:
    name = _name(folder, seeds)
    cached = load(name)
    if cached is None:
        tally["damaged"] += is_damaged(name)
        return None
    arrays = cached.value
    tally["cached"] += len(seeds)
    # One batch has no spread.
    squares = arrays["squares"] if len(seeds) > 1 else np.zeros_like(arrays["mean"])
    return Batches(tuple(seeds), samples, arrays["mean"], squares, arrays["totals"], layers)


def _kept(tally: Counter[str]) -> str:
    return (
        f"{tally['done']} finished batches are kept"
        if tally["done"]
        else "nothing was finished yet"
    )
