# SPDX-License-Identifier: BSD-3-Clause
"""Runs groups of tasks on a cluster: every task ends in one outcome, whatever happens to workers and scheduler.

A group is tasks that need the value of one first task, such as the truth of a scene. Groups are sent as there is room:
the scheduler never knows more than a window of them, however many there are. A group whose tasks share what a process
loads and compiles is offered to one worker as a whole: two workers would each do that.

Dask counts the death of a worker against every task that was assigned to it, begun or not. So workers say which task
they begin, and only what had begun counts: a task whose process died is begun again `retries` times and is then
'aborted'. A task that is not done after its limit is 'hung': it is given up here, and ends its own process there. A
scheduler that goes away is waited for; what it had not answered is sent again.
"""

import pickle
import queue
import time
import uuid
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

from reports.cluster.connect import Cluster, reconnected
from reports.cluster.worker import ALONE, FOREIGN, TOLD, Answer, Order, do

PATIENCE = 120.0  #: how long a scheduler that went away is waited for, and a worker where none is left [s]

_TICK = 0.25  # between looks at what takes too long [s]
_GROUPS = 2  # sent by worker, beside those that are being worked at
_SILENT = 10  # deaths of workers under a task that could not say that it had begun
_ANSWER = 30.0  # within which a scheduler answers [s]
_LOOK = 2.0  # between looks at the workers [s]


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
    together: bool = False  #: whether one worker had better do it all: what is loaded and compiled serves all tasks


@dataclass(frozen=True)
class Outcome:
    """How a task ended."""

    task: Task
    status: str  #: 'done', 'refused', 'failed', 'hung', 'aborted' or, where the cluster was lost, 'lost'
    value: Any = None
    reason: str | None = None
    attempts: int = 1  #: how often it was begun


@dataclass
class _Flight:
    """A task that was sent and has no outcome yet."""

    task: Task
    group: "_Flown"
    future: Any = None
    begun: int = 0
    deaths: int = 0  #: of workers, as Dask counts them
    since: float | None = None  #: when it was begun last [s]
    worker: str = ""  #: where


@dataclass
class _Flown:
    """A group that was sent."""

    group: Group
    number: int
    first: _Flight | None = None
    open: dict[str, _Flight] = field(default_factory=dict)
    worker: str = ""  #: who had better do it


def run_groups(
    cluster: Cluster,
    groups: Iterable[Group],
    *,
    made: Any = None,
    retries: int = 3,
    patience: float = PATIENCE,
    refused: Callable[[str], None] = lambda words: None,
) -> Iterator[Outcome]:
    """Yield the outcome of every task of the groups, the first ones' only where they were not done.

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
        How long a scheduler, or a last worker, that went away is waited for [s].
    refused
        Is told in words of a worker of another version that came meanwhile: it is sent away, and others do its work.
    """
    run = _Run(cluster, made=made, retries=retries, patience=patience, refused=refused)
    try:
        yield from run.outcomes(iter(groups))
    finally:
        run.end()


class _Run:
    """The state of a run; one thread changes it, others put what they hear into a queue."""

    def __init__(
        self, cluster: Cluster, *, made: Any, retries: int, patience: float, refused: Callable[[str], None]
    ) -> None:
        self._cluster, self._made, self._retries, self._patience = cluster, made, retries, patience
        self._refused = refused
        self._client = cluster.client
        self._own_client = False
        self._identity = uuid.uuid4().hex[:12]
        self._heard: queue.SimpleQueue = queue.SimpleQueue()
        self._told: set[str] = set()  # names of tasks whose answer was told
        self._flights: dict[str, _Flight] = {}
        self._flown: dict[int, _Flown] = {}
        self._sent = 0  # futures so far: each has a key of its own
        self._groups = 0
        self._looked = 0.0
        self._workers: dict[str, Any] = {}  # at the last look
        self._sent_away: set[str] = set()  # addresses of workers of another version
        self._without: float | None = None  # since when nobody is there who could work
        self._lost = self._gone = False
        self._listen()
        self._look(time.monotonic())

    def outcomes(self, groups: Iterator[Group]) -> Iterator[Outcome]:
        """Send groups as there is room, and yield what comes of them."""
        more = True
        while (more or self._flights) and not self._gone:
            while more and len(self._flown) < self._room():
                group = next(groups, None)
                more = group is not None
                if group is not None and (group.tasks or group.first):
                    self._fly(group)
            yield from self._hear()
            yield from self._late()
            if self._lost:
                yield from self._again()

    def end(self) -> None:
        """Give up what is not done."""
        futures = [flight.future for flight in self._flights.values() if flight.future is not None]
        self._flights, self._flown = {}, {}
        with suppress(Exception):  # the scheduler may be gone
            self._client.cancel(futures, force=True)
        if self._own_client:
            self._client.close(timeout=2)

    def _listen(self) -> None:
        self._topic = f"airlight-{self._identity}-{self._sent}"
        heard, told = self._heard, self._told

        def hear(event: tuple[float, dict[str, Any]]) -> None:
            if "done" in event[1]:
                told.add(event[1]["done"])
            heard.put(("begun" if "start" in event[1] else "told", event[1]))

        self._client.subscribe_topic(self._topic, hear)

    def _room(self) -> int:
        return _GROUPS + len(self._workers)

    def _fly(self, group: Group) -> None:
        flown = _Flown(group, self._groups)
        self._groups += 1
        if group.together and len(self._workers) > 1:
            busy = Counter(other.worker for other in self._flown.values())
            flown.worker = min(self._workers, key=lambda address: busy[address])
        self._flown[flown.number] = flown
        if group.first is not None:
            flown.first = _Flight(group.first, flown)
        for task in group.tasks:
            flown.open[task.name] = self._flights[task.name] = _Flight(task, flown)
        self._send_all(flown)

    def _send(self, flown: _Flown, with_first: bool, flights: list[_Flight]) -> None:
        """Submit tasks of a group: the first one where it is asked for, and others."""
        if with_first and flown.first is not None:
            self._flights[flown.first.task.name] = flown.first
            self._submit(flown.first, None)
        for flight in flights:
            self._submit(flight, None if flown.first is None else flown.first.future)

    def _submit(self, flight: _Flight, first: Any) -> None:
        self._sent += 1
        task = flight.task
        first_of_all = flight is flight.group.first
        needs = "" if first is None or flight.group.first is None else flight.group.first.task.name
        order = Order(task.name, self._topic, task.limit, needs, first_of_all, self._made)
        flight.since = None
        flight.future = self._client.submit(
            do,
            order,
            task.function,
            task.arguments,
            first,
            key=f"airlight-{self._identity}-{self._sent}",
            pure=False,
            priority=-flight.group.number,
            resources={ALONE: 1} if task.alone else None,
            workers=[flight.group.worker] if flight.group.worker else None,
            allow_other_workers=bool(flight.group.worker),  # it may be dead by then
        )
        heard, told = self._heard, self._told

        def ended(future: Any) -> None:
            """Fetch what was not told, in a thread of Dask's: that can wait for a worker who died with it."""
            answer = None
            if flight.future is not future:
                return
            if future.status == "finished" and not first_of_all and task.name not in told:
                with suppress(Exception):
                    answer = future.result()
            heard.put(("ended", (task.name, future, answer)))

        flight.future.add_done_callback(ended)

    def _hear(self) -> Iterator[Outcome]:
        """Take what was heard until there is nothing more; wait a little for the first."""
        wait = _TICK
        while True:
            try:
                kind, what = self._heard.get(timeout=wait) if wait else self._heard.get_nowait()
            except queue.Empty:
                return
            wait = 0
            if kind == "begun":
                yield from self._begun(what)
            elif kind == "told":
                yield from self._answered(what["done"], pickle.loads(what["answer"]))
            else:
                yield from self._ended(*what)

    def _begun(self, told: dict[str, str]) -> Iterator[Outcome]:
        flight = self._flights.get(told["start"])
        if flight is None:
            return
        now = time.monotonic()
        if flight.since is not None and now - flight.since > flight.task.limit:
            yield from self._hung(flight)
        elif flight.begun > self._retries:
            yield from self._aborted(flight)
        else:
            flight.begun += 1
            flight.since, flight.worker = now, told["worker"]

    def _hung(self, flight: _Flight) -> Iterator[Outcome]:
        words = f"stopped after {flight.task.limit:g} s"
        yield from self._close(flight, Outcome(flight.task, "hung", reason=words, attempts=flight.begun))

    def _aborted(self, flight: _Flight) -> Iterator[Outcome]:
        times = max(flight.begun, flight.deaths)
        words = f"its process ended {times} times while it ran"
        yield from self._close(flight, Outcome(flight.task, "aborted", reason=words, attempts=times))

    def _ended(self, name: str, future: Any, answer: Answer | None) -> Iterator[Outcome]:
        flight = self._flights.get(name)
        if flight is None or flight.future is not future:
            return  # of a task that was told, given up, or sent again
        if future.status == "error":
            yield from self._erred(flight)
        elif future.status in ("cancelled", "lost"):
            self._lost = True
        elif flight is flight.group.first:
            self._flights.pop(name)  # its value stays there, for the others
            self._settle(flight.group)
        elif answer is not None and answer.status != TOLD:
            yield from self._answered(name, answer)
        elif name not in self._told:  # what it returned, or told, went with its worker
            self._send(flight.group, False, [flight])

    def _answered(self, name: str, answer: Answer) -> Iterator[Outcome]:
        flight = self._flights.get(name)
        self._told.discard(name)
        if flight is None:
            return
        if answer.status == FOREIGN:
            self._refuse(flight, answer)
            return
        outcome = Outcome(flight.task, answer.status, answer.value, answer.reason, max(1, flight.begun))
        yield from self._close(flight, outcome)

    def _refuse(self, flight: _Flight, answer: Answer) -> None:
        """Send a worker of another version away, and what it was to do to others."""
        if answer.value not in self._sent_away:
            self._sent_away.add(answer.value)
            self._refused(f"worker {answer.value} has {answer.reason}: install the same airlight there")
            with suppress(Exception):  # it may be gone
                self._client.retire_workers([answer.value], close_workers=True)
        self._send_all(flight.group)

    def _send_all(self, flown: _Flown) -> None:
        """Send all that is open of a group, the first task too."""
        self._send(flown, True, list(flown.open.values()))

    def _move(self, flown: _Flown) -> None:
        """Send what nobody works at of a group again, to whoever is there: the worker who had better do it is gone.

        Where no worker is left at that moment, Dask keeps a task for the one that it was for, although others may do
        it, and would wait for an address that never comes back.
        """
        flown.worker = ""
        waiting = [f for f in flown.open.values() if f.since is None or f.worker not in self._workers]
        if waiting:
            self._send(flown, True, waiting)

    def _erred(self, flight: _Flight) -> Iterator[Outcome]:
        """Send a task again whose workers died, unless it died too often; what else goes wrong is a failure."""
        error = flight.future.exception()
        if type(error).__name__ != "KilledWorker":
            words = " ".join(f"{type(error).__name__}: {error}".split())
            yield from self._close(flight, Outcome(flight.task, "failed", reason=words))
            return
        flown = flight.group
        guilty = flight
        if flown.first is not None and flown.first.future.status == "error":
            guilty = flown.first  # its value was lost, and it died when it was to be made again
        guilty.deaths += 1
        if guilty.begun > self._retries or guilty.deaths > _SILENT:
            yield from self._aborted(guilty)
        elif guilty is flown.first:
            self._send_all(flown)
        else:
            self._send(flown, False, [flight])

    def _late(self) -> Iterator[Outcome]:
        """Give up what takes longer than its limit, and look whether somebody is there to work."""
        now = time.monotonic()
        late = [f for f in self._flights.values() if f.since is not None and now - f.since > f.task.limit]
        if late or now - self._looked > _LOOK:
            self._look(now)
        for flight in late:
            if flight.worker not in self._workers:
                flight.since = None  # its worker died, and it waits to be begun again
            elif flight.task.name in self._flights:
                yield from self._hung(flight)
        if self._without is not None and now - self._without > self._patience and not self._lost:
            words = "no worker is left that could do it"
            yield from self._give_up(words)

    def _look(self, now: float) -> None:
        """Look at the workers, and whether the scheduler is there."""
        self._looked = now
        if self._client.status not in ("running", "connecting"):
            self._lost = True
            return
        try:  # `scheduler_info` may answer with what a look of the client's own, without workers, has just found
            told = self._client.sync(self._client.scheduler.identity, n_workers=-1, callback_timeout=_ANSWER)
        except (OSError, TimeoutError):
            return
        self._workers = dict(told["workers"])
        for flown in self._flown.values():
            if self._workers and flown.worker and flown.worker not in self._workers:
                self._move(flown)
        able = bool(self._workers)
        if able and self._flights and all(flight.task.alone for flight in self._flights.values()):
            able = any(worker.get("resources", {}).get(ALONE) for worker in self._workers.values())
        self._without = None if able else (self._without or now)

    def _give_up(self, words: str) -> Iterator[Outcome]:
        """Yield what is open as lost; no more groups are sent."""
        for flight in list(self._flights.values()):
            if flight is not flight.group.first:
                yield Outcome(flight.task, "lost", reason=words, attempts=flight.begun)
        self._flights, self._flown = {}, {}
        self._gone = True

    def _close(self, flight: _Flight, outcome: Outcome) -> Iterator[Outcome]:
        """Yield the outcome of a task; that of a first one is the others' too."""
        flown = flight.group
        self._flights.pop(flight.task.name, None)
        self._forget(flight)
        if flight is flown.first:
            yield outcome
            for other in list(flown.open.values()):
                self._flights.pop(other.task.name, None)
                self._forget(other)
                reason = f"{flight.task.name}: {outcome.reason}"
                yield Outcome(other.task, outcome.status, reason=reason, attempts=outcome.attempts)
            flown.open = {}
        else:
            flown.open.pop(flight.task.name, None)
            yield outcome
        self._settle(flown)

    def _forget(self, flight: _Flight) -> None:
        """Let go of what a task left; one that goes on is cancelled, so that nobody does it again."""
        future, flight.future = flight.future, None
        if future is None:
            return
        try:
            if not future.done():
                self._client.cancel([future], force=True)
            future.release()
        except Exception:  # Dask raises many kinds where the scheduler is gone, and what is let go of is not needed
            self._lost = self._lost or self._client.status != "running"

    def _settle(self, flown: _Flown) -> None:
        """Forget a group of which nothing is open."""
        if not flown.open and (flown.first is None or flown.first.task.name not in self._flights):
            self._flown.pop(flown.number, None)
            if flown.first is not None:
                self._forget(flown.first)

    def _again(self) -> Iterator[Outcome]:
        """Find the scheduler again and send what is open; without it all of that is lost."""
        client = reconnected(self._cluster.place, self._patience)
        if client is None:
            words = f"the scheduler at {self._cluster.place.words} went away and did not come back"
            yield from self._give_up(words)
            return
        if self._own_client:
            self._client.close(timeout=2)
        self._client, self._own_client, self._lost = client, True, False
        self._listen()
        self._look(time.monotonic())
        for flown in list(self._flown.values()):
            self._send_all(flown)
