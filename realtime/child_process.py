# SPDX-License-Identifier: BSD-3-Clause
"""A process for work that may hang, or end its process: the code and the shaders of users.

The caller sends messages and waits for one answer to each; a process that does not answer in time
is ended. It leads a group, so that all that it started ends with it, and it ends with its caller,
however the caller ends.
"""

import math
import os
import signal
import subprocess
import sys
import threading
import time
import weakref
from collections.abc import Mapping
from contextlib import suppress
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from typing import Any

from airlight.errors import InputError

LIMIT_VARIABLE = "AIRLIGHT_METHOD_LIMIT"


class EndedError(InputError):
    """A process ended without an answer, or not in time."""


def method_limit() -> float:
    """Return how long a user's method may take for one scene, or one command [s]."""
    longest = 2e6  # s: the system waits for an answer 2^31 ms at most, which are 24 days
    given = os.environ.get(LIMIT_VARIABLE) or "300.0"  # s, if the user names no limit
    with suppress(ValueError):
        if 0 < float(given) <= longest:
            return float(given)
    raise InputError(
        f"{LIMIT_VARIABLE}: got {given!r}, expected a time above 0 up to {longest:g}, such as 300 "
        "[s]"
    )


class ChildProcess:
    """A process that answers messages; it ends with this object, or before, by `end`."""

    def __init__(
        self,
        module: str,
        *,
        name: str,
        limit: float | None = None,
        environment: Mapping[str, str] | None = None,
        silent: bool = False,
    ) -> None:
        """Start a process.

        Parameters
        ----------
        module
            The module of ours that runs in it and answers messages from `connection_to_caller`.
        name
            The name of its work, for messages of errors.
        limit
            The longest time to an answer [s]; math.inf: none; None: `method_limit`.
        environment
            Its environment variables; None: those of this process.
        silent
            Whether its prints are dropped; otherwise they go to the error stream.

        Raises
        ------
        InputError
            As `method_limit`.
        """
        self._name, self._limit = name, method_limit() if limit is None else limit
        self._hint = f"; {LIMIT_VARIABLE}={2 * self._limit:g} allows more" if limit is None else ""
        # The end of the pipe that the child inherits is closed here once the child has it: after
        # that the end of the child is the end of the connection, and `recv` raises EOFError.
        self._connection, child_end = Pipe()
        with child_end:
            self._process = subprocess.Popen(
                # -P: modules of ours come before those of the user's folder.
                [sys.executable, "-P", "-m", module, str(os.getpid()), str(child_end.fileno())],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL if silent else 2,
                stderr=subprocess.DEVNULL if silent else None,
                env=environment,
                pass_fds=[child_end.fileno()],
                # The child leads a group of its own, which `_end` kills as a whole.
                start_new_session=True,
            )
        self.end = weakref.finalize(self, _end, self._process, self._connection)

    def ask(self, message: Any) -> Any:
        """Send a message, which is pickled, and return the answer.

        Raises
        ------
        EndedError
            If the process ended, or does not answer in time: then it is ended.
        """
        try:
            self._connection.send(message)
            # poll takes no infinite time: None waits without end.
            if self._connection.poll(None if self._limit == math.inf else self._limit):
                return self._connection.recv()
        except (EOFError, OSError):
            how = _how(self._process.wait())
            raise EndedError(
                f"{self._name}: ended its process, {how}; expected an answer or an exception"
            ) from None
        # No answer in time: the work may hang, and a later answer would be taken for the next one.
        self.end()
        raise EndedError(
            f"{self._name}: no answer within {self._limit:g} s; its process was ended{self._hint}"
        )


def _end(process: subprocess.Popen, connection: Connection) -> None:
    """End a process and all that it started."""
    connection.close()
    process.kill()
    # A process that `ask` has waited for is gone, and its group with it unless children are left.
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def _how(status: int) -> str:
    """Say how a process ended."""
    if status >= 0:
        return f"exit status {status}"
    try:
        return f"killed by {signal.Signals(-status).name}"
    except ValueError:
        return f"killed by signal {-status}"


def connection_to_caller() -> Connection:
    """Return the connection to the caller, in a process that `ChildProcess` started:
    it ends with the caller.
    """
    threading.Thread(target=_follow, args=(int(sys.argv[1]),), daemon=True).start()
    return Connection(int(sys.argv[2]))


def _follow(caller: int) -> None:
    # An orphan gets another parent: then the caller has ended, however it did.
    while os.getppid() == caller:
        time.sleep(0.5)
    end_group()


def end_group() -> None:
    """End this process and all that it started, at once."""
    os.killpg(0, signal.SIGKILL)
