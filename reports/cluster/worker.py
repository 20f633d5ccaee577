# SPDX-License-Identifier: BSD-3-Clause
"""What runs in a worker, a plain `dask worker`: one task at a time, within its time, by the same source code.

Whatever happens to a task becomes an `Answer`; only the death of the process is left to Dask. A task that takes too
long ends its process by a timer of the C library's, which needs no help from Python: a loop in C++ that never returns
is ended too. The worker's nanny then starts another process.
"""

import faulthandler
import os
import pickle
import threading
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

FOREIGN = "foreign"  #: status of an answer of a worker of another version; its value is the worker's address
TOLD = "told"  #: status of what is left in the cluster of an answer that was told
ALONE = "alone"  #: the Dask resource of a worker on whose host nothing else runs
_GRACE = 2.0  # after its limit a task has so long until its process ends: who waits has given it up by then [s]
_FREE = 1.2 * 2**30  # resident memory from which free memory is given back [bytes]
_FLUSH = 1.3 * 2**30  # the same of compiled kernels, which are read from the disk again [bytes]
_RETIRE = 1.6 * 2**30  # resident memory at which a worker is started anew, between two tasks [bytes]
_LARGE = 200_000  # an answer that takes more is fetched, others are told [bytes]
_SENT = 0.004  # until what a worker says is on its way, twice the interval of Dask's batches [s]


@dataclass(frozen=True)
class Answer:
    """What came of a task."""

    status: str  #: 'done', 'refused', 'failed', or `FOREIGN`
    value: Any = None  #: what the function returned
    reason: str | None = None  #: why it did not


@dataclass(frozen=True)
class Order:
    """A task as it is sent to a worker."""

    name: str  #: of the task
    topic: str  #: of the events that say when it begins, and what came of it
    limit: float  #: seconds
    needs: str  #: name of the task whose value it needs; empty for none
    keep: bool  #: whether its answer stays in the cluster, for other tasks
    made: Any  #: `validation.study.keys.Made` of whoever asks; None for tasks that every version may do


def do(order: Order, function: Callable[..., Any], arguments: tuple[Any, ...], first: Answer | None = None) -> Answer:
    """Do a task in a worker.

    Parameters
    ----------
    order
        What to know of it.
    function, arguments
        What to call; with `first`, its value is the first argument.
    first
        The answer of the task that this one needs; if that has no value, this one has the same fate.
    """
    if first is not None and first.status != "done":
        whose = "" if first.status == FOREIGN else f"{order.needs}: "
        return Answer(first.status, first.value, f"{whose}{first.reason}")
    from distributed import get_worker

    worker = get_worker()
    # A worker with several threads would run several tasks at once: kernels have the threads, tasks take turns.
    with worker.__dict__.setdefault("airlight_lock", threading.Lock()):
        problem = _ready(worker, order)
        if problem:
            return Answer(FOREIGN, worker.address, problem)
        worker.log_event(order.topic, {"start": order.name, "worker": worker.address})
        time.sleep(_SENT)
        with open(os.devnull, "w") as nowhere:
            faulthandler.dump_traceback_later(order.limit + _GRACE, exit=True, file=nowhere)
            try:
                answer = _answer(function, arguments if first is None else (first.value, *arguments))
            finally:
                faulthandler.cancel_dump_traceback_later()
        _give_back(worker)
    sent = None if order.keep else pickle.dumps(answer)
    if sent is None or len(sent) > _LARGE:
        return answer
    # Before Dask says that the task is done: so no death of this worker, which would keep it, loses the answer.
    worker.log_event(order.topic, {"done": order.name, "answer": sent})
    return Answer(TOLD)


def facts(dask_worker: Any) -> dict[str, Any]:
    """Return what a worker is made of, `validation.study.keys.Made`, and whether it is alone on its host."""
    from reports import __version__
    from reports.machine.environment import activate
    from validation.study.keys import made_here

    return {"made": made_here(__version__, activate()), "alone": is_alone(dask_worker)}


def is_alone(worker: Any) -> bool:
    """Return whether nothing else runs on the host of a worker, as its resources say."""
    return worker.state.total_resources.get(ALONE, 0) > 0


def _ready(worker: Any, order: Order) -> str | None:
    """Make the first kernel possible; return what is wrong with this worker, or None."""
    if order.made is None:
        return None
    if "airlight_made" not in worker.__dict__:
        from reports import __version__
        from reports.machine.environment import activate
        from validation.study.keys import made_here

        worker.airlight_made = made_here(__version__, activate())
        import drjit as dr

        dr.set_thread_count(worker.state.nthreads)
    return ", ".join(order.made.differences(worker.airlight_made)) or None


def _answer(function: Callable[..., Any], arguments: tuple[Any, ...]) -> Answer:
    from analytic.errors import InputError
    from realtime.errors import InputError as MethodError

    try:
        return Answer("done", function(*arguments))
    except (InputError, MethodError) as error:
        return Answer("refused", reason=str(error))
    except Exception as error:  # whatever a task raises is its row's, not the end of the run
        place = traceback.extract_tb(error.__traceback__)[-1]
        words = " ".join(str(error).split())
        return Answer("failed", reason=f"{type(error).__name__}: {words} ({place.name}, line {place.lineno})")


def _give_back(worker: Any) -> None:
    """Give memory back where there is much of it, and start the worker anew where that does not help."""
    if _resident() < _FREE:
        return
    import gc
    import sys

    gc.collect()
    if "drjit" in sys.modules:
        import drjit as dr

        dr.flush_malloc_cache()
        if _resident() > _FLUSH:
            dr.flush_kernel_cache()
    if _resident() > _RETIRE and worker.nanny:
        worker.loop.add_callback(worker.close_gracefully, restart=True)


def _resident() -> float:
    """Return the resident memory of this process [bytes]; 0 where the system does not tell."""
    try:
        with open("/proc/self/statm", encoding="ascii") as file:
            return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    except OSError:
        return 0.0
