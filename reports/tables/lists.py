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
        (
            method.name,
            method.summary,
            method.uses_kernel(method.parameters()),
            method.shadows,
            _defaults(method.defaults),
            method.source,
        )
        for method in METHODS.values()
    ]
    return table("", words("name", "what", "kernel", "shadows", "parameters", "source", how=_LONG), rows)


def kernel_list() -> Table:
    """Return the airlight kernels with the defaults of their parameters."""
    from realtime.kernels.registry import KERNELS

    rows = [(kernel.name, kernel.summary, _defaults(kernel.parameters), kernel.source) for kernel in KERNELS.values()]
    return table("", words("name", "what", "parameters", "source", how=_LONG), rows)


def _defaults(parameters) -> str:
    return ", ".join(f"{name}={value}" for name, value in parameters.items())
