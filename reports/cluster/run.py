# SPDX-License-Identifier: BSD-3-Clause
"""Groups of tasks as Dask futures: every task ends in one outcome, whatever happens to its process.

A group is tasks that share what a process loads and compiles, and the value of one first task, such as the reference of
a scene: it is one future, done by one worker. Groups are sent as there is room, so that the scheduler never holds more
than a few for each worker.

There is one rule for a process that dies under its work: a group is split into its tasks, and a task that is alone is
begun again `retries` times, then it is 'aborted'. A task that takes longer than its limit ends its own process by a
timer of the C library's, which needs no help from Python, and is 'hung'. A scheduler that goes away, and a last worker
that does not come back, leave the rest 'lost': the same command goes on from there.
"""

import faulthandler
import os
import queue
import threading
import time
import traceback
import uuid
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

from reports.cluster.connect import Cluster, facts

PATIENCE = 120.0  #: how long a worker is waited for where none is left [s]
ALONE = "alone"  #: the Dask resource of a worker on whose host nothing else runs

_ROOM = 2  # groups that wait at the scheduler beside one for each worker
_LOOK = 2.0  # between looks at the workers [s]
_SENT = 0.004  # until what a worker says is on its way, twice the interval of Dask's batches [s]
_FREE = 1.2 * 2**30  # resident memory from which free memory is given back [bytes]
_RETIRE = 1.6 * 2**30  # resident memory at which a worker is started again, between two groups [bytes]


@dataclass(frozen=True)
class Task:
    """A call of a function in a worker."""

    name: str  #: unique in the run
    function: Callable[..., Any]
    arguments: tuple[Any, ...] = ()
    limit: float = 3600.0  #: seconds
    alone: bool = False  #: whether nothing else may run on its host


@dataclass(frozen=True)
class Group:
    """Tasks, and the one whose value is the first argument of each of them, if any."""

    tasks: tuple[Task, ...]
    first: Task | None = None


@dataclass(frozen=True)
class Outcome:
    """How a task ended."""

    task: Task
    status: str  #: 'done', 'refused', 'failed', 'hung', 'aborted' or, where the cluster was lost, 'lost'
    value: Any = None
    reason: str | None = None
    attempts: int = 1  #: how often it was begun


@dataclass(frozen=True)
class Foreign:
    """The answer of a worker of another version."""

    address: str
    words: str  #: how it differs


@dataclass(frozen=True)
class _Flight:
    """A group that is to be sent, or was."""

    group: Group
    attempts: int = 1


def run_groups(
    cluster: Cluster,
    groups: Iterable[Group],
    *,
    made: Any = None,
    retries: int = 3,
    patience: float = PATIENCE,
    refused: Callable[[str], None] = lambda words: None,
) -> Iterator[Outcome]:
    """Yield the outcome of every task of the groups; that of a first task is that of all its tasks if it failed.

    Parameters
    ----------
    cluster
        From `reports.cluster.connect.connected`.
    groups
        Read as there is room for them.
    made
        What workers must be made of, `validation.study.keys.Made`; None where any version will do.
    retries
        How often a task is begun again whose process died.
    patience
        How long a last worker that went away is waited for [s].
    refused
        Is told in words of a worker of another version that came meanwhile: it is sent away, and others do its work.
    """
    run = _Run(cluster.client, made, retries, patience, refused)
    try:
        yield from run.outcomes(iter(groups))
    finally:
        with suppress(Exception):  # the scheduler may be gone
            run.client.cancel(list(run.flying), force=True)


class _Run:
    """The state of a run."""

    def __init__(self, client: Any, made: Any, retries: int, patience: float, refused: Callable[[str], None]) -> None:
        self.client, self.flying = client, dict[Any, _Flight]()
        self._made, self._retries, self._patience, self._refused = made, retries, patience, refused
        self._waiting: deque[_Flight] = deque()
        self._done: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._topic = f"airlight-{uuid.uuid4().hex[:12]}"
        self._begun: dict[str, tuple[str, float]] = {}  # by future: which task began last, and when [s]
        self._sent_away: set[str] = set()
        self._without: float | None = None  # since when no worker is there [s]
        client.subscribe_topic(self._topic, self._hear)

    def _hear(self, event: tuple[float, dict[str, str]]) -> None:
        self._begun[event[1]["key"]] = event[1]["task"], time.monotonic()

    def outcomes(self, groups: Iterator[Group]) -> Iterator[Outcome]:
        """Send groups as there is room, and yield what comes of them."""
        more = True
        while True:
            while (self._waiting or more) and len(self.flying) < _ROOM + self._workers():
                if not self._waiting:
                    group = next(groups, None)
                    more = group is not None
                    if group is None or not group.tasks:
                        continue
                    self._waiting.append(_Flight(group))
                self._send(self._waiting.popleft())
            if not self.flying:
                return
            ended = self._ended()
            if ended is None:
                yield from self._lost()
                return
            for future in ended:
                yield from self._answered(future, self.flying.pop(future))

    def _send(self, flight: _Flight) -> None:
        key = f"{self._topic}-{uuid.uuid4().hex}"
        alone = flight.group.tasks[0].alone
        future = self.client.submit(
            do_group,
            flight.group,
            self._made,
            self._topic,
            key,
            key=key,
            pure=False,
            resources={ALONE: 1} if alone else None,
        )
        self.flying[future] = flight
        future.add_done_callback(self._done.put)

    def _workers(self) -> int:
        return len(self.client.scheduler_info(n_workers=-1)["workers"])

    def _ended(self) -> list[Any] | None:
        """Return futures that ended, None where nobody is left who could work."""
        while True:
            with suppress(queue.Empty):
                ended = [self._done.get(timeout=_LOOK)]
                while not self._done.empty():
                    ended.append(self._done.get())
                return [future for future in ended if future in self.flying]
            if self.client.status not in ("running", "connecting"):
                return None
            now = time.monotonic()
            self._without = None if self._workers() else self._without or now
            if self._without is not None and now - self._without > self._patience:
                return None

    def _lost(self) -> Iterator[Outcome]:
        there = self.client.status == "running"
        words = "no worker is left that could do it" if there else "the scheduler went away"
        for flight in (*self.flying.values(), *self._waiting):
            yield from (Outcome(task, "lost", reason=words, attempts=flight.attempts) for task in flight.group.tasks)

    def _answered(self, future: Any, flight: _Flight) -> Iterator[Outcome]:
        """Yield what came of a group, or have it done again."""
        key = future.key
        if future.status == "finished":
            with suppress(Exception):  # what it returned may have gone with its worker
                answer = future.result()
                if isinstance(answer, Foreign):
                    self._refuse(answer)
                    self._waiting.append(flight)
                else:
                    yield from (replace(outcome, attempts=flight.attempts) for outcome in answer)
                return
            self._waiting.append(flight)
            return
        error = future.exception() if future.status == "error" else None
        if error is None:  # cancelled
            self._waiting.append(flight)
        elif type(error).__name__ == "KilledWorker":
            yield from self._died(flight, *self._begun.pop(key, ("", time.monotonic())))
        else:
            words = " ".join(f"{type(error).__name__}: {error}".split())
            yield from (Outcome(task, "failed", reason=words) for task in flight.group.tasks)

    def _refuse(self, answer: Foreign) -> None:
        """Send a worker of another version away."""
        if answer.address not in self._sent_away:
            self._sent_away.add(answer.address)
            self._refused(f"worker {answer.address} has {answer.words}: install the same airlight there")
            with suppress(Exception):  # it may be gone
                self.client.retire_workers([answer.address], close_workers=True)

    def _died(self, flight: _Flight, name: str, since: float) -> Iterator[Outcome]:
        """Split a group whose process died, begin a task again that is alone, or say what became of it."""
        group = flight.group
        in_first = group.first is not None and group.first.name == name
        if len(group.tasks) > 1 and not in_first:
            self._waiting.extend(_Flight(replace(group, tasks=(task,))) for task in group.tasks)
            return
        guilty = group.first if in_first and group.first is not None else group.tasks[0]
        if time.monotonic() - since > guilty.limit:
            status, words = "hung", f"stopped after {guilty.limit:g} s"
        elif flight.attempts > self._retries:
            status, words = "aborted", f"its process ended {flight.attempts} times while it ran"
        else:
            self._waiting.append(replace(flight, attempts=flight.attempts + 1))
            return
        words = f"{guilty.name}: {words}" if in_first else words
        yield from (Outcome(task, status, reason=words, attempts=flight.attempts) for task in group.tasks)


# In a worker


def do_group(group: Group, made: Any, topic: str, key: str) -> "list[Outcome] | Foreign":
    """Do the tasks of a group one after the other, each within its time."""
    from distributed import get_worker

    worker = get_worker()
    # A worker with several threads would run several groups at once: kernels have the threads, groups take turns.
    with worker.__dict__.setdefault("airlight_lock", threading.Lock()):
        problem = _ready(worker, made)
        if problem:
            return Foreign(worker.address, problem)

        def done(task: Task, *values: Any) -> Outcome:
            worker.log_event(topic, {"key": key, "task": task.name})
            time.sleep(_SENT)
            with open(os.devnull, "w") as nowhere:
                faulthandler.dump_traceback_later(task.limit, exit=True, file=nowhere)
                try:
                    return _outcome(task, *values)
                finally:
                    faulthandler.cancel_dump_traceback_later()

        first = None if group.first is None else done(group.first)
        if first is not None and first.status != "done":
            reason = f"{first.task.name}: {first.reason}"
            return [Outcome(task, first.status, reason=reason) for task in group.tasks]
        values = () if first is None else (first.value,)
        ended = [done(task, *values) for task in group.tasks]
        _give_back(worker)
        return ended


def is_alone(worker: Any) -> bool:
    """Return whether nothing else runs on the host of a worker, as its resources say."""
    return worker.state.total_resources.get(ALONE, 0) > 0


def _ready(worker: Any, made: Any) -> str | None:
    """Make the first kernel possible; return how this worker differs from what it must be made of, or None."""
    if made is None:
        return None
    if "airlight_made" not in worker.__dict__:
        worker.airlight_made = facts()
        import drjit as dr

        dr.set_thread_count(worker.state.nthreads)
    return ", ".join(made.differences(worker.airlight_made)) or None


def _outcome(task: Task, *values: Any) -> Outcome:
    from analytic.errors import InputError
    from realtime.errors import InputError as MethodError

    try:
        return Outcome(task, "done", task.function(*values, *task.arguments))
    except (InputError, MethodError) as error:
        return Outcome(task, "refused", reason=str(error))
    except Exception as error:  # what a task raises is its row's, not the end of the run
        place = traceback.extract_tb(error.__traceback__)[-1]
        words = " ".join(str(error).split())
        reason = f"{type(error).__name__}: {words} ({place.name}, line {place.lineno})"
        return Outcome(task, "failed", reason=reason)


def _give_back(worker: Any) -> None:
    """Give memory back where there is much of it, and start the worker again where that does not help."""
    if _resident() < _FREE:
        return
    import gc
    import sys

    gc.collect()
    if "drjit" in sys.modules:
        import drjit as dr

        dr.flush_malloc_cache()
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
