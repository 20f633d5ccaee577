# SPDX-License-Identifier: BSD-3-Clause
"""`airlight.list`: the built-in scenes, methods, kernels, models, studies and papers."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

from airlight.errors import InputError, nearest
from airlight.reports.tables.drawing import text_of
from airlight.reports.tables.record import Result
from airlight.reports.tables.table import Table, table, words

_LONG = {"long": True}


def list(
    what: Literal["scenes", "methods", "kernels", "models", "studies", "papers"] | None = None,
) -> "Listing":
    """List the built-in scenes, methods, kernels, models, studies and papers.

    The lists of methods and kernels name their parameters with the defaults, which `--set` changes.
    The list of models has the equations of engines for `--model`: their parameters, their terms, the
    version that was read, and what was not checked.

    Parameters
    ----------
    what
        One of them; all by default.
    """
    kinds = {
        "scenes": _scenes,
        "methods": _methods,
        "kernels": _kernels,
        "models": _models,
        "studies": _studies,
        "papers": _papers,
    }
    if what is not None and what not in kinds:
        raise InputError(
            f"list: got {what!r}, expected one of {', '.join(kinds)}" + nearest(what, kinds)
        )
    asked = tuple(kinds) if what is None else (what,)
    return Listing(kinds=asked, listed=tuple(kinds[kind]() for kind in asked))


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Listing(Result):
    """Lists of what is built in."""

    kinds: tuple[str, ...]  #: what each lists
    listed: tuple[Table, ...]

    @property
    def title(self) -> str:
        """The only list, or all."""
        return self.kinds[0] if len(self.kinds) == 1 else "list"

    @property
    def tables(self) -> Sequence[Table]:
        """The lists; several have titles to tell them apart."""
        if len(self.kinds) == 1:
            return self.listed
        return [replace(t, title=kind.capitalize()) for kind, t in zip(self.kinds, self.listed)]

    @property
    def lines(self) -> Sequence[str]:
        """Nothing."""
        return ()

    def to_dict(self) -> dict[str, Any]:
        """Return the rows of each list by its name."""
        return dict(zip(self.kinds, map(_data, self.listed)))


def _data(shown: Table) -> Sequence[dict[str, str]]:
    return [{key: text_of(value) for key, value in row.values.items()} for row in shown.rows]


def _scenes() -> Table:
    from airlight.validation.scenes.registry import SCENES

    return table("", words("name", "purpose", "published", how=_LONG), map(vars, SCENES.values()))


def _methods() -> Table:
    from airlight.realtime.methods.registry import METHODS

    rows = [
        (each.name, each.summary, each().uses_kernel, each.shadows, _defaults(each), each.source)
        for each in METHODS.values()
    ]
    return table(
        "", words("name", "what", "kernel", "shadows", "parameters", "source", how=_LONG), rows
    )


def _kernels() -> Table:
    from airlight.realtime.kernels.registry import KERNELS

    rows = [
        (each.name, each.summary, _words(each.parameters), each.source) for each in KERNELS.values()
    ]
    return table("", words("name", "what", "parameters", "source", how=_LONG), rows)


def _models() -> Table:
    from airlight.validation.scenes.models import PRESETS

    rows = [
        (
            each.key,
            f"{each.title} {each.version}",
            "; ".join(f"{one.words}: {one.what}" for one in each.parameters),
            each.terms,
            each.read,
            each.unchecked,
        )
        for each in PRESETS.values()
    ]
    columns = words(
        "name", "engine", "parameters", "terms", "read", how=_LONG, unchecked="not checked"
    )
    return table("", columns, rows)


def _studies() -> Table:
    from airlight.reports.studies.registry import STUDIES, summary

    return table("", words("name", "what", how=_LONG), [(name, summary(name)) for name in STUDIES])


def _papers() -> Table:
    from airlight.validation.papers.claims import papers

    return table("", words("name", "paper", how=_LONG), [*papers().items()])


def _defaults(method: Any) -> str:
    from airlight.realtime.parameters import defaults

    return _words(defaults(method))


def _words(parameters: Mapping[str, Any]) -> str:
    return ", ".join(f"{name}={value}" for name, value in parameters.items())
