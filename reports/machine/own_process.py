# SPDX-License-Identifier: BSD-3-Clause
"""A function run in a separate process: the user's code, which may end the process or never return, and work of ours
whose kernels are to compile quickly.

The caller sends the name of one of our functions with arguments that name scenes and methods; the process imports the
user's code and sends back the result of the function, or one after the other the values that it yields. Its prints go
to the error stream, so that they do not mix with the command's output. The process leads a group, so that all that the
user's code started ends with it; it ends with its caller, however the caller ends.
"""

import math
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Generator, Iterator
from contextlib import suppress
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from typing import Any

from airlight.analytic.clock import Spent
from airlight.errors import InputError
from airlight.realtime.methods.shader.client import LIMIT_VARIABLE, method_limit
from airlight.reports.machine import quick_compilation
from airlight.reports.machine.environment import child_environment


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

    Values that a function yields are yielded here: the process goes on to the next value when that is asked for.
    It ends with the last one, or when the iterator that is returned here is closed. The variant is by default the
    current one.

    The function is at the top of a module of ours and prints nothing on the output; arguments and result are pickled.
    `what` and `name` name the work in messages. If it takes longer than `limit` [s] to the result, or to a value that
    it yields, the process is ended: math.inf is never, None what the environment says of user methods. `quick` compiles
    kernels quickly: nothing is timed. EndedError says that the process ended without an answer, or not in time.
    """
    environment = child_environment(variant) | (quick_compilation.settings() if quick else {})
    answers = _answers(function, arguments, f"{what} {name}", limit, environment)
    if next(answers):
        return answers
    value = next(answers)
    answers.close()
    return value


def _answers(
    function: Callable[..., Any], arguments: tuple[Any, ...], who: str, limit: float | None, environment: dict[str, str]
) -> Generator[Any, None, None]:
    """Yield whether a function in a new process yields values; then these values, or the one that it returns."""
    seconds, yields = method_limit() if limit is None else limit, False
    here, there = Pipe()
    # -P: modules of ours come before those of the user's folder.
    with subprocess.Popen(
        [sys.executable, "-P", "-m", "airlight.reports.machine.own_process", str(os.getpid()), str(there.fileno())],
        stdin=subprocess.DEVNULL,
        stdout=2,  # what the user's code prints
        env=environment,
        pass_fds=[there.fileno()],
        start_new_session=True,
    ) as process:
        there.close()
        try:
            here.send((sys.argv, function, arguments))
            while True:
                if not here.poll(None if seconds == math.inf else seconds):
                    hint = "" if limit else f"; {LIMIT_VARIABLE}={2 * seconds:g} allows more"
                    raise EndedError(f"{who}: did not end within {seconds:g} s and was stopped{hint}")
                kind, value, loaded = here.recv()
                if kind == "raised":
                    raise value
                _add_spent(loaded)
                if kind == "ended":
                    return
                if kind == "yields":
                    yields = True
                    yield True
                else:
                    if not yields:
                        yield False
                    yield value
                here.send(None)  # go on
        except (EOFError, ConnectionError):
            how = _how(process.wait())
            raise EndedError(f"{who}: ended its process, {how}; expected a result or an exception") from None
        finally:
            here.close()
            _end(process)


def _add_spent(spent: Any) -> None:
    from airlight.reference.storage.store import add_spent  # loads NumPy

    add_spent(spent)


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
    caller = Connection(int(sys.argv[2]))
    from airlight.reports.machine.environment import MissingError, activate

    activate()
    from airlight.realtime.errors import NoDriverError
    from airlight.reference.storage.store import counted

    # The user's module sees the command line of the command.
    sys.argv, function, arguments = caller.recv()

    with counted() as ledger:

        def answer(kind: str, value: Any) -> None:
            sys.stdout.flush()
            caller.send((kind, value, ledger.loaded))
            ledger.loaded = Spent()

        try:
            result = function(*arguments)
            if isinstance(result, Iterator):
                answer("yields", None)
                for value in result:
                    caller.recv()
                    answer("value", value)
                caller.recv()
                answer("ended", None)
            else:
                answer("value", result)
        except (InputError, MissingError, NoDriverError) as error:
            answer("raised", type(error)(str(error)))  # its cause may not be one that can be sent
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
