# SPDX-License-Identifier: BSD-3-Clause
"""All mutations: faults of the physics that the checks of the truth ought to find.

The text that a mutation replaces must occur exactly once in its module, which a test checks for all: who moves a
formula moves its mutation too.
"""

from collections.abc import Sequence

from analytic.errors import InputError, nearest
from validation.mutations import area as area_mutations
from validation.mutations import directional as directional_mutations
from validation.mutations import quadrature as quadrature_mutations
from validation.mutations import single_scatter as single_scatter_mutations
from validation.mutations.record import Mutation

QUADRATURE = quadrature_mutations.MUTATIONS + directional_mutations.QUADRATURE + area_mutations.QUADRATURE
SINGLE_SCATTER = (
    single_scatter_mutations.MUTATIONS + directional_mutations.SINGLE_SCATTER + area_mutations.SINGLE_SCATTER
)
MUTATIONS: tuple[Mutation, ...] = QUADRATURE + SINGLE_SCATTER


def chosen_mutations(names: Sequence[str] | None) -> tuple[Mutation, ...]:
    """Return the mutations of these names, all where none is given.

    Raises
    ------
    InputError
        For a name that is not in the catalogue.
    """
    known = {mutation.name: mutation for mutation in MUTATIONS}
    for name in names or ():
        if name not in known:
            raise InputError(f"mutation: got {name!r}, wanted one of {', '.join(known)}" + nearest(name, known))
    return tuple(known[name] for name in names) if names else MUTATIONS
