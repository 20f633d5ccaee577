# SPDX-License-Identifier: BSD-3-Clause
"""What a mutation is: a fault of the physics, as a text of a module and what stands in its place."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Mutation:
    """One fault."""

    name: str  #: by which reports and claims name it
    meaning: str  #: what it stands for
    estimator: str  #: 'quadrature' or 'single-scatter'
    module: str  #: the module that is changed
    old: str  #: its text, which occurs once
    new: str  #: what stands in its place
    remark: str = ""  #: why the built-in scenes need not show it
    wide: bool = False  #: a fault of lights with extent, tried in the probes of these alone


#: The modules that a run of each estimator asks for.
TOPS = {
    "quadrature": ("reference.quadrature.image", "reference.scene.read"),
    "single-scatter": ("reference.monte_carlo.single_scatter.integrator", "reference.scene.read"),
}
