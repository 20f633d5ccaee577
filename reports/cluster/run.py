# SPDX-License-Identifier: BSD-3-Clause
"""Groups of tasks as Dask futures: every task ends in one outcome, whatever happens to its process.

A group is tasks that share what a process loads and compiles, and the value of one first task, such
as the reference of a scene: it is one future, done by one worker.

There is one rule for a process that dies under its work: a group is split into its tasks, and a
task that is alone is tried again `retries` times, then it is 'aborted'. A task that takes longer
than its limit ends its own process by a timer of the C library's, which needs no help from Python,
and is 'hung'. A scheduler that disappears leaves the rest 'lost': the same command goes on from
there.
"""

import faulthandler
import os
import threading
import time
import traceback
import uuid
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

from airlight.reports.cluster.connect import Client, facts

ALONE = "alone"  #: the Dask resource of a worker on whose host nothing else runs


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
    #: 'done', 'refused', 'failed', 'hung', 'aborted' or, where the cluster was lost, 'lost'
    status: str
    value: Any = None
    reason: str | None = None
    attempts: int = 1  #: how often it was begun


class _Refused(Exception):
    """A worker cannot do the work or has another version; the message says which."""


def run_groups(
    client: Client, groups: Iterable[Group], *, made: Any = None, retries: int = 3
) -> Iterator[Outcome]:
    """Yield the outcome of every task of the groups; a first task that failed is the
    outcome of all its tasks.

    Workers must be made of `made`, `validation.study.keys.Made`; another version is refused by
    name. None takes any. A task whose process died is begun again `retries` times.
    """
    from distributed import as_completed
    from distributed.scheduler import KilledWorker

    from airlight.errors import InputError

    # Workers report every task that they begin under this topic: of a process that died nothing
    # else says what it was doing.
    topic = f"airlight-{uuid.uuid4().hex[:12]}"
    begun: dict[str, tuple[str, float]] = {}  # by future: which task began last, and when [s]
    flying: dict[Any, tuple[Group, int]] = {}  # groups that were sent, and how often
    ended = as_completed(loop=client.loop)
    client.subscribe_topic(
        topic, lambda event: begun.update({event[1]["key"]: (event[1]["task"], time.monotonic())})
    )

    def send(group: Group, attempts: int = 1) -> None:
        # A new key each time: Dask would answer a key that it knows with the old result.
        key = f"{topic}-{uuid.uuid4().hex}"
        resources = {ALONE: 1} if group.tasks[0].alone else None
        future = client.submit(
            do_group, group, made, topic, key, key=key, pure=False, resources=resources
        )
        flying[future] = group, attempts
        ended.add(future)

    try:
        for group in groups:
            send(group)
        for future in ended:
            # A group ends in one of four ways: it returns its outcomes, its worker is unfit, its
            # process died, or the scheduler failed.
            group, attempts = flying.pop(future)
            try:
                yield from (replace(outcome, attempts=attempts) for outcome in future.result())
            # the latter is what a worker without airlight raises
            except (_Refused, ImportError) as error:
                raise InputError(f"{error}: install the same airlight there, or stop it") from None
            except KilledWorker:
                # The task that began last is the guilty one. If it ran longer than its limit, its
                # own timer ended the process.
                name, since = begun.pop(future.key, ("", time.monotonic()))
                in_first = group.first is not None and group.first.name == name
                guilty = group.first if in_first and group.first else group.tasks[0]
                hung = time.monotonic() - since > guilty.limit
                # One of several tasks killed the process: each is sent alone, so that the others
                # get their results. The first task of a group is common to all, and splitting would
                # not save them.
                if len(group.tasks) > 1 and not in_first:
                    for task in group.tasks:
                        send(replace(group, tasks=(task,)))
                elif not hung and attempts <= retries:
                    send(group, attempts + 1)
                else:
                    words = (
                        f"stopped after {guilty.limit:g} s"
                        if hung
                        else f"its process ended {attempts} times while it ran"
                    )
                    reason = f"{guilty.name}: {words}" if in_first else words
                    yield from _all(group, "hung" if hung else "aborted", reason, attempts)
            # what a task or the scheduler raises ends a row, not the run
            except Exception as error:
                # Without a scheduler every group that is still flying is lost; the loop ends once
                # each has said so.
                if client.status != "running":
                    yield from _all(group, "lost", "the scheduler went away", attempts)
                    continue
                # A cancelled future says nothing about its tasks: the group is sent again.
                if future.cancelled():
                    send(group, attempts)
                else:
                    yield from _all(
                        group,
                        "failed",
                        " ".join(f"{type(error).__name__}: {error}".split()),
                        attempts,
                    )
    finally:
        with suppress(Exception):  # the scheduler may be gone
            client.cancel(list(flying), force=True)


def _all(group: Group, status: str, reason: str, attempts: int = 1) -> list[Outcome]:
    """Return one outcome for all tasks of a group."""
    return [Outcome(task, status, reason=reason, attempts=attempts) for task in group.tasks]


# In a worker


def do_group(group: Group, made: Any, topic: str, key: str) -> list[Outcome]:
    """Do the tasks of a group one after the other, each within its time."""
    from distributed import get_worker
    from distributed.utils import sync

    worker = get_worker()
    # A worker with several threads would run several groups at once: kernels have the
    # threads, groups take turns.
    with worker.__dict__.setdefault("airlight_lock", threading.Lock()):
        if made is not None:
            _check(worker, made)

        # The timer is faulthandler's: a thread in C ends the process although Python may hang in a
        # kernel. The scheduler must have the report of the beginning before the work begins, or a
        # death would not name its task: `worker.log_event` returns before anything is sent.
        def done(task: Task, *values: Any) -> Outcome:
            begin = {"key": key, "task": task.name}
            sync(worker.loop, worker.scheduler.log_event, topic=topic, msg=begin)
            with open(os.devnull, "w") as nowhere:
                faulthandler.dump_traceback_later(task.limit, exit=True, file=nowhere)
                try:
                    return _outcome(task, *values)
                finally:
                    faulthandler.cancel_dump_traceback_later()

        # Without the value of the first task the others cannot begin: they share its outcome.
        first = None if group.first is None else done(group.first)
        if first is not None and first.status != "done":
            return _all(group, first.status, f"{first.task.name}: {first.reason}")
        ended = [done(task, *(() if first is None else (first.value,))) for task in group.tasks]
        _give_back(worker)
        return ended


def is_alone(worker: Any) -> bool:
    """Return whether nothing else runs on the host of a worker, as its resources say."""
    return worker.state.total_resources.get(ALONE, 0) > 0


def _check(worker: Any, made: Any) -> None:
    """Make the first kernel possible; refuse a worker that is made of anything else."""
    # The versions of a process do not change, and finding them takes time.
    if "airlight_made" not in worker.__dict__:
        try:
            worker.airlight_made = facts()
        except Exception as error:  # it lacks a library or cannot compile kernels
            raise _Refused(
                f"worker {worker.address} cannot do the work ({type(error).__name__}: {error})"
            ) from None
        import drjit as dr

        from airlight.reports.machine.environment import LEAST_THREADS

        dr.set_thread_count(max(LEAST_THREADS, worker.state.nthreads))
    if mismatches := made.differences(worker.airlight_made):
        raise _Refused(f"worker {worker.address} has {', '.join(mismatches)}")


def _outcome(task: Task, *values: Any) -> Outcome:
    from airlight.errors import InputError

    try:
        return Outcome(task, "done", task.function(*values, *task.arguments))
    except InputError as error:
        return Outcome(task, "refused", reason=str(error))
    except Exception as error:  # what a task raises is its row's, not the end of the run
        # A row has room for a line and none for a traceback: the place of the exception stands
        # behind its words.
        place = traceback.extract_tb(error.__traceback__)[-1]
        words = " ".join(str(error).split())
        return Outcome(
            task,
            "failed",
            reason=f"{type(error).__name__}: {words} ({place.name}, line {place.lineno})",
        )


def _give_back(worker: Any) -> None:
    """Give memory back where there is much of it, and start the worker again
    where that does not help.
    """
    if worker.monitor.get_process_memory() < 1.2 * 2**30:  # bytes
        return
    import gc
    import sys

    # Frames and recorded kernels hang in reference cycles; Dr.Jit then keeps freed memory and
    # compiled kernels for later use.
    gc.collect()
    if "drjit" in sys.modules:
        import drjit as dr

        dr.flush_malloc_cache()
        dr.flush_kernel_cache()
    # Memory that remains lies with libraries that never return it: a new process is cheaper than
    # one that the limit ends. Without a nanny nobody would start it again.
    if worker.monitor.get_process_memory() > 1.6 * 2**30 and worker.nanny:
        worker.loop.add_callback(worker.close_gracefully, restart=True)
