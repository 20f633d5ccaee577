# SPDX-License-Identifier: BSD-3-Clause
"""A function run in a process of its own: the user's own code, which may end the process or never return, and work of
ours whose kernels are to compile quickly.

The caller sends the name of one of our functions with arguments that name scenes and methods; the process imports the
user's code. What it returns comes back as a file. What it prints goes to the error stream, so that the output is the
command's own. The process is the leader of a group: Ctrl-C reaches its caller alone, which ends the whole group.
"""

import os
import pickle
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from analytic.errors import InputError
from reports.machine import quick_compilation
from reports.machine.environment import VARIANT_VARIABLE

_POSIX = os.name == "posix"
LIMIT = 300.0  #: seconds that a user's method may take for one scene, or one command
_FAREWELL = 2.0  # seconds in which a process that is to end may remove what it has half-written


class EndedError(InputError):
    """The process ended without an answer, or not in time."""


def in_own_process(
    function: Callable[..., Any],
    *arguments: Any,
    name: str,
    limit: float | None = LIMIT,
    what: str = "method",
    quick: bool = False,
) -> Any:
    """Call a function in a new process with the current variant, and return what it returns.

    Parameters
    ----------
    function
        At the top of a module of ours; it must not print on the output.
    arguments
        Of the function. They are pickled, as is what it returns.
    name
        Of the user's method, or of the work, for messages.
    limit
        After so long the process is ended [s]; None: never.
    what
        Has this name, for messages.
    quick
        Whether kernels may run slowly if they compile quickly (`reports.machine.quick_compilation`): nothing is timed.

    Raises
    ------
    InputError
        As the function.
    EndedError
        If the process ends without an answer or not in time; the message begins with what it is and its name.
    MissingError
        As the function.
    """
    from reference.storage.files import temporary_folder, write_bytes
    from reference.storage.stopping import cleaned_up

    with temporary_folder() as folder:
        write_bytes(folder / "task", pickle.dumps((list(sys.argv), function, arguments)))
        alive, held = os.pipe()  # its end is closed when this process ends, however it does
        try:
            process = subprocess.Popen(
                [sys.executable, "-P", "-m", "reports.machine.own_process", str(folder), str(alive)],
                stdin=subprocess.DEVNULL,
                stdout=_error_stream(),
                env=_environment() | (quick_compilation.settings() if quick else {}),
                **_kept_open(alive),
            )
            with cleaned_up(lambda: _end(process)):
                try:
                    status = process.wait(limit)
                except subprocess.TimeoutExpired:
                    raise EndedError(
                        f"{what} {name}: did not end within {limit:g} s and was stopped; --method-limit allows more"
                    ) from None
                finally:
                    _end(process)
        finally:
            os.close(alive)
            os.close(held)
        try:
            answer = (folder / "answer").read_bytes()
        except FileNotFoundError:
            raise EndedError(
                f"{what} {name}: ended its process, {_how(status)}; wanted a result or an exception"
            ) from None
    returned, value = pickle.loads(answer)
    if not returned:
        raise value
    return value


def _kept_open(alive: int) -> dict[str, Any]:
    """Return the options of a process that notices the end of this one, and leads a group; Windows has neither."""
    return {"pass_fds": (alive,), "start_new_session": True} if _POSIX else {}


def _error_stream() -> int:
    """Return the error stream of this process, or nothing's where it has none."""
    try:
        os.fstat(2)
    except OSError:
        return subprocess.DEVNULL
    return 2


def _environment() -> dict[str, str]:
    """Return the environment of the process: our modules before those of the user's folder, the variant as it is."""
    root = str(Path(__file__).resolve().parents[2])
    paths = [root, *filter(None, [os.environ.get("PYTHONPATH")])]
    mitsuba = sys.modules.get("mitsuba")
    current = mitsuba.variant() if mitsuba else None
    chosen = {VARIANT_VARIABLE: current} if current else {}
    return os.environ | {"PYTHONPATH": os.pathsep.join(paths)} | chosen


def _end(process: subprocess.Popen) -> None:
    """End a process and all that it started: it may clean up first."""
    if process.poll() is None:
        process.terminate()
        with suppress(subprocess.TimeoutExpired):
            process.wait(_FAREWELL)
    if not _POSIX:
        process.kill()
    else:
        # macOS denies it for a group of which only a zombie is left.
        with suppress(ProcessLookupError, PermissionError):
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
    """Do the task of the folder that the command line names."""
    from reference.storage.stopping import stop_on_signals

    stop_on_signals(quiet=True)
    folder, alive = Path(sys.argv[1]), int(sys.argv[2])
    if _POSIX:
        threading.Thread(target=_follow, args=(alive,), daemon=True).start()
    from reports.machine.environment import MissingError, activate

    activate()
    from realtime.errors import InputError as MethodError
    from reference.storage.files import write_bytes

    # The user's module sees the command line of the command.
    sys.argv, function, arguments = pickle.loads((folder / "task").read_bytes())
    answer: tuple[bool, Any]
    try:
        answer = True, function(*arguments)
    except (InputError, MethodError, MissingError) as error:
        answer = False, type(error)(str(error))  # its cause may not be one that can be sent
    write_bytes(folder / "answer", pickle.dumps(answer))
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(0)  # not waiting for threads that the user's code has started


def _follow(alive: int) -> None:
    """End with the process that started this one."""
    os.read(alive, 1)
    os.killpg(os.getpid(), signal.SIGKILL)


if __name__ == "__main__":
    main()
