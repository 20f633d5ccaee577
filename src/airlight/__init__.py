# SPDX-License-Identifier: BSD-3-Clause
"""airlight: how fast, accurate and robust is a real-time method for volumetric light?

The public Python API, re-exported from the packages that implement it. Names are imported when they
are first used, so that `airlight --help` imports neither Mitsuba nor SciPy: `__init__.pyi` beside
this file says where each is, to editors and type checkers too.

>>> import airlight
>>> exact = airlight.reference("open-fog", size=(32, 24))  # a built-in scene, or the path of a Mitsuba XML file
>>> frame = airlight.render("open-fog", "ray-march", size=(32, 24), steps=64)
>>> airlight.compare(exact, frame).metrics.relative_rmse < 0.01
True

Every command but `test` and `completion` is a function of the same name; the other names are what
these are made of.
"""

import sys
from types import ModuleType
from typing import Any

import lazy_loader

__version__ = "0.9.0.dev0"  #: of the next release until it is made, see docs/tools/release.py


class _Package(ModuleType):
    """A package whose function `reference` stays one: an import of the folder of this
    name does not replace it.
    """

    def __setattr__(self, name: str, value: Any) -> None:
        if name != "reference" or not isinstance(value, ModuleType):
            super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
__all__ += ["__version__"]
