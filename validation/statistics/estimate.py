# SPDX-License-Identifier: BSD-3-Clause
"""A number with its error: what it can answer, and what it cannot.

An `Estimate` has a value, an error, and the kind of that error:

proven       the true number is at most one error away: a bound that was derived, or 0 for a plain fact
estimated    it is about one error away: by two rules of an integral, or by a finer one
statistical  twice the error is half of a 95 % interval. It is a standard error, widened by Student's law where few
             samples gave it

An error that is not known is None, not 0. Questions are answered by `exceeds` and `within`: yes, no
or unknown. An `Answer` has no truth value, so that `if estimate.within(margin)` is an error of the
program instead of a verdict.
"""

import enum
import math
from dataclasses import dataclass
from typing import Literal, NoReturn

Kind = Literal["proven", "estimated", "statistical"]
INTERVAL = 2.0  #: statistical errors that are half of a 95 % interval, by their definition


class Answer(enum.Enum):
    """The answer of an estimate to a question."""

    YES = "yes"
    NO = "no"
    UNKNOWN = "unknown"

    def __bool__(self) -> NoReturn:
        raise TypeError(
            "an answer may be unknown: compare it with Answer.YES, Answer.NO or Answer.UNKNOWN"
        )


@dataclass(frozen=True)
class Estimate:
    """A number and its error."""

    value: float | None  #: None where it is not known
    error: float | None = None  #: None where it is not known
    kind: Kind = "statistical"

    def ends(self, errors: float = INTERVAL) -> tuple[float, float] | None:
        """Return the ends of the interval of the true number; None where
        value or error is not known.

        Parameters
        ----------
        errors
            How many statistical errors the interval has to each side [1]; other kinds have one.

        """
        if self.value is None or self.error is None:
            return None
        half = self.error * (errors if self.kind == "statistical" else 1.0)
        finite = math.isfinite(self.value) and math.isfinite(half)
        return (self.value - half, self.value + half) if finite else None

    def exceeds(self, limit: float, errors: float = INTERVAL) -> Answer:
        """Return whether the true number is above a limit; `errors` as of `ends`."""
        ends = self.ends(errors)
        if ends is None or ends[0] <= limit < ends[1]:
            return Answer.UNKNOWN
        return Answer.YES if ends[0] > limit else Answer.NO

    def within(self, margin: float, errors: float = INTERVAL) -> Answer:
        """Return whether the true number is between -margin and +margin; `errors` as of `ends`."""
        ends = self.ends(errors)
        if ends is None:
            return Answer.UNKNOWN
        if -margin <= ends[0] and ends[1] <= margin:
            return Answer.YES
        return Answer.NO if ends[0] > margin or ends[1] < -margin else Answer.UNKNOWN

    def words(self, times: float = 1.0, unit: str = "") -> str:
        """Return the number, so many times, with its error and a unit."""
        if self.value is None:
            return "unknown"
        value = f"{times * self.value:.4g}"
        if self.error is None:
            return f"{value}{unit} (its error is unknown)"
        return f"{value} +- {times * self.error:.2g}{unit}" if self.error else f"{value}{unit}"

    def percent(self) -> str:
        """Return the number with its error in per cent."""
        return self.words(100, " %")


UNKNOWN = Estimate(None)


def fact(value: float) -> Estimate:
    """Return a number without an error: a count, or a number computed from all values."""
    return Estimate(value, 0.0, "proven")
