# SPDX-License-Identifier: BSD-3-Clause
"""A host of shaders, as its caller sees it: the process that draws with one shader."""

from collections.abc import Mapping
from typing import Any

from airlight.realtime.child_process import ChildProcess
from airlight.realtime.errors import NoDriverError


class ShaderHost:
    """A process that draws with one shader; it ends with this object."""

    def __init__(self, name: str) -> None:
        self.device = ""
        self._process = ChildProcess(
            "airlight.realtime.methods.shader.host", name=f"method {name}", silent=True
        )
        self.end = self._process.end

    def ask(
        self, kind: str, arrays: Mapping[str, Any] | None = None, **message: Any
    ) -> tuple[dict[str, Any], Any]:
        """Return the answer to a message, see `realtime.methods.shader.host`, and the image in it.

        Raises
        ------
        NoDriverError
            Where the host has none.
        EndedError
            If it ended, or did not answer in time.
        """
        said, image = self._process.ask((kind, message, arrays or {}))
        if "missing" in said:
            raise NoDriverError(said["missing"])
        return said, image
