# SPDX-License-Identifier: BSD-3-Clause
"""`airlight.reference`: the reference of a scene, by the certified integral or by
samples, here or on workers.
"""

import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from airlight.errors import InputError, nearest
from airlight.reports.api.inputs import (
    Files,
    ModelLike,
    Progress,
    SceneLike,
    Size,
    Values,
    changes_of,
    chosen_model,
    exclude,
    note,
    one_error,
    pixels_of,
    several,
    telling,
    whole_numbers,
)
from airlight.validation.scenes.names import check_scene

if TYPE_CHECKING:
    from airlight.reports.api.results import Reference
    from airlight.reports.cluster.connect import Client
    from airlight.validation.estimates.images import Budget
    from airlight.validation.scenes.loading import LoadedScene

_ESTIMATORS = ("quadrature", "single-scatter", "volpath", "cloud-paths")


@one_error
def reference(
    scene: SceneLike,
    estimator: Literal["quadrature", "single-scatter", "volpath", "cloud-paths"] = "quadrature",
    *,
    change: Values = (),
    size: Size | None = None,
    pixel: Literal["centre", "area"] = "centre",
    samples: int | None = None,
    error: float | None = None,
    seconds: float | None = None,
    seed: int = 0,
    orders: str | None = None,
    model: ModelLike | None = None,
    merge: Files = (),
    cluster: str | None = None,
    progress: Progress = None,
) -> "Reference":
    """Compute the reference of a scene, with its error.

    The file is a layered EXR. Finished batches are cached: a Monte Carlo run continues from them,
    after an interruption or with more samples. `--cluster` spreads batches over workers; the file
    has the same bytes. The exit status is 1 if the run did not reach the `--error` that it was
    given.

    Parameters
    ----------
    scene
        A built-in scene, random:SEED or a Mitsuba XML or pbrt file; from Python also what
        `load_scene` takes or returns.
    estimator
        quadrature has an error in every pixel: proven, estimated or statistical. single-scatter and volpath use
        random samples and have standard errors. cloud-paths is for clouds, in which light scatters many times.
    change
        Change the camera, a light or a medium of the scene, such as medium.sigma_t=0.1; may be given several times.
    size
        Width and height [pixels], or WxH; the scene's own by default.
    pixel
        For quadrature: the radiance at the centre of a pixel, or its mean over the area.
    samples
        For an estimator that samples: samples per pixel, at least 64; 2048 by
        default, 256 for clouds.
    error
        For an estimator that samples: stop at this relative standard error of
        the image, such as 0.001.
    seconds
        For an estimator that samples: stop after this time [s].
    seed
        Seed of the first batch of samples; the next batches count up from it.
    orders
        For clouds, by cloud-paths or volpath: layers by order of scattering, such as 1,2,3-4,5-inf.
        'sets', the default of cloud-paths, are the orders of Bouthors 2008; 'all' writes no layers.
    model
        For quadrature and single-scatter: the equation of an engine in place of the physical one, such
        as playcanvas:range=8, see `airlight list models`, or terms such as light-path=off; physical
        leaves out the model that a scene file names. From Python also an `airlight.Model`.
    merge
        Trace nothing, and merge the samples of these files: Monte Carlo references of the scene by
        one estimator, with different seeds; may be given several times.
    cluster
        Let workers compute: local[:N] processes, tcp://HOST:PORT or tls://HOST:PORT of a Dask
        scheduler, or its scheduler file. A tcp scheduler authenticates nobody and its workers run
        what they are sent: use it only on a network that you trust; tls takes the certificates of
        Dask's configuration.
    progress
        Called with (fraction done, what); True shows a bar.

    Raises
    ------
    InputError
        For what the estimator does not use, and more than one of `samples`, `error` and `seconds`.

    Examples
    --------
    >>> import airlight
    >>> exact = airlight.reference("open-fog", size=(32, 24))
    >>> exact.relative_error < 1e-6
    True
    >>> traced = airlight.reference("open-fog", "single-scatter", size=(32, 24), samples=64)
    >>> traced.standard_error.shape
    (24, 32, 3)
    """
    whole_numbers(samples=samples, seed=seed)
    files = [Path(path) for path in several(merge)]
    budgets = {"samples": samples, "error": error, "seconds": seconds}
    # Merging joins the samples of files that exist: options of tracing would have no effect.
    if files:
        # A seed of 0 is the default and counts as not given.
        of_tracing = {
            "size": size,
            "seed": seed or None,
            "orders": orders,
            "cluster": cluster,
            "change": change,
            "model": model,
        }
        others = {"pixel": pixel != "centre", "estimator": estimator != "quadrature"}
        exclude("merge", "traces nothing", budgets | of_tracing | others)
        named = isinstance(scene, str | os.PathLike)
        return _merged(str(scene) if named else getattr(scene, "name", "scene"), files)
    if estimator not in _ESTIMATORS:
        raise InputError(
            f"estimator: got {estimator!r}, expected one of {', '.join(_ESTIMATORS)}"
            + nearest(estimator, _ESTIMATORS)
        )
    # Only estimators that trace multiple scattering have orders to choose.
    if orders is not None and estimator not in ("volpath", "cloud-paths"):
        raise InputError(
            f"orders: {estimator} knows single scattering alone; take cloud-paths or volpath"
        )
    # Workers: what they compute must not depend on how fast they are, or the same command would
    # give other bytes.
    place = None
    if cluster is not None:
        from airlight.reports.cluster.connect import parse_place

        if seconds is not None:
            raise InputError(
                "seconds: how many batches workers trace in a time is chance; give samples with a "
                "cluster"
            )
        if not isinstance(scene, str | os.PathLike):
            raise InputError("cluster: workers load a scene by its name or path; give that")
        place = parse_place(cluster)
    # A budget belongs to estimators that draw samples; the quadrature has none.
    budget = None
    # cloud-paths without orders reports sets of orders.
    wanted = orders or ("sets" if estimator == "cloud-paths" else None)
    if estimator != "quadrature":
        if pixel != "centre":
            raise InputError(
                f"pixel: got {pixel!r}, but {estimator} traces pixel centres; leave it out or take "
                "quadrature"
            )
        # Samples a pixel where no budget is given; an estimator that traces clouds gets fewer.
        budget = _budget(budgets, usual=2048 if wanted is None else 256)
    else:
        exclude("quadrature", "draws no samples", {**budgets, "seed": seed or None})
    # All words are checked; now Mitsuba starts.
    check_scene(scene)
    changes, asked = changes_of(change), chosen_model(model)
    from airlight.reports.machine.environment import activate

    activate()
    from airlight.realtime.scene.read_scene import scene_notes
    from airlight.reports.api.scenes import opened
    from airlight.validation.estimates.monte_carlo import check_model

    loaded = opened(scene, pixels_of(size), changes, asked)
    check_model(loaded.model, estimator)
    note(progress, scene_notes(loaded.scene))
    # A run that would take days is refused with an estimate; a long one begins with a note.
    note(progress, _check_work(loaded, estimator, pixel, budget, clouds=wanted is not None))

    # Workers fill the cache, then the same code as without workers reads it: the bytes agree.
    def compute(tell: Callable[[float, str], None], workers: "Client | None" = None) -> "Reference":
        elsewhere = None
        if workers is not None:
            elsewhere = _elsewhere(
                workers, loaded, changes, estimator, pixel=pixel, budget=budget, orders=wanted
            )
        if budget is None:
            return _quadrature(loaded, pixel, tell)
        return _sampled(
            loaded, estimator, budget, seed=seed, orders=wanted, tell=tell, elsewhere=elsewhere
        )

    with telling(progress, f"{loaded.name}: {estimator}") as tell:
        # This process computes all.
        if place is None:
            return compute(tell)
        from airlight.reports.cluster.connect import connected

        with connected(place) as workers:
            return compute(tell, workers)


def _check_work(
    loaded: Any, estimator: str, pixel: str, budget: "Budget | None", *, clouds: bool
) -> tuple[str, ...]:
    """Refuse what takes too long, and return what a user should know of the time."""
    from airlight.validation.study.cost import check_work, reference_work, sampled_work

    # A scene without a camera is counted as one pixel here, and is refused by name where it is
    # read.
    size = loaded.size if loaded.scene.sensors() else (1, 1)
    if budget is None:
        emitters = loaded.scene.emitters()
        # An area light costs the quadrature many light samples, so that the two kinds are counted
        # apart.
        area_lights = sum(emitter.class_name() == "AreaLight" for emitter in emitters)
        work = reference_work(
            size, lights=len(emitters) - area_lights, area_lights=area_lights, pixel=pixel
        )
    else:
        # A budget of error or of seconds names no number of samples: 64 a pixel stand for it.
        # single-scatter takes them for each light, the others choose a light by chance.
        lights = len(loaded.scene.emitters()) if estimator == "single-scatter" else 1
        work = sampled_work(size, budget.samples or 64, lights=lights, clouds=clouds)
    kind = f"{estimator} of areas" if pixel == "area" else estimator
    return check_work(f"reference {loaded.name}, {size[0]} x {size[1]}, {kind}", [work])


def _elsewhere(
    workers: "Client",
    loaded: "LoadedScene",
    changes: Any,
    estimator: str,
    *,
    pixel: str,
    budget: "Budget | None",
    orders: str | None,
) -> Any:
    """Let workers compute what is not in the cache: a quadrature at once,
    batches as they are asked for.
    """
    from airlight.reports.cluster.references import bring_references, image_of, tracing
    from airlight.validation.estimates.images import batch_plan, cloud_orders

    # Workers are told the size, since a change of the scene or its own default may decide it.
    width, height = (int(side) for side in loaded.scene.sensors()[0].film().size())
    image = image_of(loaded, (width, height), changes)
    # A worker computes the quadrature now, and it is then in the cache of this machine.
    if budget is None:
        bring_references(workers, [image], pixel=pixel, model=loaded.model)
        return None
    batches, samples = batch_plan(budget, width * height)
    # With a number of samples all batches are known before the first is traced; with an error they
    # are asked for until it is reached.
    known = None if budget.samples is None else batches
    chosen = cloud_orders(orders) if orders else None
    return tracing(
        workers,
        image,
        estimator,
        samples=samples,
        batches=known,
        orders=chosen,
        model=loaded.model,
    )


def _quadrature(
    loaded: "LoadedScene", pixel: str, tell: Callable[[float, str], None]
) -> "Reference":
    from airlight.reference.quadrature.reference import reference_image
    from airlight.reports.api.results import Reference, sealed
    from airlight.reports.report.scene import reference_record
    from airlight.validation.estimates.images import layered_reference

    # The whole image, from the cache where it was computed before.
    quadrature = reference_image(
        loaded.scene,
        pixel=pixel,
        model=loaded.model,
        progress=lambda done, total, what: tell(done / total, what),
    )
    said = reference_record(quadrature)
    return Reference(
        scene=loaded.name,
        image=sealed(layered_reference(loaded, quadrature, pixel=pixel, model=loaded.model)),
        estimator="quadrature",
        relative_error=float("nan") if said.relative_error is None else said.relative_error,
        how=said,
    )


def _sampled(
    loaded: "LoadedScene",
    estimator: str,
    budget: "Budget",
    *,
    seed: int,
    orders: str | None,
    tell: Callable[[float, str], None],
    elsewhere: Any,
) -> "Reference":
    from airlight.reports.api.results import Reference, sealed
    from airlight.validation.estimates.images import cloud_orders, monte_carlo_reference

    # None for an estimator of single scattering.
    chosen = cloud_orders(orders) if orders else None
    found = monte_carlo_reference(
        loaded,
        estimator,
        budget=budget,
        seed=seed,
        orders=chosen,
        model=loaded.model,
        progress=tell,
        elsewhere=elsewhere,
    )
    # Both places that hold the image must hold the sealed one.
    found = replace(found, image=sealed(found.image))
    return Reference(
        scene=loaded.name,
        image=found.image,
        estimator=estimator,
        relative_error=float("nan") if found.errors.pooled is None else found.errors.pooled,
        how=found,
    )


def _merged(scene: str, files: list[Path]) -> "Reference":
    """Return the samples of several files together, computed from their single precision."""
    from airlight.reference.storage.exr import read_exr
    from airlight.reports.api.results import Reference, sealed
    from airlight.validation.estimates.merge import merged_references

    # The command names a scene as every command does; files of another one are a mistake.
    image = merged_references([(str(path), read_exr(path)) for path in files])
    made = str(image.attributes["airlight:scene"])
    if made != Path(scene).stem and made != scene:
        raise InputError(f"merge: the files are of the scene {made}, got {scene}; name that one")
    return Reference(
        scene=made,
        image=sealed(image),
        estimator=str(image.attributes["airlight:estimator"]),
        relative_error=float("nan"),
    )


def _budget(given: dict[str, Any], *, usual: int) -> "Budget":
    from airlight.validation.estimates.images import Budget

    return Budget(
        **({"samples": usual} if all(value is None for value in given.values()) else given)
    )
