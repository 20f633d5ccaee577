# SPDX-License-Identifier: BSD-3-Clause
"""References as layered images, ready to be written, and when a Monte Carlo run ends.

It ends after so many samples, after a time, or when its error is small enough: the standard error
relative to the radiance, either of the image, *pooled*, or of its *worst* pixel:

    pooled = sqrt(sum_p se_p^2) / sum_p L_p             worst = max_p se_p / max(L_p, 0.001 mean(L))

for each channel of each layer, the largest of which counts; pixels are independent of each other.
The floor of a thousandth of the mean is the same as in `airlight compare`. Rays that pass a light
within `validation.estimates.agreement.MASK_PIXELS` pixel widths are left out of the airlight's error:
there no number of samples gives a standard error to trust (DESIGN section 6.6). Where that leaves
out all light of a layer, the error of the image is not known.

The rule looks at the spread alone, never at a reference, so that stopping favours no verdict, and
no run stops on a target before `LEAST_BATCHES`: the standard error of a standard error is 1/sqrt(2
(K - 1)) of it, 13 % at K = 32.
"""

import math
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from airlight.analytic.clock import stopwatch
from airlight.analytic.geometry import foot_and_height
from airlight.errors import InputError
from airlight.reference.monte_carlo.batches import LARGEST_SEED, LAYERS, Batches, seed_ranges
from airlight.reference.monte_carlo.cloud_paths.opacity import seen_clouds
from airlight.reference.quadrature.image import ReferenceImage
from airlight.reference.quadrature.replicates import REPLICATES
from airlight.reference.quadrature.surface import surface_hits
from airlight.reference.scene.clouds import read_clouds
from airlight.reference.scene.model import PHYSICAL, Model
from airlight.reference.scene.read import ReferenceScene, read_reference
from airlight.reference.storage.exr import BATCHES, BOUND, MODEL, PIXEL, SHARED, Image
from airlight.reference.storage.scene_digest import scene_digest
from airlight.validation.arrays import Array, Bools, Progress
from airlight.validation.estimates.agreement import MASK_PIXELS, pixel_angle
from airlight.validation.estimates.monte_carlo import (
    Elsewhere,
    check_model,
    monte_carlo_batches,
)
from airlight.validation.estimates.quadrature import shared_part, stated_error
from airlight.validation.scenes.loading import LoadedScene
from airlight.validation.scenes.models import model_words

LEAST_BATCHES = 32  #: before a standard error is good enough to stop on
USUAL_BATCH = 64  #: samples a pixel


@dataclass(frozen=True)
class Budget:
    """When to stop: exactly one of the three is given.

    Raises
    ------
    InputError
        If none or more than one is given, or one is no positive number.
    """

    samples: int | None = None  #: a pixel, at least
    error: float | None = None  #: relative standard error of all pixels together
    seconds: float | None = None  #: of the whole run; batches from the cache cost next to nothing

    def __post_init__(self) -> None:
        # Exactly one of the three, a positive finite number.
        given = {name: value for name, value in vars(self).items() if value is not None}
        if len(given) != 1:
            what = f"{' and '.join(given)} exclude each other" if given else "a budget of nothing"
            raise InputError(f"{what}; give one of {', '.join(vars(self))}")
        for name, value in given.items():
            kind, words = (
                (int, "a whole number") if name == "samples" else (int | float, "a number")
            )
            if not isinstance(value, kind) or not 0 < value < np.inf:
                raise InputError(f"{name}: got {value!r}, expected {words} above 0")
        if self.error is not None and self.error >= 1:
            raise InputError(f"error: got {self.error:g}, expected less than 1; 0.01 is 1 %")


def layered_reference(
    loaded: LoadedScene,
    reference: ReferenceImage,
    *,
    pixel: str = "centre",
    model: Model = PHYSICAL,
) -> Image:
    """Return the quadrature reference of a loaded scene as layers; the header says of
    which bytes of the scene, and of which model.
    """
    layers = {"airlight": reference.airlight, "surface": reference.surface}
    for layer in LAYERS:
        if (stated := stated_error(reference, layer)) is not None:
            # The name of a layer says what its error is; a standard error is `<layer>_se`.
            error, error_kind = stated
            layers[f"{layer}_bound" if error_kind == "proven" else f"{layer}_error"] = error
    # Only area lights have standard errors and light that the camera sees.
    extent = {
        "airlight_se": reference.airlight_se,
        "surface_se": reference.surface_se,
        "emitted": reference.emitted,
        "emitted_se": reference.emitted_se,
    }
    layers |= {layer: values for layer, values in extent.items() if values is not None}
    made: dict[str, str | int | float] = {
        "airlight:scene": loaded.name,
        "airlight:estimator": "quadrature",
    }
    made |= {PIXEL: pixel, **_digest_of(loaded), **_model_of(model)}
    if "airlight_bound" in layers:
        made[BOUND] = "proven"
    if reference.airlight_se is not None:
        made[BATCHES] = REPLICATES
        made[SHARED] = max(shared_part(reference, layer) for layer in LAYERS)
    return Image(layers, reference.distance, made)


def _digest_of(loaded: LoadedScene) -> dict[str, str]:
    """Return the attribute that identifies the scene of an image, none where nobody can tell."""
    digest = scene_digest(loaded.scene)
    return {} if digest is None else {"airlight:scene_digest": digest}


def _model_of(model: Model) -> dict[str, str]:
    """Return the attribute that tells the model of an image, none for the physical equation."""
    return {} if model.is_physical else {MODEL: model_words(model)}


@dataclass(frozen=True)
class RelativeErrors:
    """The standard error of an image relative to its radiance [1], see the module."""

    pooled: float | None  #: of all pixels together; None where it is not known
    worst: float | None  #: of a single pixel
    unknown: str | None = None  #: why they are not known


@dataclass(frozen=True)
class MonteCarloReference:
    """A reference by random samples, and how it came about."""

    image: Image = field(repr=False)  #: layers with their standard errors
    errors: RelativeErrors
    reached: bool | None  #: whether the target error is known to be reached; None if none was set
    masked: int  #: pixels beside a light, whose airlight is left out of `errors`
    cached: int  #: batches that were in the cache
    damaged: int  #: files of the cache that were damaged and have been replaced


def monte_carlo_reference(
    loaded: LoadedScene,
    estimator: str,
    *,
    budget: Budget,
    seed: int = 0,
    orders: tuple[str, ...] | None = None,
    model: Model = PHYSICAL,
    progress: Progress | None = None,
    elsewhere: Elsewhere | None = None,
) -> MonteCarloReference:
    """Return the mean of an estimator's batches with its standard errors.

    The same samples and seed give the same numbers, whatever was in the cache.

    The `budget` says when to stop by the error of the layers `airlight` and `surface`. The first
    batch has the `seed`, the others count up. A scene of clouds has layers for sets of `orders`,
    see `cloud_orders`; `model` is the equation, for single-scatter. Progress is called with (share
    done, what) after every batch; `elsewhere` traces batches in other processes.
    """
    check_model(model, estimator)
    first_clouds = None
    # Scenes with lights in fog: the airlight of pixels beside a light is left out of the error.
    if orders is None:
        reference = read_reference(loaded.scene, model)
        distance = surface_hits(reference).distance
        near = near_light(reference, distance)
        shape = reference.height, reference.width
    else:
        # Clouds have suns and a sky, which no ray passes near by: no pixel is left out.
        clouds = read_clouds(loaded.scene)
        first_clouds = seen_clouds(clouds)
        distance = first_clouds.distance
        near = np.zeros(len(distance), dtype=bool)
        shape = clouds.height, clouds.width
    # A run with a target or a time has no number of batches: at most as many as there are seeds.
    batches, samples = batch_plan(budget, len(near))
    watch = _Watch(budget, near, progress)
    run = monte_carlo_batches(
        loaded.scene,
        estimator,
        # At least the two that a standard error needs: a seed without two is refused by name.
        batches=batches
        if budget.samples is not None
        else max(2, min(batches, LARGEST_SEED - seed)),
        samples=samples,
        first_seed=seed,
        orders=orders,
        model=model,
        enough=None if budget.error is None else watch.enough,
        go_on=None if budget.seconds is None else watch.go_on,
        progress=watch.tell,
        elsewhere=elsewhere,
    )
    errors = relative_errors(run.batches, near)
    # None where no target was set; an unknown error has not reached it.
    reached = (
        None
        if budget.error is None
        else errors.pooled is not None and errors.pooled <= budget.error
    )
    image = _layered_batches(
        loaded, estimator, run.batches, distance=distance.reshape(shape), model=model
    )
    if first_clouds is not None:
        # Behind a cloud stands the sky, attenuated along the ray; surfaces have no sky behind them.
        transmittance = first_clouds.transmittance.reshape(*shape, 3)
        behind = np.isinf(distance).reshape(*shape, 1) * transmittance * clouds.sky
        image = replace(
            image, layers=dict(image.layers) | {"opacity": 1 - transmittance, "background": behind}
        )
    return MonteCarloReference(image, errors, reached, int(near.sum()), run.cached, run.damaged)


def cloud_orders(words: str) -> tuple[str, ...]:
    """Return the sets of orders that words name, disjoint: '1,2,3-4', 'sets' for the
    usual ones, 'all' for none.
    """
    from airlight.validation.slab.request import order_range, parse_orders

    names = tuple(name for name in parse_orders(words) if name != "all")
    # Sorted by their first order, only neighbours can overlap.
    ranges = sorted(order_range(name) for name in names)
    for (_, last), (first, _) in pairwise(ranges):
        if first <= last:
            raise InputError(
                f"--orders: got {words!r}, which names order {first} twice; expected disjoint sets "
                "of orders"
            )
    return names


class _Watch:
    """The progress of a run: the time that it took, and how its error fell."""

    def __init__(self, budget: Budget, near: Bools, progress: Progress | None) -> None:
        self._budget, self._near, self._progress = budget, near, progress
        self._expected = 0  # batches until the target is reached; not known before the first error
        self._words = ""
        self._took, self._last, self._step = stopwatch(), 0.0, 0.0

    def enough(self, batches: Batches) -> bool:
        """Say whether to stop: at the target, or where the error is not known, which
        more batches do not change.

        The error falls with the square root of the batches, which says how many are expected.
        """
        assert self._budget.error is not None
        error = relative_errors(batches, self._near).pooled
        done = len(batches.seeds)
        if error is None:
            return done >= LEAST_BATCHES
        # The error falls with the square root of the number of batches: done (error/target)^2 in
        # all. 1e6 keeps the square finite.
        self._expected = max(
            LEAST_BATCHES, math.ceil(done * min(1e6, error / self._budget.error) ** 2)
        )
        self._words = f", pooled error {error:.3g} of {self._budget.error:.3g}"
        return done >= LEAST_BATCHES and error <= self._budget.error

    def go_on(self, done: int) -> bool:
        """Say whether another batch will end in time: it may take as long as the one before."""
        assert self._budget.seconds is not None
        # A batch may take as long as the last one: no batch begins that would end after the time.
        return self._took().seconds + self._step <= self._budget.seconds

    def tell(self, done: int, total: int, estimator: str) -> None:
        now = self._took().seconds
        self._step, self._last = now - self._last, now
        if self._progress is None:
            return
        # The fraction that is done: of the time, of the batches, or of the batches that are
        # expected.
        if self._budget.seconds is not None:
            fraction = now / self._budget.seconds
        elif self._budget.samples is not None:
            fraction = done / total
        else:
            fraction = done / max(self._expected, done + 1) if self._expected else 0.0
        self._progress(min(1.0, fraction), f"{estimator}, {done} batches{self._words}")


def _layered_batches(
    loaded: LoadedScene, estimator: str, batches: Batches, *, distance: Array, model: Model
) -> Image:
    shape = (*distance.shape, 3)
    layers = {}
    for number, name in enumerate(batches.layers):
        layers[name] = batches.mean[number].reshape(shape)
        layers[f"{name}_se"] = batches.standard_error[number].reshape(shape)
    attributes: dict[str, str | int | float] = {
        "airlight:scene": loaded.name,
        **_digest_of(loaded),
        **_model_of(model),
        "airlight:estimator": estimator,
        "airlight:spp": batches.samples * len(batches.seeds),
        "airlight:batch_spp": batches.samples,
        "airlight:batches": len(batches.seeds),
        "airlight:seed": batches.seeds[0],
        "airlight:seeds": seed_ranges(batches.seeds),
    }
    return Image(layers, distance, attributes)


def batch_plan(budget: Budget, pixels: int) -> tuple[int, int]:
    """Return how many batches at most, and of how many samples a pixel.

    A given number of samples is split into at least 32 batches where it has as many samples, and
    rounded up to whole ones. The samples of a batch are a power of two up to 64, so that runs of
    other lengths go on from the same batches.
    """
    if budget.samples is not None:
        # At least 32 batches where the samples allow it, each a power of two up to 64 samples; the
        # number of batches is rounded up.
        samples = _power_of_two(min(USUAL_BATCH, budget.samples // LEAST_BATCHES))
        return max(2, -(-budget.samples // samples)), samples
    # A run without a given number of samples has at most 2^16 batches; there are more seeds. One
    # batch of it has at most 2^22 samples, so that the run ends near its target.
    return 1 << 16, _power_of_two(min(USUAL_BATCH, (1 << 22) // pixels))


def _power_of_two(number: int) -> int:
    return 1 << (max(1, number).bit_length() - 1)


def relative_errors(batches: Batches, near: Bools) -> RelativeErrors:
    """Return the relative standard errors of some batches, less the airlight of pixels
    `near` a light, (pixels,).

    The largest of all layers and channels counts; one that is dark has none. They are not known
    where a layer is lit only in pixels that are left out, where no sample brought light, and where
    a number is not finite.
    """
    pooled: list[float] = []
    worst: list[float] = []
    for number, layer in enumerate(LAYERS):
        mean, error = batches.mean[number], batches.standard_error[number]
        if not (np.isfinite(mean).all() and np.isfinite(error).all()):
            return RelativeErrors(None, None, f"the {layer} is not finite in all pixels")
        # Only airlight has heavy tails beside a light; surfaces count everywhere.
        keep = ~near if layer == "airlight" else np.ones_like(near)
        # A channel without light has no relative error.
        lit = mean.any(axis=0)
        mean, error = mean[keep][:, lit], error[keep][:, lit]
        total = mean.sum(axis=0)
        if not (total > 0).all():
            return RelativeErrors(
                None, None, f"all pixels with {layer} lie beside a light, and are left out"
            )
        if lit.any():
            # Pixels are independent: variances add up in the pooled error. The floor of the worst
            # pixel is a thousandth of the mean.
            pooled.append(float((np.sqrt((error**2).sum(axis=0)) / total).max()))
            worst.append(float((error / np.maximum(mean, 1e-3 * total / len(mean))).max()))
    if not pooled:
        return RelativeErrors(None, None, "no sample brought light")
    return RelativeErrors(max(pooled), max(worst))


def near_light(reference: ReferenceScene, distance: Array) -> Bools:
    """Return which pixels' rays pass a light that they see within `MASK_PIXELS`
    pixel widths, (pixels,).

    `distance` is that to the visible surface, (pixels,) [m].
    """
    widest = MASK_PIXELS * pixel_angle(reference)
    near = np.zeros(len(reference.direction), dtype=bool)
    for light in reference.lights:
        origin = np.broadcast_to(reference.origin, reference.direction.shape)
        foot, height = foot_and_height(origin, reference.direction, light.position)
        # The light is in front of the camera, before the visible surface, and within the angle of
        # two pixels.
        near |= (foot > 0) & (foot < distance) & (np.arctan2(height, foot) <= widest)
    return near
