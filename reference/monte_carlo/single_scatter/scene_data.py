# SPDX-License-Identifier: BSD-3-Clause
"""A scene for the integrator `single-scatter`: its lights, the bounds of its media, and the features that are refused.

`reference.scene.read` reads the same scene for the quadrature; the two share no code. Here the emitters, phase
functions and media stay Mitsuba's own and are asked for their answers while rays are traced.
"""

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from analytic.errors import InputError
from reference.monte_carlo.single_scatter.boundary_walk import (
    Surroundings,
    coefficients,
    read_surroundings,
    require_homogeneous,
)
from reference.monte_carlo.single_scatter.density_grid import read_majorant
from reference.monte_carlo.single_scatter.height_fog import HeightDensity, read_height_density
from reference.monte_carlo.single_scatter.sources import FarSource, Source, is_sky, read_source


@dataclass(frozen=True)
class Task:
    """The constants of a scene while it is traced."""

    around: Surroundings  #: what rays can meet
    sources: tuple[Source, ...]  #: the lights
    samples: int  #: distances for each ray, light and medium
    grey: bool  #: no medium's extinction depends on the channel
    fog: HeightDensity | None = None  #: what camera rays start in, where that is height fog
    majorant: float = 0.0  #: the largest extinction of what camera rays start in, where that is a density grid [1/m]


def read_task(scene, medium, samples: int) -> Task:
    """Read what the estimator needs from a Mitsuba scene.

    `scene`: the `mi.Scene`; `medium`: what camera rays start in: a Mitsuba medium, a pointer to one, or None for a
    vacuum; `samples`: distances for each ray, light and medium. Raises InputError for an emitter, a medium or a
    material that it has no answer for.
    """
    sources = tuple(read_source(emitter) for emitter in scene.emitters())
    around, media = read_surroundings(scene)
    own = medium if isinstance(medium, mi.Medium) else None
    fog, majorant = read_height_density(own) if own else None, read_majorant(own) if own else 0.0
    if fog is not None or majorant:
        return Task(around, sources, samples, grey=True, fog=fog, majorant=majorant)
    if isinstance(medium, mi.Medium):
        require_homogeneous(medium)
        media = [*media, medium]
    far = [source.emitter for source in sources if isinstance(source, FarSource)]
    if far:
        _refuse_unbounded(scene, medium, far[0])
    known = medium is None or isinstance(medium, mi.Medium)
    return Task(around, sources, samples, grey=known and all(_is_grey(each) for each in media))


def _refuse_unbounded(scene, medium, emitter) -> None:
    """Refuse a medium without bounds: what camera rays start in where nothing bounds it, or the exterior of a bound."""
    inside = [shape.interior_medium() for shape in scene.shapes()]
    around = [shape.exterior_medium() for shape in scene.shapes()]
    if isinstance(medium, mi.Medium) and medium not in inside:
        around.append(medium)
    for outside in around:
        if outside is None:
            continue
        _, sigma_t = coefficients(mi.MediumPtr(outside), mi.Bool(True))
        kind = "a sky" if is_sky(emitter) else "directional"
        if max(float(np.ravel(channel)[0]) for channel in sigma_t):
            raise InputError(
                f"single-scatter: light '{emitter.id()}' is {kind}: nothing of it arrives through a medium "
                "without bounds; give the medium bounds, a closed shape of material 'null' with the medium as its "
                "interior"
            )


def _is_grey(medium) -> bool:
    _, sigma_t = coefficients(mi.MediumPtr(medium), mi.Bool(True))
    dr.eval(sigma_t)
    return len({float(np.ravel(channel)[0]) for channel in sigma_t}) == 1
