# SPDX-License-Identifier: BSD-3-Clause
"""What there is: built-in scenes, methods, kernels."""

from reports.tables.table import Column, Table, Value, table


def scene_list() -> Table:
    """Return the built-in scenes."""
    from validation.scenes.registry import SCENES

    columns = (_words("name"), _words("purpose"), _words("published"))
    return table("", columns, [(one.name, one.purpose, one.published) for one in SCENES.values()])


def method_list() -> Table:
    """Return the real-time methods with the defaults of their parameters."""
    from realtime.methods.registry import METHODS

    columns = [_words(name) for name in ("name", "what", "kernel", "shadows", "parameters", "source")]
    rows = [
        (one.name, one.summary, one.uses_kernel, one.shadows, _defaults(one.defaults), one.source)
        for one in METHODS.values()
    ]
    return table("", columns, rows)


def kernel_list() -> Table:
    """Return the airlight kernels with the defaults of their parameters."""
    from realtime.kernels.registry import KERNELS

    columns = [_words(name) for name in ("name", "what", "parameters", "source")]
    rows: list[tuple[Value, ...]] = [
        (one.name, one.summary, _defaults(one.parameters), one.source) for one in KERNELS.values()
    ]
    return table("", columns, rows)


def _words(name: str) -> Column:
    return Column(name, name, words=True, long=True)


def _defaults(parameters) -> str:
    return ", ".join(f"{name}={value}" for name, value in parameters.items())
