# SPDX-License-Identifier: BSD-3-Clause
"""What the view shows, and the commands that show or render it again."""

import shlex
from collections.abc import Mapping
from dataclasses import dataclass, field

from validation.scenes.changes import Values, change_words
from validation.study.configuration import Configuration


@dataclass(frozen=True)
class ViewState:
    """A scene, what of it was changed, and the configuration that renders it."""

    scene: str  #: name or path, as the user gave it
    size: tuple[int, int]  #: of the image [pixels]
    chosen: Configuration
    changes: Mapping[str, Values] = field(default_factory=dict)  #: `validation.scenes.changes`

    def command(self, name: str) -> str:
        """Return the line to type that shows this: `name` is 'view', 'render' or 'reference'."""
        words = ["airlight", name, self.scene]
        if name != "reference":
            words += ["--method", self.chosen.method]
            words += ["--set", f"kernel={self.chosen.kernel}"] if self.chosen.kernel else []
            for parameter, value in self.chosen.parameters:
                words += ["--set", f"{parameter}={value}"]
        for word in change_words(self.changes):
            words += ["--change", word]
        words += ["--size", f"{self.size[0]}x{self.size[1]}"]
        return shlex.join(words)
