# SPDX-License-Identifier: BSD-3-Clause
"""A host of shaders, as its caller sees it: started, asked, and ended where it does not answer in time."""

import io
import json
import os
import struct
import subprocess
import sys
import threading
import weakref
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from airlight.realtime.errors import InputError, NoDriverError

_LIMIT, LIMIT_VARIABLE = 300.0, "AIRLIGHT_METHOD_LIMIT"  # that a user's method may take for one scene or command [s]
_LONGEST = 2e9  # s: `signal.alarm`, by which the host ends a driver that never returns, takes 2^31 - 1 at most


def method_limit() -> float:
    """Return how long a user's method may take for one scene, or one command [s]."""
    given = os.environ.get(LIMIT_VARIABLE) or str(_LIMIT)
    with suppress(ValueError):
        if 0 < float(given) <= _LONGEST:
            return float(given)
    raise InputError(f"{LIMIT_VARIABLE}: got {given!r}, expected a time above 0 up to {_LONGEST:g}, such as 300 [s]")


class ShaderHost:
    """A process that draws with one shader; it ends with this object."""

    def __init__(self, name: str) -> None:
        self.name, self.limit = name, method_limit()
        self.device = ""
        command = [sys.executable, "-P", str(Path(__file__).with_name("host.py")), str(self.limit)]
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
        )
        self.end = weakref.finalize(self, _end, self._process)

    def ask(self, kind: str, arrays: Mapping[str, Any] | None = None, **message: Any) -> tuple[dict[str, Any], Any]:
        """Return the answer to a message, see `realtime.methods.shader.host`, and the image in it.

        Raises
        ------
        NoDriverError
            Where the host has none.
        InputError
            If it ended, or did not answer in time.
        """
        import numpy as np  # here: anyone who prints help has this module too

        packed = io.BytesIO()
        words = np.array(json.dumps(message | {"kind": kind}))
        np.savez(packed, message=words, **(arrays or {}))
        late = threading.Event()

        def stop() -> None:
            late.set()
            self._process.kill()

        timer = threading.Timer(self.limit, stop)
        timer.daemon = True
        timer.start()
        try:
            answer = self._exchange(struct.pack("<Q", packed.tell()) + packed.getvalue())
        finally:
            timer.cancel()
        if answer is None:
            self.end()
            if late.is_set():
                raise InputError(
                    f"method {self.name}: no frame within {self.limit:g} s; its process was ended; "
                    f"{LIMIT_VARIABLE}={2 * self.limit:g} allows more"
                )
            raise InputError(f"method {self.name}: ended its process, exit status {self._process.returncode}")
        with np.load(io.BytesIO(answer)) as archive:
            said = json.loads(str(archive["message"]))
            image = archive["image"] if "image" in archive.files else None
        if "missing" in said:
            raise NoDriverError(said["missing"])
        return said, image

    def _exchange(self, message: bytes) -> bytes | None:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        try:
            self._process.stdin.write(message)
            self._process.stdin.flush()
        except (BrokenPipeError, ValueError):  # it ended, or was ended before
            return None
        head = self._process.stdout.read(8)
        if len(head) < 8:
            return None
        (size,) = struct.unpack("<Q", head)
        found = self._process.stdout.read(size)
        return found if len(found) == size else None


def _end(process: subprocess.Popen) -> None:
    """End the process; it may be in the driver for ever."""
    process.kill()
    for pipe in (process.stdin, process.stdout):
        if pipe is not None:
            with suppress(BrokenPipeError):
                pipe.close()
    process.wait()
