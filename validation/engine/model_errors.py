# SPDX-License-Identifier: BSD-3-Clause
"""The error of an equation apart from the error of the algorithm that solves it.

With P the reference of the physical equation, M that of the engine's own (`reference.scene.model`)
and A the image, pixel by pixel

    A - P = (A - M) + (M - P).

The means of the parts add up. Their squares do not: with the correlation rho of both parts about 0,

    rms(A - P)^2 = rms(A - M)^2 + rms(M - P)^2 + 2 rho rms(A - M) rms(M - P).

A negative rho says that the algorithm hides some of the error of its equation. Terms hide one
another in every mean: a light path that is left out brightens, a softened law dims. Each term is
therefore told alone, as what it does to the mean of the physical image without the others.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from airlight.errors import InputError
from airlight.reference.scene.model import PHYSICAL, Model
from airlight.validation.arrays import Array

_TELLING = 0.3  #: correlation from which on it is told: it moves the sum of squares by a sixth


@dataclass(frozen=True)
class PartError:
    """A difference of two images, relative to the second."""

    mean: float | None  #: of the difference, over the mean of the second [1]
    rmse: float | None  #: root mean square of the difference, over the same mean [1]
    blocks: float | None  #: relative error of block means, as the verdict takes it [1]


@dataclass(frozen=True)
class TermAlone:
    """The effect of one term on the physical image without the others."""

    term: str
    value: str
    mean: float | None  #: change of the mean [1]; None where it has no reference alone
    why: str = ""  #: the reason then


@dataclass(frozen=True)
class ModelErrors:
    """The errors of an equation, of an algorithm, and of both."""

    name: str  #: of the model, empty for terms without a name
    terms: str
    image: PartError  #: image against model
    #: model against physics, and image against physics; None where physics has no light
    against_physics: PartError | None
    total: PartError | None
    correlation: float | None  #: of both parts [1]
    terms_alone: tuple[TermAlone, ...]
    why: str = ""  #: why there is no physical reference

    @property
    def title(self) -> str:
        """The model by its name and its terms."""
        terms = self.terms.replace(",", ", ")
        return f"{self.name}: {terms}" if self.name else terms

    @property
    def lines(self) -> list[str]:
        """Return the three rows, the terms alone, and what the correlation means."""
        rows = (
            ("model against physics", self.against_physics, "what the equation does"),
            ("image against model", self.image, "what the algorithm does"),
            ("image against physics", self.total, "both together"),
        )
        lines = [f"model            {self.title}", _row("", "mean", "rel. rmse", "blocks", "")]
        for name, part, meaning in rows:
            if part is None:
                lines.append(_row(name, "-", "-", "-", self.why))
                continue
            mean = _percent(part.mean, signed=True)
            lines.append(_row(name, mean, _percent(part.rmse), _percent(part.blocks), meaning))
        # Terms that move the mean by less than a ten-thousandth are not told.
        alone = [each for each in self.terms_alone if each.mean is None or abs(each.mean) > 1e-4]
        told = ", ".join(f"{each.term} {_percent(each.mean, signed=True)}" for each in alone)
        lines += [f"terms alone      {told} of the mean"] if alone else []
        return [*lines, *([f"parts            {self.words}"] if self.words else [])]

    @property
    def words(self) -> str:
        """The meaning of the correlation of both parts; empty where it is small or not known."""
        if self.correlation is None or abs(self.correlation) <= _TELLING or not self.total:
            return ""
        assert self.against_physics is not None
        both, equation = self.total.rmse, self.against_physics.rmse
        if both is None or not equation:
            return ""
        part = f"correlation {self.correlation:+.2f}: the algorithm "
        if both < equation:
            return part + f"hides {100 * (1 - both / equation):.2g} % of the error of its equation"
        if both > 2 * equation:
            return part + f"makes the error {both / equation:.2g} times that of its equation"
        return part + f"adds {100 * (both / equation - 1):.2g} % to the error of its equation"


def model_errors(
    image: Array,
    model: Model,
    layer_of: Callable[[Model], Array],
    blocks_of: Callable[[Array, Array], float],
) -> ModelErrors:
    """Return the errors of an image and of its equation.

    Parameters
    ----------
    image
        Radiance, (height, width, 3); pixels that do not count are NaN [W/(m^2 sr)].
    model
        The equation.
    layer_of
        Returns the reference of a model, of what the image shows, in the same shape.
    blocks_of
        Returns the relative error of the block means of an image, from a reference and the image.
    """
    own = layer_of(model)
    image_error = _part(own, image, image, blocks_of)
    try:
        physical = layer_of(PHYSICAL)
    except InputError as error:
        # A sun in a medium without bounds has no physical reference.
        return ModelErrors(
            model.name, model.terms, image_error, None, None, None, (), f"no reference: {error}"
        )
    algorithm, equation = (image - own).ravel(), (own - physical).ravel()
    finite = np.isfinite(algorithm) & np.isfinite(equation)
    squares = [float(np.mean(part[finite] ** 2)) for part in (algorithm, equation)]
    mixed = float(np.mean(algorithm[finite] * equation[finite]))
    size = float(np.sqrt(squares[0] * squares[1]))
    return ModelErrors(
        model.name,
        model.terms,
        image_error,
        _part(physical, own, image, blocks_of),
        _part(physical, image, image, blocks_of),
        mixed / size if size > 0 else None,
        tuple(_alone(term, single, physical, image, layer_of) for term, single in model.alone()),
    )


def _alone(
    term: str, single: Model, physical: Array, shown: Array, layer: Callable[[Model], Array]
) -> TermAlone:
    """Return what one term does to the mean of the physical image, in the pixels that are shown."""
    value = single.terms.partition("=")[2]
    try:
        own = layer(single)
    except InputError as error:
        # A term may need others, such as a law without an end the attenuation.
        return TermAlone(term, value, None, str(error))
    finite = np.isfinite(shown) & np.isfinite(own) & np.isfinite(physical)
    mean = float(physical[finite].mean()) if finite.any() else 0.0
    if mean <= 0:
        return TermAlone(term, value, None, "the physical image is black")
    return TermAlone(term, value, float(own[finite].mean()) / mean - 1)


def _part(
    correct: Array, other: Array, shown: Array, blocks_of: Callable[[Array, Array], float]
) -> PartError:
    """Return the difference of two images in the pixels that are shown."""
    other = np.where(np.isfinite(shown), other, np.nan)
    difference = other - correct
    finite = np.isfinite(difference)
    mean = float(correct[finite].mean()) if finite.any() else 0.0
    if mean <= 0:
        return PartError(None, None, None)
    rmse = float(np.sqrt(np.mean(difference[finite] ** 2))) / mean
    blocks = blocks_of(correct, other)
    return PartError(
        float(difference[finite].mean()) / mean, rmse, blocks if np.isfinite(blocks) else None
    )


def _row(name: str, mean: str, rmse: str, blocks: str, meaning: str) -> str:
    return f"{name:23}{mean:>13}{rmse:>13}{blocks:>13}   {meaning}".rstrip()


def _percent(value: float | None, *, signed: bool = False) -> str:
    if value is None:
        return "-"
    digits = "#.3g" if abs(value) < 1 else ".0f"
    return f"{100 * value:{'+' if signed else ''}{digits}} %"
