# SPDX-License-Identifier: BSD-3-Clause
"""Typed parameters: each stands once, with its default, its choices or range, its
unit and a sentence of help.

A method has a frozen dataclass of them, derived from `Parameters`, whose fields are made by
`parameter`. Conversion of words, checks, their messages, `airlight list methods` and the tables of
the documentation all follow from the fields.

>>> from dataclasses import dataclass
>>> @dataclass(frozen=True)
... class Steps(Parameters):
...     steps: int = parameter(16, "steps of every ray", least=1)
>>> read_parameters("mine", Steps, {"steps": "24"})
Steps(steps=24)
>>> Steps(steps=0)
Traceback (most recent call last):
airlight.errors.InputError: steps: got 0, expected a whole number of at least 1
"""

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import Field, dataclass, field, fields
from numbers import Integral, Real
from typing import Any

from airlight.errors import InputError, nearest

MOST_STEPS = 10**7  #: of a ray: float32, in which they are counted, has no odd number above 2^24

_TRUE, _FALSE = ("true", "yes", "on", "1"), ("false", "no", "off", "0")


@dataclass(frozen=True)
class Parameters:
    """The values of a method's parameters; a method without any has this class itself.

    Raises
    ------
    InputError
        When it is made, for a value outside its choices or range, and for values
        that contradict one another.
    """

    def __post_init__(self) -> None:
        for item in fields(self):
            _check_value(item, getattr(self, item.name))
        self._check_together()

    def _check_together(self) -> None:
        """Refuse values that contradict one another, by `InputError`."""


@dataclass(frozen=True)
class Limits:
    """The metadata of a parameter's field: its help and the values that it may have."""

    help: str
    choices: tuple[Any, ...] = ()
    least: float | None = None  #: smallest value
    most: float | None = None  #: largest value
    above: float | None = None  #: values are larger than this
    below: float | None = None  #: values are smaller than this
    also: tuple[Any, ...] = ()  #: values outside that range with a special meaning
    unit: str = ""
    wanted: str = ""  #: what a message asks for, where the range alone would not say it well
    check: Callable[[Any], None] | None = None  #: refuses what no range describes


def parameter(default: Any, help: str, **limits: Any) -> Any:
    """Return the field of a parameter, for a frozen dataclass of them.

    Parameters
    ----------
    default
        The value if the user gives none; its type is the type of the parameter.
    help
        A sentence for `airlight list methods`.
    limits
        The other fields of `Limits`, by name: choices, a range, a unit, a check.
    """
    return field(default=default, metadata={"limits": Limits(help, **limits)})


def limits_of(item: Field) -> Limits:
    """Return the limits of a parameter; a field that was made without `parameter` has none."""
    return item.metadata.get("limits", Limits(""))


def defaults(kind: type[Parameters]) -> dict[str, Any]:
    """Return the defaults of parameters by their names."""
    return {item.name: item.default for item in fields(kind)}


def values(parameters: Parameters) -> dict[str, Any]:
    """Return the values of parameters by their names."""
    return {item.name: getattr(parameters, item.name) for item in fields(parameters)}


def read_parameters(
    method: str,
    kind: type[Parameters],
    given: Mapping[str, Any],
    *,
    others: Iterable[str] = (),
    see: str = "",
) -> Any:
    """Return the parameters of a method from values or words, the others with their defaults.

    Parameters
    ----------
    method
        The name of the method, for messages.
    kind
        The class of its parameters.
    given
        Values by name; a word is converted to the type of the default.
    others
        Names of parameters that other code reads, for messages.
    see
        A method that has more parameters, for messages.

    Raises
    ------
    InputError
        For an unknown name (the nearest is named), a value of the wrong type, and values that
        `Parameters` refuses.
    """
    of_method = defaults(kind)
    converted = {}
    # A word from the command line becomes a value of the type of the default.
    for name, value in given.items():
        if name not in of_method:
            # The message names the nearest spelling, or else the method that has such parameters.
            names = [*of_method, *others]
            expected = ", ".join(names) or "none"
            more = nearest(name, names) or (see and f"; for what its paper does, see {see}")
            raise InputError(
                f"method {method}: got a parameter {name!r}, expected one of: {expected}{more}"
            )
        converted[name] = _converted(f"method {method}: {name}", value, of_method[name])
    # The class checks ranges, and values against one another, as it is made.
    return kind(**converted)


def wanted_values(item: Field) -> str:
    """Return in words which values a parameter may have."""
    limits = limits_of(item)
    if limits.choices:
        return "one of " + ", ".join(str(choice) for choice in limits.choices)
    return limits.wanted or _range(limits, item.default) + (
        f" [{limits.unit}]" if limits.unit else ""
    )


def _range(limits: Limits, default: Any) -> str:
    if isinstance(default, bool | str):
        return "true or false" if isinstance(default, bool) else "a word"
    # A bool is an int in Python: it is sorted out above.
    words = "a whole number" if isinstance(default, int) else "a finite number"
    if limits.least is not None:
        words += (
            f" of at least {limits.least:g}" if limits.most is None else f" from {limits.least:g}"
        )
    if limits.above is not None:
        words += f" above {limits.above:g}"
    if limits.most is not None:
        words += f" to {limits.most:g}"
    if limits.below is not None:
        words += f" up to, but not, {limits.below:g}"
    return words


def _check_value(item: Field, value: Any) -> None:
    limits = limits_of(item)
    # A check by a function has its own message.
    if limits.check is not None:
        limits.check(value)
    elif not _allowed(limits, item.default, value):
        hint = nearest(value, limits.choices) if limits.choices and isinstance(value, str) else ""
        raise InputError(f"{item.name}: got {value!r}, expected {wanted_values(item)}{hint}")


def _allowed(limits: Limits, default: Any, value: Any) -> bool:
    if not _of_kind(value, default):
        return False
    # Choices are complete in themselves; ranges are for numbers alone, and `also` lists values
    # outside the range with a special meaning.
    if limits.choices:
        return value in limits.choices
    if isinstance(default, bool | str) or value in limits.also:
        return True
    if not math.isfinite(value):
        return limits == Limits(limits.help)  # It has no limits: every value is allowed.
    return (
        (limits.least is None or value >= limits.least)
        and (limits.most is None or value <= limits.most)
        and (limits.above is None or value > limits.above)
        and (limits.below is None or value < limits.below)
    )


def _of_kind(value: Any, default: Any) -> bool:
    """Return whether a value is of the kind of a default: a bool is no number, and
    NumPy's numbers are numbers.
    """
    kind = next((kind for kind in (bool, Integral, Real, str) if isinstance(default, kind)), object)
    return isinstance(value, kind) and isinstance(value, bool) == isinstance(default, bool)


def _converted(what: str, value: Any, default: Any) -> int | float | str:
    """Return a value in the type of the default."""
    # The bool first: it is an int in Python.
    if isinstance(default, bool):
        word = str(value).strip().lower()
        if word not in _TRUE + _FALSE:
            raise InputError(f"{what} got {value!r}, expected true or false")
        return word in _TRUE
    if isinstance(default, float):
        try:
            return float(value)
        except (TypeError, ValueError):
            raise InputError(f"{what} got {value!r}, expected a number, such as 0.5") from None
    if isinstance(default, int):
        try:
            # int() would cut off what stands behind the point, and take True for 1.
            if isinstance(value, float | bool):
                raise TypeError
            return int(value)
        except (TypeError, ValueError):
            raise InputError(f"{what} got {value!r}, expected a whole number") from None
    return str(value)
