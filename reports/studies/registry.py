# SPDX-License-Identifier: BSD-3-Clause
"""The studies by name, and `airlight.study`."""

import importlib
import inspect
from collections.abc import Callable
from typing import Any

from analytic.errors import InputError, nearest

#: Study -> the module of its function, which has the same name; imported when one is asked for.
STUDIES = {
    "methods": "methods",
    "decomposition": "methods",
    "scaling": "growth",
    "map-size": "growth",
    "kernels": "kernels",
    "stability": "kernels",
    "integrals": "kernels",
    "polynomials": "series",
    "noise": "noise",
    "motion": "motion",
    "transmittance": "transmittance",
    "slab": "clouds",
}


def find_study(name: str) -> Callable[..., Any]:
    """Return the function of a study.

    Raises
    ------
    InputError
        For an unknown study; the nearest is named.
    """
    if name not in STUDIES:
        raise InputError(f"study: got {name!r}, wanted one of {', '.join(STUDIES)}" + nearest(name, STUDIES))
    function: Callable[..., Any] = getattr(
        importlib.import_module(f"reports.studies.{STUDIES[name]}"), name.replace("-", "_")
    )
    return function


def summary(name: str) -> str:
    """Return the first sentence of a study's help."""
    return " ".join((inspect.getdoc(find_study(name)) or "").split("\n\n")[0].split())


def study(name: str, *arguments: Any, **named: Any) -> Any:
    """Run a study: measurements of methods and kernels, with tables and a figure.

    `airlight study NAME --help` says what a study takes. It returns rows, tables
    and data; `save`, or -o, writes tables (.csv, .tex, .md), data (.json) or the figure (.pdf, .png).

    Parameters
    ----------
    name
        Of `airlight list studies`.
    arguments, named
        What the study takes.

    Raises
    ------
    InputError
        For an unknown study, and what the study refuses.

    Examples
    --------
    >>> import airlight
    >>> airlight.study("slab", 2.0, 30.0, orders=[1])["1"]["reflectance"] > 0
    True
    """
    return find_study(name)(*arguments, **named)
