# SPDX-License-Identifier: BSD-3-Clause
"""`airlight.list`: the built-in scenes, methods, kernels, studies and papers."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

from analytic.errors import InputError, nearest
from reports.tables.drawing import text_of
from reports.tables.record import Result
from reports.tables.table import Table, table, words

_LONG = {"long": True}


@dataclass(frozen=True, repr=False)
class Listing(Result):
    """The available names, a table for each kind."""

    kinds: Mapping[str, Table]
    single: bool  #: whether one kind was asked for

    def to_dict(self) -> Any:
        """Return the rows as words: by kind, or of the requested one."""
        data = {
            kind: [{key: text_of(value) for key, value in row.values.items()} for row in each.rows]
            for kind, each in self.kinds.items()
        }
        return next(iter(data.values())) if self.single else data

    @property
    def tables(self) -> Sequence[Table]:
        """The tables."""
        named = {} if self.single else {kind: kind.capitalize() for kind in self.kinds}
        return [replace(each, title=named.get(kind, "")) for kind, each in self.kinds.items()]


def list_(what: Literal["scenes", "methods", "kernels", "studies", "papers"] | None = None) -> Listing:
    """List the built-in scenes, methods, kernels, studies and papers.

    The lists of methods and kernels name their parameters with the defaults, which `--set` changes.

    Parameters
    ----------
    what
        One of them; all by default.
    """
    kinds = {"scenes": _scenes, "methods": _methods, "kernels": _kernels, "studies": _studies, "papers": _papers}
    if what is not None and what not in kinds:
        raise InputError(f"list: got {what!r}, wanted one of {', '.join(kinds)}" + nearest(what, kinds))
    chosen = kinds if what is None else {what: kinds[what]}
    return Listing({kind: made() for kind, made in chosen.items()}, what is not None)


def _scenes() -> Table:
    from validation.scenes.registry import SCENES

    return table("", words("name", "purpose", "published", how=_LONG), map(vars, SCENES.values()))


def _methods() -> Table:
    from realtime.methods.registry import METHODS

    rows = [
        (each.name, each.summary, each().uses_kernel, each.shadows, _defaults(each), each.source)
        for each in METHODS.values()
    ]
    return table("", words("name", "what", "kernel", "shadows", "parameters", "source", how=_LONG), rows)


def _kernels() -> Table:
    from realtime.kernels.registry import KERNELS

    rows = [(each.name, each.summary, _words(each.parameters), each.source) for each in KERNELS.values()]
    return table("", words("name", "what", "parameters", "source", how=_LONG), rows)


def _studies() -> Table:
    from reports.studies.registry import STUDIES, summary

    return table("", words("name", "what", how=_LONG), [(name, summary(name)) for name in STUDIES])


def _papers() -> Table:
    from validation.papers.claims import papers

    return table("", words("name", "paper", how=_LONG), list(papers().items()))


def _defaults(method: Any) -> str:
    from realtime.parameters import defaults

    return _words(defaults(method))


def _words(parameters: Mapping[str, Any]) -> str:
    return ", ".join(f"{name}={value}" for name, value in parameters.items())
