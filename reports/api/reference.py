# SPDX-License-Identifier: BSD-3-Clause
"""The Python API for the truth of a scene, by the certified integral or by samples."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Literal

from analytic.errors import InputError, nearest
from reports.api.inputs import OpenScene, Progress, SceneLike, Size, one_error, opened, telling

if TYPE_CHECKING:
    from reports.api.results import Reference
    from validation.estimates.budget import Budget

USUAL_SAMPLES = 2048  #: samples a pixel of a sampling estimator without a budget
USUAL_CLOUD_SAMPLES = 256  #: of one that traces clouds


@one_error
def reference(
    scene: SceneLike,
    estimator: Literal["quadrature", "single-scatter", "volpath", "cloud-paths"] = "quadrature",
    *,
    size: Size | None = None,
    pixel: Literal["centre", "area"] = "centre",
    samples: int | None = None,
    error: float | None = None,
    seconds: float | None = None,
    target: Literal["pooled", "worst"] = "pooled",
    seed: int = 0,
    orders: str | None = None,
    progress: Progress = None,
) -> "Reference":
    """Compute the truth of a scene, with its error; what was computed before comes from the cache.

    Parameters
    ----------
    scene
        See `load_scene`.
    estimator
        'quadrature', with a bound of the error in every pixel; or by random samples, with standard errors,
        'single-scatter' and 'volpath'; of clouds, whose light is scattered many times, 'cloud-paths'.
    size
        Width and height [pixels], or 'WxH'; the scene's own by default.
    pixel
        Of the quadrature: the radiance at a pixel's 'centre', or the mean over its 'area'.
    samples, error, seconds
        When an estimator that samples stops: at so many samples a pixel (2048 where none of the three is given, 256
        of clouds), at a relative standard error, or after a time [s].
    target
        Whether `error` is that of the image, 'pooled', or of its 'worst' pixel.
    seed
        Of the first batch of samples; the others count up.
    orders
        Of clouds, by 'cloud-paths' and 'volpath': layers by order of scattering, such as '1,2,3-4,5-inf'; 'sets', which
        'cloud-paths' has by itself, are those of `airlight reference`, 'all' is none.
    progress
        Called with (share done, what); True shows a bar.

    Raises
    ------
    InputError
        For what the estimator has no use for, and more than one of `samples`, `error` and `seconds`.

    Examples
    --------
    >>> import airlight
    >>> truth = airlight.reference("open-fog", size=(32, 24))
    >>> truth.relative_error < 1e-6
    True
    >>> traced = airlight.reference("open-fog", "single-scatter", size=(32, 24), samples=64)
    >>> traced.standard_error.shape
    (24, 32, 3)
    """
    known = ("quadrature", "single-scatter", "volpath", "cloud-paths")
    if estimator not in known:
        raise InputError(f"estimator: got {estimator!r}, wanted one of {', '.join(known)}" + nearest(estimator, known))
    if orders is not None and estimator not in ("volpath", "cloud-paths"):
        raise InputError(f"orders: {estimator} knows single scattering alone; take 'cloud-paths' or 'volpath'")
    given = {"samples": samples, "error": error, "seconds": seconds}
    if estimator == "quadrature":
        named = [name for name, value in given.items() if value is not None]
        if named:
            others = "'single-scatter', 'volpath' and 'cloud-paths'"
            raise InputError(f"{named[0]}: is for {others}; leave it out, or take one of these")
        with telling(progress, "quadrature") as callback:
            return _quadrature(opened(scene, size), pixel, callback)
    if pixel != "centre":
        raise InputError(
            f"pixel: got {pixel!r}, but {estimator} traces pixel centres; leave it out or take 'quadrature'"
        )
    wanted = orders or ("sets" if estimator == "cloud-paths" else None)
    budget = _budget(given, target, usual=USUAL_SAMPLES if wanted is None else USUAL_CLOUD_SAMPLES)
    with telling(progress, estimator) as callback:
        return _sampled(opened(scene, size), estimator, budget, seed=seed, orders=wanted, callback=callback)


def _quadrature(loaded: OpenScene, pixel: str, callback: Callable[[float, str], None]) -> "Reference":
    import numpy as np

    from reports.api.results import Reference, sealed
    from validation.estimates.images import whole_truth
    from validation.estimates.quadrature import truth_image

    truth = truth_image(loaded.scene, pixel=pixel, progress=lambda done, total, what: callback(done / total, what))
    finite = np.isfinite(truth.airlight)
    mean = float(truth.airlight[finite].mean()) if finite.any() else 0.0
    counts = ("transitions", "checked", "disagreements", "refined", "left")
    return Reference(
        scene=loaded.name,
        image=sealed(whole_truth(loaded, truth, pixel=pixel)),
        estimator="quadrature",
        relative_error=float(truth.airlight_bound[finite].mean()) / mean if mean > 0 else float("nan"),
        details={"pixel": pixel} | {name: getattr(truth, name) for name in counts},
    )


def _sampled(
    loaded: OpenScene,
    estimator: str,
    budget: "Budget",
    *,
    seed: int,
    orders: str | None,
    callback: Callable[[float, str], None],
) -> "Reference":
    from reports.api.results import Reference, sealed
    from validation.estimates.images import cloud_orders, monte_carlo_reference

    chosen = cloud_orders(orders) if orders else None
    estimate = monte_carlo_reference(loaded, estimator, budget=budget, seed=seed, orders=chosen, progress=callback)
    attributes = {name.removeprefix("airlight:"): value for name, value in estimate.image.attributes.items()}
    details: dict[str, Any] = {name: attributes[name] for name in ("spp", "batches", "seeds")}
    details |= {"cached": estimate.cached, "masked": estimate.masked, "reached": estimate.reached}
    return Reference(
        scene=loaded.name,
        image=sealed(estimate.image),
        estimator=estimator,
        relative_error=getattr(estimate.errors, budget.target),
        details=details,
    )


def _budget(given: dict[str, Any], target: Any, *, usual: int) -> "Budget":
    from validation.estimates.budget import Budget

    named = [name for name, value in given.items() if value is not None]
    if len(named) > 1:
        raise InputError(f"{' and '.join(named)} exclude each other; give one of them")
    for name in named:
        kind, words = (int, "a whole number") if name == "samples" else (int | float, "a number")
        if not isinstance(given[name], kind) or not given[name] > 0:
            raise InputError(f"{name}: got {given[name]!r}, wanted {words} above 0")
    if target not in ("pooled", "worst"):
        raise InputError(f"target: got {target!r}, wanted 'pooled' or 'worst'")
    return Budget(
        samples=given["samples"] if named else usual, error=given["error"], seconds=given["seconds"], target=target
    )
