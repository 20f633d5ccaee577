# SPDX-License-Identifier: BSD-3-Clause
"""Results of studies of kernels, for rows and reports, without Dr.Jit; unknown values are None."""

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class KernelErrors:
    """Relative errors of a kernel on a group of rays, see `validation.kernels.errors`."""

    rays: int  #: that the kernel did not refuse
    refused: int
    #: of the errors that are finite [1]; None where there is none, as the next three
    median: float | None
    p99: float | None
    max: float | None
    mean: float | None
    nan: int
    infinite: int  #: where the reference is finite
    negative: int
    #: ray of the largest error, or the first that is not finite, as a line of CSV
    worst: str | None

    @property
    def odd(self) -> int:
        """How many values are not finite or negative."""
        return self.nan + self.infinite + self.negative


@dataclass(frozen=True, kw_only=True)
class Rays:
    """Errors of a kernel on a set of rays, by group; `all` are all of them."""

    name: str
    columns: str  #: of the lines `worst`
    single: Mapping[str, KernelErrors]
    double: Mapping[str, KernelErrors]


@dataclass(frozen=True, kw_only=True)
class Stability:
    """Where a kernel breaks, see `validation.kernels.stability`."""

    kernel: str
    exact: bool  #: whether it claims to be
    refused: Mapping[str, str]  #: its words, by phase function
    sets: tuple[Rays, ...]
    broken: tuple[str, ...]  #: bars that a kernel which claims to be exact does not keep


@dataclass(frozen=True, kw_only=True)
class RayTime:
    """The time of a ray [ns]."""

    median: float
    low: float  #: first quartile
    high: float  #: third quartile
    repetitions: int


@dataclass(frozen=True, kw_only=True)
class KernelCost:
    """The cost of a kernel of one size for one phase function, and its error in float32."""

    kernel: str
    family: str
    size: int | None
    phase: str
    g: float
    rays: int = 0  #: that were timed
    device: RayTime | None = None  #: the kernel alone, where the device tells it
    wall: RayTime | None = None  #: with launch and replay
    median: float | None = None  #: of the relative errors, as the next two
    p99: float | None = None
    max: float | None = None
    nonfinite: int = 0
    refused: str | None = None  #: the kernel's words

    @property
    def time(self) -> RayTime | None:
        """The time by which kernels are compared: the device's where it is known."""
        return self.device or self.wall


@dataclass(frozen=True, kw_only=True)
class ErrorLevel:
    """The cheapest kernel at an error."""

    phase: str
    statistic: str  #: 'max' or 'p99'
    level: float
    cheapest: str | None
    ns: float | None  #: of a ray
