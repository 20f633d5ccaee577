# SPDX-License-Identifier: BSD-3-Clause
"""A function run in a separate process: the user's code, which may end the process or never return,
and work of ours whose kernels are to compile quickly.

The caller sends the name of one of our functions with arguments that name scenes and methods; the
process imports the user's code and sends back the result of the function, or one after the other
the values that it yields. Its prints go to the error stream, so that they do not mix with the
command's output. `realtime/child_process.py` ends it.
"""

import sys
from collections.abc import Callable, Generator, Iterator
from typing import Any

from airlight.analytic.clock import Spent
from airlight.errors import InputError
from airlight.realtime.child_process import ChildProcess, connection_to_caller, end_group
from airlight.reports.machine import quick_compilation
from airlight.reports.machine.environment import child_environment


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

    Values that a function yields are yielded here: the process goes on to the next value when that
    is asked for. It ends with the last one, or when the iterator that is returned here is closed.
    The variant is by default the current one.

    The function is at the top of a module of ours and prints nothing on the output; arguments and
    result are pickled. `what` and `name` name the work in messages. If it takes longer than `limit`
    [s] to the result, or to a value that it yields, the process is ended: math.inf is never, None
    what the environment says of user methods. `quick` compiles kernels quickly: nothing is timed.
    EndedError says that the process ended without an answer, or not in time.
    """
    environment = child_environment(variant) | (quick_compilation.settings() if quick else {})
    answers = _answers(
        ChildProcess(__name__, name=f"{what} {name}", limit=limit, environment=environment),
        (function, arguments),
    )
    # The first answer says whether more will come: a value or an iterator of values.
    if next(answers):
        return answers
    value = next(answers)
    answers.close()
    return value


def _answers(
    process: ChildProcess, task: tuple[Callable[..., Any], tuple[Any, ...]]
) -> Generator[Any, None, None]:
    """Yield whether a function in a new process yields values; then these values, or
    the one that it returns.
    """
    message: Any = (sys.argv, *task)
    yields = False
    try:
        # Ask, and pass on: the process computes the next value only when it is asked for it.
        while True:
            kind, value, spent = process.ask(message)
            if kind == "raised":
                raise value
            _add_spent(spent)
            if kind == "ended":
                return
            if kind == "yields":
                yields = True
                yield True
            else:
                if not yields:
                    yield False
                yield value
            message = None  # go on
    finally:
        process.end()


def _add_spent(spent: Any) -> None:
    from airlight.reference.storage.store import add_spent  # loads NumPy

    add_spent(spent)


def main() -> None:
    """Do the task that the caller sends, and answer with its result."""
    # The task is received after Mitsuba is ready, as unpickling it imports modules.
    caller = connection_to_caller()
    from airlight.realtime.errors import NoDriverError
    from airlight.reference.storage.store import counted
    from airlight.reports.machine.environment import MissingError, activate

    activate()
    # The user's module sees the command line of the command.
    sys.argv, function, arguments = caller.recv()

    with counted() as ledger:

        def answer(kind: str, value: Any) -> None:
            sys.stdout.flush()
            caller.send((kind, value, ledger.loaded))
            ledger.loaded = Spent()

        try:
            # A generator has not run yet: each value waits for a message from the caller.
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
    end_group()  # not waiting for what the user's code has started


if __name__ == "__main__":
    main()
