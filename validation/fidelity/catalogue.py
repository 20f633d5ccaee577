# SPDX-License-Identifier: BSD-3-Clause
"""All rows, the experiments that measure them, and the judged rows of a run."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from validation.fidelity import ali, billeter, biri, bouthors, others
from validation.fidelity.ali_figures import ali_figures
from validation.fidelity.billeter_tables import billeter_tables
from validation.fidelity.biri_tables import biri_tables
from validation.fidelity.droplets import droplets
from validation.fidelity.equations import equations
from validation.fidelity.extrusion import extrusion
from validation.fidelity.motion import motions, triangles
from validation.fidelity.ordering import ordering
from validation.fidelity.pictures import levels, maps, orders, shadows, shortcuts, slices, two_lights
from validation.fidelity.polynomials import polynomials
from validation.fidelity.printed import printed
from validation.fidelity.row import Evidence, Row, judge
from validation.fidelity.scattering import ambient_fog, thin_media
from validation.fidelity.tessellation import tessellation
from validation.papers.bouthors import slab_study
from validation.papers.bouthors_clouds import clouds_study
from validation.papers.bouthors_frames import frames_study
from validation.papers.bouthors_transport import transport_study

#: Names of papers on the command line, and in words.
PAPERS: Mapping[str, str] = {
    "biri": "Biri, Arques, Michelin 2006, Real time rendering of atmospheric scattering and volumetric shadows",
    "billeter": "Billeter, Sintorn, Assarsson 2010, Real time volumetric shadows using polygonal light volumes",
    "ali": "Ali 2016, Rendering of light shaft and shadow for indoor environments (reconstructed from captions)",
    "bouthors": "Bouthors, Neyret, Max, Bruneton, Crassin 2008, Interactive multiple anisotropic scattering in clouds",
    "sun": "Sun, Ramamoorthi, Narasimhan, Nayar 2005, A practical analytic single scattering model",
    "pegoraro": "Pegoraro, Parker 2009, An analytical solution to single scattering in homogeneous participating media",
    "chen": "Chen, Baran, Durand, Jarosz 2011, Real-time volumetric shadows using 1D min-max mipmaps",
}

ROWS: tuple[Row, ...] = (*biri.ROWS, *billeter.ROWS, *bouthors.ROWS, *ali.ROWS, *others.ROWS)


@dataclass(frozen=True)
class Experiment:
    """What measures the figures of some rows."""

    compute: Callable[[], dict[str, Any]]
    seconds: float  #: that it takes on two threads, about
    images: bool = True  #: whether it renders anything: what does not is part of a quick report too
    report: bool = True  #: whether reports measure it by itself; what does not is that of `published`, if it is there


#: By name.
EXPERIMENTS: Mapping[str, Experiment] = {
    "nothing": Experiment(dict, 0.0, images=False),
    "equations": Experiment(equations, 0.4, images=False),
    "printed": Experiment(printed, 0.1, images=False),
    "droplets": Experiment(droplets, 3.0, images=False),
    "cloud slab": Experiment(slab_study, 40.0, images=False, report=False),
    "cloud transport": Experiment(transport_study, 90.0, report=False),
    "cloud images": Experiment(clouds_study, 600.0, report=False),
    "cloud frames": Experiment(frames_study, 60.0, report=False),
    "ordering": Experiment(ordering, 1.5, images=False),
    "polynomials": Experiment(polynomials, 2.0, images=False),
    "levels": Experiment(levels, 1.0),
    "shadows": Experiment(shadows, 3.0),
    "extrusion": Experiment(extrusion, 2.0),
    "orders": Experiment(orders, 25.0),
    "shortcuts": Experiment(shortcuts, 10.0),
    "maps": Experiment(maps, 5.0),
    "slices": Experiment(slices, 8.0),
    "two lights": Experiment(two_lights, 10.0),
    "tessellation": Experiment(tessellation, 4.0),
    "ambient fog": Experiment(ambient_fog, 40.0),
    "thin media": Experiment(thin_media, 3.0),
    "motions": Experiment(motions, 15.0),
    "triangles": Experiment(triangles, 15.0),
    "biri tables": Experiment(biri_tables, 90.0),
    "ali figures": Experiment(ali_figures, 60.0, report=False),
    "billeter tables": Experiment(billeter_tables, 150.0, report=False),
}


def experiments_of(rows: Sequence[Row]) -> tuple[str, ...]:
    """Return the names of the experiments that rows need, in the order of `EXPERIMENTS`."""
    needed = {row.experiment for row in rows}
    return tuple(name for name in EXPERIMENTS if name in needed)


def published_figures(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Return every figure that a paper prints: `paper`, `item`, `claim`, `value` and `unit`, ready for JSON."""
    return [
        {"paper": row.paper, "item": row.item, "claim": row.claim, "value": row.published, "unit": row.unit}
        for row in rows
        if isinstance(row.published, (int, float))
    ]


def judged(rows: Sequence[Row], evidence: Mapping[str, Evidence]) -> list[dict[str, Any]]:
    """Return the rows whose experiment was made, each with its verdict, ready for JSON.

    Parameters
    ----------
    rows
        Of `ROWS`.
    evidence
        By name of the experiment, what it gave. A row without is left out: it has no verdict.
    """
    return [judge(row, evidence[row.experiment]) for row in rows if row.experiment in evidence]
