# SPDX-License-Identifier: BSD-3-Clause
"""An image that is to be judged or explained: which layer of it, its values, and which
of its pixels take part.
"""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TypeVar

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation

from airlight.errors import InputError
from airlight.reference.quadrature.image import ReferenceImage
from airlight.reference.quadrature.surface import emitted_light, surface_hits
from airlight.reference.scene.model import PHYSICAL, Model
from airlight.reference.scene.read import ReferenceScene, read_reference
from airlight.reference.scene.varying import GridMedium
from airlight.reference.storage.exr import PIXEL, TOTAL, Image, layer, layer_names, read_exr
from airlight.validation.arrays import Array, Bools, Index
from airlight.validation.estimates.quadrature import reference_layer
from airlight.validation.fog_model.radiance import FogModel, scene_fog
from airlight.validation.fog_model.view import (
    SAMPLES,
    SCENERY,
    Ends,
    Scenery,
    View,
    scattering_paths,
    view_of,
)
from airlight.validation.metrics.errors import wrong_pixels
from airlight.validation.scenes.changes import UNCHANGED, Changes, change_words
from airlight.validation.scenes.loading import LoadedScene, load_scene

Result = TypeVar("Result")  #: the result of an attempt at an image

AIRLIGHT, SURFACE = "airlight", "surface"
KINDS = (AIRLIGHT, SURFACE, TOTAL)  #: what a layer may hold; the total is the sum of the others
REST = f"{TOTAL} - {AIRLIGHT}"  #: a layer of surfaces, where a file has only the others

# The last part of a layer's name, in small letters; Blender calls its passes
# VolumeDir and Volume Direct.
_HOLDS = {AIRLIGHT: AIRLIGHT, "volumedir": AIRLIGHT, "volume direct": AIRLIGHT, SURFACE: SURFACE}
_WHOLE = "combined"  # the last part of the name that Blender gives to all light
PIXEL_WORDS = {"centre": "at pixel centres", "area": "means over pixels"}
#: what a pixel may be: the radiance at its centre, or the mean over its area
PIXELS = tuple(PIXEL_WORDS)

#: Distance of the two pixels of a pair [pixels]: a filter that is wider than a pixel joins them, so
#: that pairs show which errors are shared (`validation.engine.decide.Blocks`).
APART = 2

_SIDE = 3  # rays along a side of a pixel, for means over its area
_MOST_SAMPLES = 128  # of an area light


@dataclass(frozen=True)
class JudgedLayer:
    """A layer of an image."""

    name: str
    holds: str  #: 'airlight', 'surface' or 'total'
    values: NDArray[np.floating]  #: (height, width, 3) [W/(m^2 sr)]
    #: whether a layer of all light shows the area lights themselves: files of our own do not
    emitted: bool = True

    @property
    def size(self) -> tuple[int, int]:
        """Width and height [pixels]."""
        return int(self.values.shape[1]), int(self.values.shape[0])


def judged_layer(
    image: Image, path: str | os.PathLike[str], *, name: str | None = None, holds: str | None = None
) -> JudgedLayer:
    """Return the layer to judge.

    Parameters
    ----------
    image, path
        The image, and its name in messages.
    name
        The layer. By default 'airlight' where there is one, else the plain channels, else the only
        layer, else the only one that Blender calls Combined.
    holds
        The kind of light in the layer, one of `KINDS`; by default as its name says, else all light.

    Raises
    ------
    InputError
        If `holds` is no such word, or no layer is the usual one.
    """
    if holds is not None and holds not in KINDS:
        raise InputError(f"holds {holds}; expected one of {', '.join(KINDS)}")
    chosen = _usual(image, path) if name is None else name or TOTAL
    values = layer(image, chosen, path)
    emitted = "emitted" not in image.layers and "airlight:scene" not in image.attributes
    return JudgedLayer(
        chosen, holds or _HOLDS.get(chosen.rpartition(".")[2].lower(), TOTAL), values, emitted
    )


def whole_layer(
    path: str | os.PathLike[str], *, name: str | None = None, holds: str | None = None
) -> tuple[Image, JudgedLayer]:
    """Return one of several images that are judged together, with its layer, see `judged_layer`.

    Raises InputError for a file that holds a part of its frame: the rest is no black image.
    """
    image = read_exr(path)
    if image.with_data() is not None:
        raise InputError(f"{path} holds a part of its frame alone; expected all pixels of it")
    return image, judged_layer(image, path, name=name, holds=holds)


def expected_layer(reference: ReferenceImage, judged: JudgedLayer) -> Array:
    """Return the correct values of a layer, (height, width, 3) [W/(m^2 sr)]."""
    return reference_layer(reference, judged.holds, emitted=judged.emitted)


def _usual(image: Image, path: str | os.PathLike[str]) -> str:
    """Return the name of the layer to judge where the user names none."""
    # Errors are no image.
    colours = [each for each in image.layers if not each.endswith(("_se", "_error", "_bound"))]
    for usual in (AIRLIGHT, TOTAL):
        if usual in colours:
            return usual
    # The only layer there is, or the only one that Blender calls Combined.
    whole = [each for each in colours if each.rpartition(".")[2].lower() == _WHOLE]
    for several in (colours, whole):
        if len(several) == 1:
            return several[0]
    raise InputError(
        f"{path} has no channels R, G, B and no layer 'airlight'; it has {layer_names(image)}"
        + ("; name one by --layer" if colours else "")
    )


@dataclass(frozen=True)
class Observation:
    """An image that is to be explained, and which of its pixels and rays are looked at."""

    reference: ReferenceScene
    values: Array  #: (pixels, 3), all pixels of the image, row by row [W/(m^2 sr)]
    holds: str  #: 'airlight', 'surface' or 'total'
    used: Bools  #: which pixels may take part, (pixels,)
    area: bool = False  #: whether a pixel is a mean over its area, or the value at its centre
    samples: int = SAMPLES  #: how many stand for an area light, see `needed_samples`
    #: how many rays are looked at, at most; by default every pixel of an image of 64 x 48
    rays: int = 3200
    #: distance of the two pixels of a pair [pixels], where not all are looked at; 0: no pairs
    apart: int = APART
    steps: int = 0  #: shadow rays that find the lit parts of a ray; 0: they are exact
    equation: Model = PHYSICAL  #: that the image should solve

    def view(self, scenery: Scenery = SCENERY) -> View:
        """Return the rays of the pixels that take part: one at random of each of as many
        equal parts of the image.
        """
        pixels, count = np.flatnonzero(self.used), self.most_pixels
        if len(pixels) > count:
            # One place at random in each of `count` equal parts of the list of pixels. Every second
            # pixel gives way to a partner of the one before it.
            places = (np.arange(count) + np.random.default_rng(0).random(count)) * (
                len(pixels) / count
            )
            pixels = np.unique(pixels[np.minimum(places.astype(np.int64), len(pixels) - 1)])
            if self.apart:
                pixels = self._with_partners(pixels[::2])
            # Chance may meet none of the pixels that are cut off: the same fraction of them joins.
            pixels = np.union1d(
                pixels, self.cut_off[_evenly(len(self.cut_off), count / int(self.used.sum()))]
            )
        side = _SIDE if self.area else 0
        return view_of(self.reference, pixels, scenery, rays_per_side=side, steps=self.steps)

    @cached_property
    def cut_off(self) -> Index:
        """The pixels with values that are cut off, (n,)."""
        return np.flatnonzero(
            stopped(np.where(self.used[:, None], self.values, np.nan)).any(axis=1)
        )

    def model(self, view: View, scenery: Scenery, layer: int, ends: Ends | None) -> FogModel:
        """Return the paths of a layer of the image, 0: airlight, 1: surfaces, with
        nodes between ends of a fog.
        """
        return FogModel(
            view, scattering_paths(view, scenery, layers=(layer,), ends=ends, samples=self.samples)
        )

    @property
    def most_pixels(self) -> int:
        """How many pixels the rays allow; 64 at least, whatever rays they need."""
        # A ray counts once for each sample of an area light.
        return max(
            64,
            self.rays
            // ((_SIDE**2 if self.area else 1) * (self.samples if self.reference.area else 1)),
        )

    def held(self, layers: Array) -> Array:
        """Return the light that the image holds of airlight and surfaces, (2, m, 3)."""
        return np.asarray(
            layers[0]
            if self.holds == AIRLIGHT
            else layers[1]
            if self.holds == SURFACE
            else sum(layers)
        )

    def _with_partners(self, pixels: Index) -> Index:
        """Return pixels, and their partners to the right that can take part too."""
        # A partner must be in the same row: numbers go on in the next one.
        width, partners = self.reference.width, pixels + self.apart
        partners = partners[(pixels % width + self.apart < width) & (partners < len(self.used))]
        return np.asarray(np.union1d(pixels, partners[self.used[partners]]), dtype=np.int64)


def stopped(values: Array) -> Bools:
    """Return which values are cut off: eight values or more are equal to the largest one."""
    most = values[np.isfinite(values)].max(initial=0.0)
    largest = values == most
    return np.asarray(
        largest if most > 0 and np.count_nonzero(largest) >= 8 else np.zeros_like(largest)
    )


def _evenly(count: int, fraction: float) -> Index:
    """Return a fraction of `count` numbers from 0 on, four at least, spread evenly."""
    return np.linspace(0, count - 1, min(count, max(4, round(count * fraction)))).astype(np.int64)


def observation_of(
    image: Image,
    judged: JudgedLayer,
    scene: "mi.Scene",
    *,
    mask: Bools | None = None,
    model: Model = PHYSICAL,
) -> tuple[Observation, tuple[str, ...]]:
    """Return a layer of an image that is to be explained, and the faults of the file: pixels
    that are not finite. `model` is the equation that the image should solve.

    Neither a fit nor a diagnosis explains an area light itself, whose radiance no fog makes. Pixels
    that show one take no part, nor do their neighbours, nor pixels that the file does not hold or a
    mask leaves out.
    """
    if mask is not None and np.shape(mask) != judged.values.shape[:2]:
        shape = " x ".join(str(side) for side in np.shape(mask)[::-1])
        raise InputError(
            f"the mask is {shape} pixels, the image {judged.size[0]} x {judged.size[1]}; give one "
            "of the image's size"
        )
    # The media stay those of the scene: hypotheses may have other phase functions.
    reference = read_reference(scene, replace(model, phase="scene", lit="off"))
    if isinstance(reference.medium, GridMedium):
        raise InputError(
            "the medium is a density grid, whose images fits and diagnoses do not predict; "
            "expected homogeneous media "
            "or height fog: compare with the reference alone, without --fit and --diagnose"
        )
    if reference.background is not None and reference.sky is not None:
        raise InputError(
            f"light '{reference.background.id()}' is a sky, whose light fits and diagnoses do not "
            "know; expected "
            "lights of type 'point', 'spot', 'directional' or 'area'"
        )
    # Pixels row by row; a grey layer has the same value in all channels.
    values = np.asarray(judged.values, dtype=np.float64)
    values = np.broadcast_to(
        values.reshape(-1, values.shape[-1]), (judged.size[0] * judged.size[1], 3)
    ).copy()
    # A pixel that a mask leaves out, or that the file does not hold, is no fault of the file.
    finite: Bools = np.asarray(np.isfinite(values).all(axis=1))
    used: Bools = finite.copy()
    chosen = image.with_data(None if mask is None else np.asarray(mask) != 0)
    if chosen is not None:
        used &= np.asarray(chosen).ravel()
        finite |= ~np.asarray(chosen).ravel()
    # Only an image of all light shows the lights themselves. `lit` are the pixels that show one.
    if (
        (reference.area or reference.background is not None)
        and judged.holds == TOTAL
        and judged.emitted
    ):
        lit = (
            emitted_light(reference, surface_hits(reference).distance)
            .any(axis=1)
            .reshape(reference.height, reference.width)
        )
        used &= ~binary_dilation(lit, np.ones((3, 3), dtype=bool)).ravel()
    observation = Observation(
        reference,
        values,
        judged.holds,
        np.asarray(used),
        samples=needed_samples(reference),
        equation=model,
    )
    return observation, wrong_pixels(
        ~finite.reshape(reference.height, reference.width), "left out, NaN or infinite"
    )


def with_rest(image: Image) -> Image:
    """Return an image that has airlight and all light, but no surfaces, with the difference of both
    as the layer `REST`; any other image, and one whose airlight is all light, as it is.
    """
    if not {AIRLIGHT, TOTAL} <= image.layers.keys() or SURFACE in image.layers:
        return image
    total, airlight = (np.asarray(image.layers[name], float) for name in (TOTAL, AIRLIGHT))
    if total.shape != airlight.shape:
        return image
    # Halves have eleven bits: what is less than the last of them is no surface.
    rest = np.where(np.abs(total - airlight) > 2.0**-10 * np.abs(total), total - airlight, 0.0)
    return replace(image, layers={**image.layers, REST: rest}) if rest.any() else image


def layers_of(
    image: Image, path: str, name: str | None, holds: str | None
) -> tuple[JudgedLayer, ...]:
    """Return the layers to explain: the named layer, or airlight and surface where an image
    has both.
    """
    if name is None and holds is None and AIRLIGHT in image.layers:
        surface = next((each for each in (SURFACE, REST) if each in image.layers), None)
        if surface is not None:
            return (
                judged_layer(image, path, name=AIRLIGHT),
                judged_layer(image, path, name=surface, holds=SURFACE),
            )
    return (judged_layer(image, path, name=name, holds=holds),)


def pixel_kinds(image: Image, pixel: str | None) -> tuple[str, ...]:
    """Return the possible kinds of an image's pixels: as given, as an
    image of ours says, or both.
    """
    if pixel is not None and pixel not in PIXELS:
        raise InputError(f"pixel: got {pixel}, expected 'centre' or 'area'")
    kind = pixel or image.attributes.get(PIXEL)
    if kind in PIXELS:
        return (str(kind),)
    # Images of ours without that word: methods render pixel centres, path tracing means over areas.
    if "airlight:method" in image.attributes:
        return ("centre",)
    return ("area",) if "airlight:spp" in image.attributes else PIXELS


@dataclass(frozen=True)
class PixelKind:
    """Whether the pixels of an image are centres or areas."""

    pixel: str  #: 'centre' or 'area'
    #: mean relative errors by kind, if several kinds were compared
    errors: Mapping[str, float] = field(default_factory=dict)

    @property
    def words(self) -> str:
        """Which kind fits, and how well, or why that was not asked."""
        names = {"centre": "centres", "area": "means over the area"}
        if not self.errors:
            return f"judged by {names[self.pixel]}"
        # The kind that fits comes first: `!=` is false for it.
        own, other = (
            f"{100 * self.errors[kind]:.3g} % off" for kind in sorted(PIXELS, key=self.pixel.__ne__)
        )
        another = next(names[kind] for kind in PIXELS if kind != self.pixel)
        return f"{names[self.pixel]} fit: {own} where the two differ; {another}: {other}"


def decide_pixel(
    kinds: Sequence[str],
    attempt: Callable[[str], Result],
    errors: Callable[[Sequence[Result]], Sequence[float]],
    exact: Callable[[Result], bool] = lambda result: False,
) -> tuple[PixelKind, Result]:
    """Return the kind of an image's pixels, and the attempt for this kind.

    `kinds`: the possible kinds, see `pixel_kinds`; `errors`: the errors of attempts, which are
    compared where there are several; `exact`: whether the error of an attempt is so small that no
    other attempt can have a smaller one.
    """
    attempts: list[Result] = []
    for kind in kinds:
        attempts.append(attempt(kind))
        if len(kinds) == 1 or exact(attempts[-1]):
            return PixelKind(kind), attempts[-1]
    by_kind = dict(zip(kinds, errors(attempts), strict=True))
    pixel = min(by_kind, key=by_kind.__getitem__)
    return PixelKind(pixel, by_kind), attempts[kinds.index(pixel)]


def relative_errors(predicted: Array, shown: Array, floor: float) -> Array:
    """Return the errors of values relative to the larger of both, or to a floor; 1
    where one is not finite.
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        errors = (shown - predicted) / np.maximum(
            np.maximum(np.abs(shown), np.abs(predicted)), floor
        )
    return np.where(np.isfinite(errors), errors, 1.0)


def needed_samples(reference: ReferenceScene) -> int:
    """Return how many samples stand for an area light: twice as many until
    the image hardly changes.

    A window before pillars needs 128 samples where a lamp above an edge needs 16: each sample has
    its own shadows.
    """
    samples, fog = SAMPLES, scene_fog(reference)
    if not reference.area:
        return samples
    # 48 pixels, spread evenly, say how many samples are enough.
    count = reference.width * reference.height
    view = view_of(reference, np.unique(np.linspace(0, count - 1, min(count, 48)).astype(np.int64)))

    def image(samples: int) -> Array:
        return FogModel(view, scattering_paths(view, samples=samples)).layers(fog).sum(axis=0)

    values = image(samples)
    while samples < _MOST_SAMPLES:
        finer = image(2 * samples)
        # Enough: twice the samples change the image by less than 0.5 % in the mean.
        change = np.abs(finer - values) / np.maximum(finer, 0.01 * finer.mean())
        if float(change.mean()) < 0.005:
            break
        samples, values = 2 * samples, finer
    return samples


def scene_of_size(
    scene: str,
    size: tuple[int, int],
    path: str | os.PathLike[str],
    changes: Changes = UNCHANGED,
    model: Model | None = None,
) -> LoadedScene:
    """Return a scene at the size of an image of it; one that was changed says so in its name.

    A `model` stands in the place of that which the scene names.
    """
    # The shape of the image must be that of the scene, to a pixel in either direction.
    loaded = load_scene(scene)
    width, height = (
        (int(n) for n in loaded.scene.sensors()[0].film().size())
        if loaded.scene.sensors()
        else size
    )
    if (
        abs(size[0] * height / width - size[1]) >= 1
        and abs(size[1] * width / height - size[0]) >= 1
    ):
        raise InputError(
            f"{path} is {size[0]} x {size[1]} pixels, {size[0] / size[1]:.4g} to 1; {loaded.name} "
            f"is {width} x "
            f"{height}, {width / height:.4g} to 1: render it at that size or a multiple or a "
            "fraction of it"
        )
    loaded = load_scene(scene, size, changes)
    loaded = loaded if model is None else replace(loaded, model=model)
    words = " and ".join(change_words(changes))
    return replace(loaded, name=f"{loaded.name} with {words}") if changes else loaded


def model_notes(loaded: LoadedScene) -> tuple[str, ...]:
    """Return whose equation the references of a scene solve; nothing for the physical one."""
    if loaded.model.is_physical:
        return ()
    return (f"judged by the equation of {loaded.model.title}, which is not the physical one",)
