# SPDX-License-Identifier: BSD-3-Clause
"""How much time two Monte Carlo estimators need for the same error.

The variance of a mean over batches falls as 1/batches, and the time rises as batches: time times variance is a number
of the estimator alone, and the ratio of two such numbers says how many times faster one reaches the error that the
other has. The variance of a batch is relative to the square of the truth (the quadrature image, the same for both) and
averaged over the pixels whose truth is above 0 and whose ray keeps away from the light (DESIGN section 6.6).

Both are measured in one run, batches taking turns, each kernel compiled before; times are medians. A batch of a
stratified estimator gains from holding many samples, so their number is part of what is stated.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial, reduce

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from reference.monte_carlo.batches import LAYERS, Batches, merged
from reference.monte_carlo.single_scatter.integrator import single_scatter_batch
from reference.monte_carlo.volpath.integrator import volpath_batch
from reference.scene.read import TruthScene, read_truth
from validation.clock import Run, timed
from validation.estimates.agreement import layer_masks
from validation.estimates.quadrature import truth_image
from validation.scenes.loading import resize
from validation.scenes.parts import fog
from validation.scenes.registry import SCENES

Array = NDArray[np.float64]
Batch = Callable[[TruthScene, int, int], Batches]


@dataclass(frozen=True)
class EstimatorCost:
    """What one estimator costs for its error."""

    name: str
    samples: int  #: a pixel in each batch
    batches: int
    seconds: float  #: of one batch, the median
    variance: float  #: relative variance of one batch, mean over the pixels
    variance_error: float  #: relative standard error of `variance`, from the spread between halves of the batches

    @property
    def cost(self) -> float:
        """Seconds for a relative error of one standard deviation: time times relative variance [s]."""
        return self.seconds * self.variance


@dataclass(frozen=True)
class Efficiency:
    """Two estimators of one layer of one scene."""

    layer: str
    pixels: int  #: compared
    masked: int  #: left out because a light is close to their ray
    fast: EstimatorCost
    slow: EstimatorCost

    @property
    def ratio(self) -> float:
        """How many times less time the first takes for the error of the second; infinite if it has none."""
        return self.slow.cost / self.fast.cost if self.fast.cost > 0 else np.inf


def efficiency(
    truth: TruthScene,
    estimators: Mapping[str, tuple[Batch, int]],
    expected: Array,
    *,
    mask: NDArray[np.bool_] | None = None,
    batches: int = 16,
    layer: str = "airlight",
) -> Efficiency:
    """Measure time times variance of two estimators in one run.

    Parameters
    ----------
    truth
        The scene.
    estimators
        Two by name: the function of one batch, and its samples a pixel. The first is expected to be the better one.
    expected
        The layer's reference, (height, width, 3) [W/(m^2 sr)], not black.
    mask
        Pixels to compare, (height, width); all by default.
    batches
        Batches of each, at least 4. A relative variance from n of them in thousands of pixels is good to a few per
        cent.
    layer
        'airlight' or 'surface'.
    """
    chosen = np.ones(expected.shape[:2], dtype=bool) if mask is None else np.asarray(mask)
    lit = chosen[..., None] & np.isfinite(expected) & (expected > 0)
    runs: dict[str, list[Run]] = {name: [] for name in estimators}
    for batch, samples in estimators.values():
        batch(truth, batches, samples)  # compiles the kernels; its seed is that of no other batch
    for seed in range(batches):
        for name, (batch, samples) in estimators.items():
            runs[name].append(timed(partial(batch, truth, seed, samples)))
    costs = [_cost(name, each, (LAYERS.index(layer), expected, lit)) for name, each in runs.items()]
    return Efficiency(layer, int(lit.any(axis=2).sum()), int((~chosen).sum()), *costs)


def scene_efficiency(scene, *, samples: int = 64, batches: int = 8) -> Efficiency:
    """Measure single-scatter against volpath on the airlight of a Mitsuba scene at its own size."""
    truth, image = read_truth(scene), truth_image(scene)
    estimators = {"single-scatter": (single_scatter_batch, samples), "volpath": (volpath_batch, samples)}
    mask = layer_masks(truth, image)["airlight"]
    return efficiency(truth, estimators, image.airlight, mask=mask, batches=batches)


def thin_fog(size: tuple[int, int]):
    """Return `open-fog` with an optical depth of 0.2 from the camera to the lamp, as a Mitsuba scene.

    In thin fog free flights seldom end before the lamp: volpath wastes most of its paths.
    """
    description = SCENES["open-fog"].build()
    lamp = np.array(description["lamp"]["position"])
    distance = float(np.linalg.norm(lamp - np.array(description["sensor"]["to_world"].matrix)[:3, 3]))
    description["fog"] = fog(0.2 / distance, (0.93, 0.87, 0.78))
    scene = mi.load_dict(description)
    resize(scene, size)
    return scene


def _cost(name: str, runs: Sequence[Run], where: tuple[int, Array, NDArray[np.bool_]]) -> EstimatorCost:
    images, half = [run.value for run in runs], len(runs) // 2
    whole, *halves = (_variance(part, where) for part in (images, images[:half], images[half:]))
    spread = abs(halves[0] - halves[1]) / 2
    seconds = 1e-3 * float(np.median([run.ms for run in runs]))
    return EstimatorCost(name, images[0].samples, len(runs), seconds, whole, spread / whole if whole > 0 else 0.0)


def _variance(runs: list[Batches], where: tuple[int, Array, NDArray[np.bool_]]) -> float:
    """Return the relative variance of one batch, the mean over the pixels."""
    number, expected, lit = where
    squares = reduce(merged, runs).squares[number].reshape(expected.shape)[lit] / (len(runs) - 1)
    return float(np.mean(squares / expected[lit] ** 2))


def efficiency_lines(efficiency: Efficiency) -> list[str]:
    """Return what was measured, for people: a line for each estimator and one for the ratio."""
    lines = [
        f"{each.name:16s} {each.samples:4d} samples x {each.batches} batches   {1e3 * each.seconds:9.2f} ms a batch   "
        f"relative variance {each.variance:.3g} (+- {100 * each.variance_error:.0f} %)   "
        f"time x variance {each.cost:.3g} s"
        for each in (efficiency.fast, efficiency.slow)
    ]
    left_out = f", {efficiency.masked} next to a light left out" if efficiency.masked else ""
    lines.append(
        f"{efficiency.fast.name} reaches the error of {efficiency.slow.name} {efficiency.ratio:.0f} times faster "
        f"({efficiency.layer}, {efficiency.pixels} pixels{left_out})"
    )
    return lines
