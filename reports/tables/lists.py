# SPDX-License-Identifier: BSD-3-Clause
"""What there is: built-in scenes, methods, kernels."""

from reports.tables.table import Table, table, words

_LONG = {"long": True}


def scene_list() -> Table:
    """Return the built-in scenes."""
    from validation.scenes.registry import SCENES

    return table("", words("name", "purpose", "published", how=_LONG), map(vars, SCENES.values()))


def method_list() -> Table:
    """Return the real-time methods with the defaults of their parameters."""
    from realtime.methods.registry import METHODS

    rows = [
        (one.name, one.summary, one.uses_kernel(one.parameters()), one.shadows, _defaults(one.defaults), one.source)
        for one in METHODS.values()
    ]
    return table("", words("name", "what", "kernel", "shadows", "parameters", "source", how=_LONG), rows)


def kernel_list() -> Table:
    """Return the airlight kernels with the defaults of their parameters."""
    from realtime.kernels.registry import KERNELS

    rows = [(one.name, one.summary, _defaults(one.parameters), one.source) for one in KERNELS.values()]
    return table("", words("name", "what", "parameters", "source", how=_LONG), rows)


def _defaults(parameters) -> str:
    return ", ".join(f"{name}={value}" for name, value in parameters.items())
