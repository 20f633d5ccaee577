# SPDX-License-Identifier: BSD-3-Clause
"""The regressions of all configurations, and the JSON file in which the package keeps them."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from analytic.errors import InputError
from reference.storage.files import atomic_path
from validation.advise.features import FEATURES
from validation.advise.regression import Regression
from validation.configurations.methods import Configuration

PACKAGED = Path(__file__).with_name("model.json")
_FORMAT = 2


@dataclass(frozen=True)
class ConfigurationModel:
    """What is known of a configuration."""

    chosen: Configuration
    error: Regression  #: of the decimal logarithm of the relative RMSE
    cost: Regression  #: of that of the milliseconds of a frame for a million pixels
    scenes: int  #: that it was fitted to
    refused: int  #: scenes that it refused


@dataclass(frozen=True)
class AdviceModel:
    """What a sweep says of configurations."""

    configurations: tuple[ConfigurationModel, ...]
    about: Mapping[str, Any]  #: where it comes from: scenes, versions, device, which cost, what it was judged by

    def as_data(self) -> dict[str, Any]:
        """Return it as plain data."""
        return {
            "format": _FORMAT,
            "about": dict(self.about),
            "features": list(FEATURES),
            "configurations": [
                {
                    "method": each.chosen.method,
                    "kernel": each.chosen.kernel,
                    "parameters": dict(each.chosen.parameters),
                    "scenes": each.scenes,
                    "refused": each.refused,
                    "error": each.error.as_data(),
                    "cost": each.cost.as_data(),
                }
                for each in self.configurations
            ],
        }


def write_model(model: AdviceModel, path: Path = PACKAGED) -> None:
    """Write a model, whole or not at all."""
    with atomic_path(path) as part:
        part.write_text(json.dumps(model.as_data()) + "\n", encoding="utf-8")


def read_model(path: Path = PACKAGED) -> AdviceModel:
    """Read a model.

    Raises
    ------
    InputError
        For a file that is missing, or that another version wrote.
    """
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"advice: cannot read {path}: {error}; fit it by airlight advise --fit DIR") from error
    if not isinstance(data, dict) or data.get("format") != _FORMAT or data.get("features") != list(FEATURES):
        raise InputError(f"advice: {path} is of another version; fit it again by airlight advise --fit DIR")
    return AdviceModel(
        tuple(
            ConfigurationModel(
                Configuration(each["method"], each["kernel"], tuple(each["parameters"].items())),
                Regression.from_data(each["error"]),
                Regression.from_data(each["cost"]),
                each["scenes"],
                each["refused"],
            )
            for each in data["configurations"]
        ),
        data["about"],
    )
