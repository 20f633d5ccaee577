# SPDX-License-Identifier: BSD-3-Clause
"""`airlight reference SCENE`: the ground truth of a scene, with its error."""

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from reports.commands.options import Changes, ClusterPlace, Force, Meshes, Ranges, Scene, Size, drawn_from

if TYPE_CHECKING:
    from reference.storage.exr import Image
    from reports.cluster.connect import Cluster, Place
    from reports.machine.progress import Progress
    from validation.estimates.budget import Budget
    from validation.estimates.images import MonteCarloReference
    from validation.scenes.loading import LoadedScene

_USUAL_SPP = 2048
_USUAL_CLOUD_SPP = 256


class Estimator(StrEnum):
    """The estimators of the truth."""

    quadrature = "quadrature"
    single_scatter = "single-scatter"
    volpath = "volpath"
    cloud_paths = "cloud-paths"


class Pixel(StrEnum):
    """What a pixel holds: the radiance at its centre, or the mean over its area."""

    centre = "centre"
    area = "area"


class Target(StrEnum):
    """The standard error that `--target-error` limits."""

    pooled = "pooled"
    worst = "worst"


def reference(
    scene: Scene,
    output: Annotated[Path, typer.Option("--output", "-o", metavar="FILE", help="The EXR file to write.")] = Path(
        "reference.exr"
    ),
    estimator: Annotated[
        Estimator, typer.Option(metavar="NAME", help="quadrature, single-scatter, volpath or cloud-paths.")
    ] = Estimator.quadrature,
    spp: Annotated[
        int | None,
        typer.Option(
            min=64,
            metavar="N",
            help=f"Monte Carlo: samples a pixel, {_USUAL_SPP} by default, {_USUAL_CLOUD_SPP} of clouds.",
            show_default=False,
        ),
    ] = None,
    target_error: Annotated[
        float | None,
        typer.Option(
            metavar="SHARE",
            help="Monte Carlo: go on to this relative standard error, such as 0.001.",
            show_default=False,
        ),
    ] = None,
    time_budget: Annotated[
        float | None,
        typer.Option(metavar="SECONDS", help="Monte Carlo: go on for so many seconds.", show_default=False),
    ] = None,
    target: Annotated[
        Target,
        typer.Option(
            metavar="NAME",
            help="The error that --target-error is about: pooled, the image's, or worst, its worst pixel's.",
        ),
    ] = Target.pooled,
    pixel: Annotated[
        Pixel,
        typer.Option(
            metavar="NAME", help="quadrature: the radiance at the centre of a pixel, or the mean over its area."
        ),
    ] = Pixel.centre,
    seed: Annotated[
        int, typer.Option(min=0, metavar="N", help="Monte Carlo: seed of the first batch; the others count up.")
    ] = 0,
    change: Changes = None,
    orders: Annotated[
        str | None,
        typer.Option(
            metavar="SETS",
            help="cloud-paths, and volpath in clouds: layers by order of scattering, such as 1,2,3-4,5-inf; 'sets', "
            "the default of cloud-paths, are those of Bouthors 2008, 'all' is none.",
            show_default=False,
        ),
    ] = None,
    size: Size = None,
    meshes: Meshes = None,
    ranges: Ranges = None,
    cluster: ClusterPlace = None,
    force: Force = False,
    json: Annotated[bool, typer.Option("--json", help="Print a summary as JSON.")] = False,
) -> None:
    """Compute the ground truth of a scene, with its error.

    It is written as layered EXR. Finished batches are kept: a Monte Carlo run continues from them, after an
    interruption or with more samples. --cluster spreads batches over workers; the file is the same, byte for byte.

    Exit status 1 if the target error was not reached.
    """
    from analytic.errors import InputError
    from realtime.scene.features import scene_notes
    from reference.storage.exr import write_exr
    from reference.storage.files import ensure_writable
    from reports.interchange.frames import check_ending
    from reports.machine.environment import activate, stamped
    from reports.machine.printing import print_notes
    from reports.machine.progress import progress_bar
    from validation.estimates.budget import Budget
    from validation.estimates.images import cloud_orders
    from validation.scenes.changes import parse_changes
    from validation.scenes.loading import load_scene, parse_size
    from validation.study.cost import check_work, sampled_work, truth_work

    sampled = estimator is not Estimator.quadrature
    place = None if cluster is None else _place(cluster, time_budget)
    _check_options(estimator, {"--spp": spp, "--target-error": target_error, "--time-budget": time_budget}, pixel)
    if orders is not None and estimator not in (Estimator.volpath, Estimator.cloud_paths):
        raise InputError(f"--orders: {estimator} knows single scattering alone; add --estimator cloud-paths or volpath")
    chosen = cloud_orders(orders or "sets") if orders or estimator is Estimator.cloud_paths else None
    most = _USUAL_SPP if chosen is None else _USUAL_CLOUD_SPP
    usual = most if spp is None and target_error is None and time_budget is None else spp
    budget = Budget(samples=usual, error=target_error, seconds=time_budget, target=target.value) if sampled else None
    check_ending("--output", output, ".exr")
    ensure_writable(output)
    changes = parse_changes(change or [])
    activate()
    (scene,) = drawn_from([scene], meshes, ranges)
    loaded = load_scene(scene, parse_size(size) if size else None, changes)
    print_notes(scene_notes(loaded.scene))
    pixels = loaded.scene.sensors()[0].film().size() if loaded.scene.sensors() else (1, 1)
    if budget is None:
        area = 16 if pixel is Pixel.area else 1  # rays in a pixel
        work = truth_work(tuple(pixels), lights=len(loaded.scene.emitters()), images=area)
    else:
        work = sampled_work(tuple(pixels), usual or 64, clouds=chosen is not None)
    check_work(f"reference {loaded.name}, {pixels[0]} x {pixels[1]}, {estimator}", [work], force=force)
    from reports.cluster.connect import connected as connected_to

    with progress_bar(f"{loaded.name}: {estimator}") as progress:
        how: dict[str, Any] = {"budget": budget, "orders": chosen, "pixel": pixel, "seed": seed, "progress": progress}
        if place is None:
            image, estimate = _compute(loaded, estimator, **how)
        else:
            with connected_to(place) as connection:
                image, estimate = _compute(loaded, estimator, cluster=connection, changes=changes, **how)
    write_exr(output, stamped(image))
    summary: dict[str, Any] = {"scene": loaded.name, "output": str(output), "estimator": str(estimator)}
    summary |= {"means": {name: layer.mean(axis=(0, 1)).tolist() for name, layer in image.layers.items()}}
    _print_summary(summary | (_sampling(estimate) if estimate else {"pixel": str(pixel)}), json=json)
    if estimate is not None and estimate.reached is False:
        raise typer.Exit(1)


def _check_options(estimator: Estimator, budgets: dict[str, Any], pixel: Pixel) -> None:
    """Refuse options that the estimator does not use."""
    from analytic.errors import InputError

    given = [name for name, value in budgets.items() if value is not None]
    if estimator is Estimator.quadrature and given:
        others = " or ".join(other for other in Estimator if other is not Estimator.quadrature)
        raise InputError(f"{given[0]} is for an estimator that samples; add --estimator {others}, or leave it out")
    if len(given) > 1:
        raise InputError(f"{' and '.join(given)} exclude each other; give one of them")
    if estimator is not Estimator.quadrature and pixel is Pixel.area:
        raise InputError(f"{estimator} traces pixel centres; leave out --pixel area, or take --estimator quadrature")


def _place(cluster: str, time_budget: float | None) -> "Place":
    """Return where `--cluster` lets batches be traced."""
    from analytic.errors import InputError
    from reports.cluster.connect import parse_place

    if time_budget is not None:
        raise InputError("--time-budget: how many batches workers trace in a time is chance; give --spp with --cluster")
    return parse_place(cluster)


def _compute(
    loaded: "LoadedScene",
    estimator: Estimator,
    *,
    budget: "Budget | None",
    orders: tuple[str, ...] | None,
    pixel: Pixel,
    seed: int,
    progress: "Progress",
    cluster: "Cluster | None" = None,
    changes: Any = None,
) -> "tuple[Image, MonteCarloReference | None]":
    """Return the reference, and how it was sampled; with a cluster its workers do what is not in the cache."""
    from validation.estimates.budget import batch_plan
    from validation.estimates.images import monte_carlo_reference, quadrature_reference

    elsewhere = None
    if cluster is not None:
        from reports.cluster.references import Picture, bring_truths, tracing

        width, height = (int(side) for side in loaded.scene.sensors()[0].film().size())
        picture = Picture.of(str(loaded.path.resolve() if loaded.path else loaded.name), (width, height), changes)
        if budget is None:
            bring_truths(cluster, [picture], pixel=pixel.value)
        else:
            batches, samples = batch_plan(budget, width * height)
            known = None if budget.samples is None else batches
            elsewhere = tracing(cluster, picture, estimator.value, samples=samples, batches=known, orders=orders)
    if budget is None:
        return quadrature_reference(loaded, pixel=pixel.value, progress=progress), None
    estimate = monte_carlo_reference(
        loaded, estimator.value, budget=budget, seed=seed, orders=orders, progress=progress, elsewhere=elsewhere
    )
    return estimate.image, estimate


def _sampling(sampled: "MonteCarloReference") -> dict[str, Any]:
    """Return how a run was sampled, by name."""
    attributes = {name.removeprefix("airlight:"): value for name, value in sampled.image.attributes.items()}
    return {
        **{name: attributes[name] for name in ("spp", "batch_spp", "batches", "seeds")},
        "cached": sampled.cached,
        "damaged": sampled.damaged,
        "masked": sampled.masked,
        "pooled_error": sampled.errors.pooled,
        "worst_error": sampled.errors.worst,
        "reached": sampled.reached,
    }


def _print_summary(summary: dict[str, Any], *, json: bool) -> None:
    from reports.tables.terminal import print_json
    from validation.metrics.errors import plain

    if json:
        print_json(plain(summary))
        return
    print(f"{summary['output']}: {summary['scene']} by {summary['estimator']}")
    for name, mean in summary["means"].items():
        unit = "" if name == "opacity" else " W/(m^2 sr)"
        print(f"  {name}: mean {', '.join(f'{value:.6g}' for value in mean)}{unit}")
    if "batches" not in summary:
        return
    batches = summary["batches"]
    print(f"  {summary['spp']} samples a pixel in {batches} batches, seeds {summary['seeds']}")
    if summary["cached"]:
        print(f"  {summary['cached']} of {batches} batches from the cache")
    if summary["damaged"]:
        files = "file" if summary["damaged"] == 1 else "files"
        print(f"  {summary['damaged']} damaged {files} of the cache traced again")
    left_out = f"; {summary['masked']} pixels beside a light left out" if summary["masked"] else ""
    worst = f"{100 * summary['worst_error']:.3g} % of the worst pixel"
    print(f"  standard error {100 * summary['pooled_error']:.3g} % of the image, {worst}{left_out}")
    if batches < 32:
        print(f"  a standard error from {batches} batches is known to {100 / (2 * (batches - 1)) ** 0.5:.0f} % only")
    if summary["reached"] is False:
        print("  the target error was not reached")
