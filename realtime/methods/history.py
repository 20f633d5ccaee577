# SPDX-License-Identifier: BSD-3-Clause
"""`NAME+history`: any method with a mean over the frames before, which
`realtime.frame.history` takes.
"""

from dataclasses import dataclass, field, fields, make_dataclass

from airlight.errors import InputError
from airlight.realtime.methods.interface.method import Method
from airlight.realtime.parameters import Parameters, defaults, parameter

ENDING = "+history"


@dataclass(frozen=True)
class History(Parameters):
    """How frames are averaged."""

    alpha: float = parameter(0.1, "weight of the newest frame", above=0, most=1)
    reproject: str = parameter(
        "none",
        "the last frame in the same pixel, or where it showed the surface of the pixel",
        choices=("none", "surface"),
    )
    clamp: str = parameter(
        "none",
        "values of the last frames as they are, in the range of the 3 x 3 pixels of the newest, or "
        "within one standard "
        "deviation of their mean",
        choices=("none", "range", "variance"),
    )


def with_history(method: type[Method]) -> type[Method]:
    """Return a method that averages the airlight of its frames, with the parameters of
    `History` beside its own.

    Raises InputError for a method that has parameters of these names.
    """
    names = [item.name for item in fields(History)]
    # A class has one field of a name: the method's own would be lost.
    taken = sorted(set(names) & set(defaults(method)))
    if taken:
        raise InputError(
            f"method {method.name}{ENDING}: the method has a parameter {taken[0]!r} of its own; "
            "rename it"
        )

    def history(self) -> History:
        return History(*(getattr(self, name) for name in names))

    # A class derived from the method has all of its members; frames read `history` to average its
    # airlight.
    what = {
        "name": method.name + ENDING,
        "summary": f"{method.summary}; averaged over the frames before",
        "history": property(history),
    }
    added = [
        (item.name, item.type, field(default=item.default, metadata=item.metadata))
        for item in fields(History)
    ]
    return make_dataclass("WithHistory", added, bases=(method,), frozen=True, namespace=what)
