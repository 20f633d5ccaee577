# SPDX-License-Identifier: BSD-3-Clause
"""The study of one scene: its truth, how far that can be trusted, and every configuration measured against it."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from realtime.plan import Plan
from realtime.scene import read_scene
from reference.quadrature import TruthImage
from validation.agreement import Agreement, agreements
from validation.bench import Measurement, configurations_for, measure
from validation.configurations import STANDARD, Configuration
from validation.load import LoadedScene, load_scene
from validation.multiple import MultipleScattering, multiple_scattering_share
from validation.truth import truth_image

Progress = Callable[[float, str], None]

_MULTIPLE = (64, 48)  # pixels of the image whose multiple scattering is measured: one share, of the whole image


@dataclass(frozen=True)
class Effort:
    """How much work a study does."""

    name: str
    image: tuple[int, int]  #: width and height of the images that are compared and shown [pixels]
    timed: tuple[int, int]  #: width and height of the frames that are timed [pixels]
    checked: tuple[int, int]  #: width and height of the comparisons of the truth [pixels]
    margins: Mapping[str, float]  #: by estimator, of its relative bias
    seconds: float  #: spent on each timing
    samples: int = 64  #: a pixel in each batch of these comparisons
    flip: bool = False  #: compute HDR-FLIP of every image
    mutations: bool = False  #: count how many faults of the physics the checks of the truth find
    rays: int = 0  #: generated rays on which kernels are tried, besides the certified ones; 0 leaves this out


def _margins(single_scatter: float, volpath: float) -> Mapping[str, float]:
    return {"single-scatter": single_scatter, "volpath": volpath}


#: What `report --quick` looks at unless told otherwise: scenes whose check by volpath takes seconds.
QUICK_SCENES = ("open-fog", "sphere-spot", "two-pens")

EFFORTS: dict[str, Effort] = {
    effort.name: effort
    for effort in (
        Effort("quick", (320, 240), (320, 240), (80, 60), _margins(0.002, 0.02), 0.15, samples=16),
        Effort("default", (400, 300), (800, 600), (120, 90), _margins(0.0005, 0.01), 0.4, flip=True, rays=20_000),
        Effort(
            "full",
            (800, 600),
            (800, 600),
            (160, 120),
            _margins(0.0005, 0.002),
            1.0,
            flip=True,
            mutations=True,
            rays=100_000,
        ),
    )
}


@dataclass(frozen=True)
class SceneStudy:
    """What a study of a scene found."""

    loaded: LoadedScene
    plan: Plan
    truth: TruthImage
    agreement: dict[str, Agreement]  #: by estimator and layer
    multiple: MultipleScattering  #: what single scattering leaves out
    measurements: tuple[Measurement, ...]


def study_scene(
    name_or_path: str,
    effort: Effort,
    *,
    configurations: Sequence[Configuration] = STANDARD,
    progress: Progress | None = None,
) -> SceneStudy:
    """Study one scene.

    Parameters
    ----------
    name_or_path
        A built-in scene or the path of a Mitsuba XML file.
    effort
        How much work to do.
    configurations
        What to measure; variants that the scene has no use for are left out.
    progress
        Called with (share done, what) now and then.
    """
    tell = progress or (lambda share, what: None)
    loaded = load_scene(name_or_path, effort.image)
    tell(0.0, "the quadrature truth")
    scene = read_scene(loaded.scene)
    truth = truth_image(loaded.scene)
    tell(0.1, "single-scatter")
    small = load_scene(name_or_path, effort.checked)
    agreed = agreements(
        small.scene, effort.margins, samples=effort.samples, progress=lambda share, what: tell(0.1 + 0.35 * share, what)
    )
    tell(0.45, "multiple scattering")
    multiple = multiple_scattering_share(load_scene(name_or_path, _MULTIPLE).scene)
    timed = None
    if effort.timed != effort.image:
        timed = read_scene(load_scene(name_or_path, effort.timed).scene)
    chosen = configurations_for(scene.plan, configurations)
    measurements = []
    for number, one in enumerate(chosen):
        tell(0.5 + 0.5 * number / len(chosen), one.label)
        measurements.append(
            measure(scene, one, truth=truth, timed=timed, seconds=effort.seconds, with_flip=effort.flip)
        )
    tell(1.0, "done")
    return SceneStudy(loaded, scene.plan, truth, agreed, multiple, tuple(measurements))
