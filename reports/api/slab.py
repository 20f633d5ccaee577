# SPDX-License-Identifier: BSD-3-Clause
"""The Python API for slabs: light by order of scattering."""

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from reports.api.inputs import Progress, one_error, telling


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class SlabResult:
    """The light of a slab by order of scattering.

    `orders` holds a row for each set of orders, with `orders` (its name), `reflectance`, `transmittance`,
    `reflected_mean`, `reflected_rms`, `transmitted_mean`, `transmitted_rms` [mean free paths] and `fluence`, a row for
    each depth. `total` has `reflectance`, `transmittance`, `flux` and `radiance` of all orders.
    """

    tau: float  #: thickness [mean free paths]
    sun: float  #: zenith angle of the sun [degrees]
    albedo: float
    phase: str
    orders: tuple[Mapping[str, Any], ...]
    total: Mapping[str, Any]
    error: Mapping[str, Any]  #: the estimated error of every number of `orders` and `total`, in its place
    photons: Mapping[str, Any] | None  #: the same by photons, with standard errors, where they were asked for

    def __len__(self) -> int:
        return len(self.orders)

    def __getitem__(self, name: str | int) -> Mapping[str, Any]:
        """Return the row of a set of orders by its name, such as '3-4', or of one order by its number."""
        for row in self.orders:
            if row["orders"] == str(name):
                return row
        raise KeyError(name)

    def to_dict(self) -> dict[str, Any]:
        """Return what `airlight slab --json` prints."""
        named = {name: getattr(self, name) for name in ("tau", "sun", "albedo", "phase")}
        named |= {"orders": list(self.orders), "total": self.total, "error": self.error}
        return json.loads(json.dumps(named | ({"photons": self.photons} if self.photons else {})))

    def _repr_html_(self) -> str:
        from reports.api.html import block
        from reports.tables.drawing import html
        from reports.tables.slab import slab_tables

        return block(self._title(), *(html(table) for table in slab_tables(self.to_dict())))

    def _title(self) -> str:
        return f"slab of {self.phase}, tau {self.tau:g}, sun at {self.sun:g} degrees, albedo {self.albedo:g}"

    def __repr__(self) -> str:
        return f"SlabResult({self._title()})"


@one_error
def slab(
    tau: float,
    sun: float,
    *,
    phase: str | os.PathLike[str] = "isotropic",
    albedo: float = 1.0,
    orders: str | Sequence[str | int] = "sets",
    depths: Sequence[float] | None = None,
    directions: Sequence[tuple[float, float]] = (),
    photons: int = 0,
    seed: int = 0,
    progress: Progress = None,
) -> SlabResult:
    """Compute the light of a homogeneous slab in sunlight by order of scattering.

    Order n is light that was scattered n times. Displacements are measured from the point of entry, horizontally, in
    mean free paths: the mean along the direction in which the sun's light travels, and rms, the root of the mean of
    x^2 + y^2.

    Parameters
    ----------
    tau
        Thickness [mean free paths], 1e-6 to 1e4.
    sun
        Zenith angle of the sun [degrees], from 0 to below 90.
    phase
        'isotropic', 'hg:G', 'hg-draine:D', 'mie', 'mie-modified', or the path of a CSV file of angles [degrees] and
        values.
    albedo
        Single-scattering albedo, 0 to 1.
    orders
        Such as [1, 2, '3-4', '31-inf'], 'sets' for those of Bouthors 2008, or 'all'.
    depths
        Where fluence, flux and radiance are wanted [mean free paths], from the top; top and bottom by default.
    directions
        Of the radiance: mu, positive upwards, and phi [degrees], 0 forward.
    photons
        How many photons check the numbers.
    seed
        Of the photons.
    progress
        Called with (share done, what); True shows a bar.

    Raises
    ------
    InputError
        For numbers out of range, unknown names, or a file that is not a phase function.

    Examples
    --------
    >>> import airlight
    >>> light = airlight.slab(2.0, 30.0, phase="hg:0.75", albedo=0.9, orders=[1, 2])
    >>> round(light["1"]["reflectance"], 4) > 0
    True
    """
    from analytic.errors import InputError
    from validation.slab.light import slab_numbers
    from validation.slab.request import slab_request

    if photons != int(photons) or photons == 1 or photons < 0:
        raise InputError(f"photons: got {photons}, wanted a whole number from 2 on, for example 1000000")
    request = slab_request(
        tau, sun, phase=os.fspath(phase), albedo=albedo, orders=orders, depths=depths, directions=directions
    )
    with telling(progress, "slab") as tell:
        numbers = slab_numbers(request, photons=int(photons), seed=seed, progress=tell)
    return SlabResult(**{"photons": None, **numbers, "orders": tuple(numbers["orders"])})
