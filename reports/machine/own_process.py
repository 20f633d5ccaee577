# SPDX-License-Identifier: BSD-3-Clause
"""A function run in a separate process: the user's code, which may end the process or never return, and work of ours
whose kernels are to compile quickly.

The caller sends the name of one of our functions with arguments that name scenes and methods; the process imports the
user's code and sends back the result of the function. Its prints go to the error stream, so that they do not mix with
the command's output. The process leads a group, so that all that the user's code started ends with it; it ends with its
caller, however the caller ends.
"""

import math
import os
import pickle
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from analytic.errors import InputError
from realtime.methods.shader.client import LIMIT_VARIABLE, method_limit
from reports.machine import quick_compilation
from reports.machine.environment import child_environment


class EndedError(InputError):
    """The process ended without an answer, or not in time."""


def in_own_process(
    function: Callable[..., Any],
    *arguments: Any,
    name: str,
    limit: float | None = None,
    what: str = "method",
    quick: bool = False,
    variant: str | None = None,
) -> Any:
    """Call a function in a new process; return what it returns, raise what it raises.

    The variant is the current one by default.

    The function is at the top of a module of ours and prints nothing on the output; arguments and result are pickled.
    `what` and `name` name the work in messages. After `limit` [s] the process is ended: math.inf is never, None what
    the environment says of user methods. `quick` compiles kernels quickly: nothing is timed. EndedError says that the
    process ended without an answer, or not in time.
    """
    seconds = method_limit() if limit is None else limit
    # -P: modules of ours come before those of the user's folder.
    with subprocess.Popen(
        [sys.executable, "-P", "-m", "reports.machine.own_process", str(os.getpid())],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        env=child_environment(variant) | (quick_compilation.settings() if quick else {}),
        start_new_session=True,
    ) as process:
        try:
            answer, _ = process.communicate(
                pickle.dumps((sys.argv, function, arguments)), None if seconds == math.inf else seconds
            )
        except subprocess.TimeoutExpired:
            hint = "" if limit else f"; {LIMIT_VARIABLE}={2 * seconds:g} allows more"
            raise EndedError(f"{what} {name}: did not end within {seconds:g} s and was stopped{hint}") from None
        finally:
            _end(process)
    if not answer:
        how = _how(process.returncode)
        raise EndedError(f"{what} {name}: ended its process, {how}; expected a result or an exception")
    returned, value, loaded = pickle.loads(answer)
    if not returned:
        raise value
    if loaded is not None:
        from reference.storage.kept import add_spent

        add_spent(loaded)
    return value


def _end(process: subprocess.Popen) -> None:
    """End a process and all that it started."""
    process.kill()
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


def main() -> None:
    """Do the task that the input holds, and write the answer to the output."""
    threading.Thread(target=_follow, args=(int(sys.argv[1]),), daemon=True).start()
    output = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what is printed
    task = sys.stdin.buffer.read()
    from reports.machine.environment import MissingError, activate

    activate()
    from realtime.errors import InputError as MethodError
    from realtime.errors import NoDriverError
    from reference.storage.kept import loaded_spent

    # The user's module sees the command line of the command.
    sys.argv, function, arguments = pickle.loads(task)
    answer: tuple[bool, Any, Any]
    try:
        answer = True, function(*arguments), loaded_spent()
    except (InputError, MethodError, MissingError, NoDriverError) as error:
        answer = False, type(error)(str(error)), None  # its cause may not be one that can be sent
    sys.stdout.flush()
    output.write(pickle.dumps(answer))
    output.close()
    _end_group()  # not waiting for what the user's code has started


def _end_group() -> None:
    os.killpg(0, signal.SIGKILL)


def _follow(parent: int) -> None:
    """End with the process that started this one."""
    while os.getppid() == parent:
        time.sleep(0.5)
    _end_group()


if __name__ == "__main__":
    main()
