# SPDX-License-Identifier: BSD-3-Clause
"""References and batches of references from a cluster: the cache of this machine gets them,
and the rest is as without.

The bytes of a file therefore do not depend on the machine that computed its numbers. Results that
workers did not deliver, for any reason, are computed here.
"""

import pickle
import uuid
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airlight.analytic.clock import Spent, stopwatch
from airlight.errors import InputError
from airlight.reference.monte_carlo.batches import Batches
from airlight.reference.quadrature.image import ReferenceImage
from airlight.reference.quadrature.reference import ReferenceInputs, reference_result
from airlight.reference.scene.model import PHYSICAL, Model
from airlight.reference.storage.scene_digest import scene_content
from airlight.reference.storage.store import fresh_results, fresh_since, is_kept, keep
from airlight.reports.cluster.connect import Client, facts
from airlight.reports.cluster.run import Group, Task, run_groups
from airlight.validation.estimates.monte_carlo import Elsewhere, ElsewhereFor, Trace, batch_tracer
from airlight.validation.scenes.changes import change_words
from airlight.validation.scenes.loading import LoadedScene
from airlight.validation.study.configuration import Configuration
from airlight.validation.study.reference import load_cell
from airlight.validation.study.study import Cell

_LIMIT = 6 * 3600.0  # of a reference or a batch [s]


def image_of(
    loaded: LoadedScene,
    size: tuple[int, int],
    changes: Mapping[str, Sequence[float]] = MappingProxyType({}),
) -> Cell:
    """Return the image of a scene as a cell, which workers load by the
    name or path of the scene.
    """
    # A worker of this machine may run in another folder: a relative path would not be found there.
    name = str(loaded.path.resolve()) if loaded.path else loaded.name
    return Cell(name, size, tuple(change_words(changes)), Configuration("reference"))


def bring_references(
    cluster: Client,
    images: Sequence[Cell],
    *,
    pixel: str = "centre",
    points: int | None = None,
    model: Model = PHYSICAL,
) -> None:
    """Let workers compute the quadrature references of images that are not in the
    cache, and keep them here.

    `pixel`, `points`, `model`: see `reference.quadrature.reference.ReferenceInputs`.
    """

    def inputs_of(image: Cell) -> ReferenceInputs:
        content = scene_content(load_cell(image).scene)
        return ReferenceInputs(content, pixel=pixel, points=points, model=model)

    # The key of an image needs its scene loaded, here and later: nothing else says what is in the
    # cache.
    lacking = [image for image in images if not is_kept(inputs_of(image).key)]
    named = {f"reference {number}": image for number, image in enumerate(lacking)}
    # Workers must compute what `--fresh` asks for again, and not take it from a cache of their own.
    given = pixel, points, model, fresh_since()
    groups = [
        Group((Task(name, _reference, (image, *given), _LIMIT),)) for name, image in named.items()
    ]
    # The value goes to the cache together with the time that it took the worker, unless the file of
    # that name is another one there.
    for name, (key, reference, spent) in _done(cluster, groups):
        inputs = inputs_of(named[name])
        if key == inputs.key:
            keep(inputs, reference, spent, ReferenceImage)


def _done(cluster: Client, groups: Iterable[Group]) -> Iterator[tuple[str, Any]]:
    """Yield the names and values of tasks that were done; the first that
    was refused ends the run.
    """
    # A refusal is the user's mistake and true everywhere. A task that failed, hung or was lost is
    # left out here, and this process computes it.
    for outcome in run_groups(cluster, groups, made=facts()):
        if outcome.status == "refused":
            raise InputError(outcome.reason or "")
        if outcome.status == "done":
            yield outcome.task.name, outcome.value


def tracing(
    cluster: Client,
    image: Cell,
    estimator: str,
    *,
    samples: int,
    batches: int | None = None,
    orders: tuple[str, ...] | None = None,
    counts: NDArray[np.integer] | None = None,
    model: Model = PHYSICAL,
) -> Elsewhere:
    """Return the function that lets workers trace `batches` batches of an estimator, None if
    an error decides how many.

    The rest is as for `validation.estimates.monte_carlo.monte_carlo_batches`.
    """
    # As bytes, by which a worker knows again what it has prepared; of this run alone, as the file of
    # the scene may change before the next.
    kind = pickle.dumps(
        (
            uuid.uuid4().hex,
            image,
            estimator,
            {"samples": samples, "orders": orders, "counts": counts, "model": model},
        )
    )

    def bring(seeds: list[int]) -> Iterator[tuple[Batches, Spent]]:
        # One task in a group: what is sent at once then depends on the workers alone.
        groups = (Group((Task(f"batch {seed}", _batch, (kind, seed), _LIMIT),)) for seed in seeds)
        return (value for _, value in _done(cluster, groups))

    # Eight batches a worker at once, where an error decides whether more are needed: every worker
    # stays busy meanwhile.
    workers = len(cluster.scheduler_info(n_workers=-1)["workers"])
    return bring, batches or 8 * max(1, workers)


def spread(cluster: Client, image: Cell) -> ElsewhereFor:
    """Return the function that lets workers trace the batches that check a reference."""
    return lambda estimator, samples, counts: tracing(
        cluster, image, estimator, samples=samples, counts=counts
    )


def _reference(
    image: Cell, pixel: str, points: int | None, model: Model, since: float | None
) -> tuple[str | None, ReferenceImage, Spent]:
    with fresh_results(since):
        scene = load_cell(image).scene
        inputs = ReferenceInputs(scene_content(scene), pixel=pixel, points=points, model=model)
        found = reference_result(scene, inputs)
    return inputs.key, found.value, found.spent


def _batch(kind: bytes, seed: int) -> tuple[Batches, Spent]:
    trace, spent = _tracer(kind), stopwatch()
    return trace(seed), spent()


@lru_cache(maxsize=1)
def _tracer(kind: bytes) -> Trace:
    _, image, estimator, given = pickle.loads(kind)
    return batch_tracer(load_cell(image).scene, estimator, **given)[1]
