# SPDX-License-Identifier: BSD-3-Clause
"""Where a command's work runs: processes of this machine, or a Dask scheduler with workers of any machines."""

import logging
import re
import signal
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from reports.machine import quick_compilation
from reports.machine.environment import MissingError, threads

MEMORY = "2GiB"  #: of a local worker, above which Dask ends it
_KEPT = 2**28  # of freed memory that a local worker keeps, and the largest array that may come of it [bytes]
_PATIENCE = 10.0  # until a scheduler has answered [s]
_WORKERS = 30.0  # until a worker has come [s]
_ADDRESS = re.compile(r"(tcp|tls|ucx|ws|wss)://[^\s/]+")


@dataclass(frozen=True)
class Place:
    """What `--cluster` names."""

    workers: int = 0  #: of this machine; 0 for a scheduler
    address: str | None = None  #: of a scheduler
    file: Path | None = None  #: of a scheduler, which has its address

    @property
    def words(self) -> str:
        """What the user typed, in other words."""
        return self.address or (str(self.file) if self.file else f"local:{self.workers}")


@dataclass(frozen=True)
class Cluster:
    """A connection."""

    client: Any  #: `distributed.Client`
    place: Place


def parse_place(word: str | None) -> Place:
    """Return the place that a word names; a worker for each processor of this machine for None.

    Raises
    ------
    InputError
        For another word, a number of workers out of range, and a file that is not there.
    """
    from analytic.errors import InputError

    word = "local" if word is None else word.strip()
    kind, _, number = word.partition(":")
    if kind == "local":
        if not number and word == "local":
            return Place(threads())
        if not (number.isascii() and number.isdigit() and 1 <= int(number) <= 4096):
            raise InputError(f"--cluster: got {word!r}, wanted local:N with a number of processes from 1 to 4096")
        return Place(int(number))
    if _ADDRESS.fullmatch(word):
        return Place(address=word)
    path = Path(word)
    if path.is_file():
        return Place(file=path)
    if word.endswith(".json"):
        raise InputError(f"--cluster: there is no file {word}; wanted what `dask scheduler --scheduler-file` writes")
    raise InputError(f"--cluster: got {word!r}, wanted local, local:N, tcp://HOST:PORT or a scheduler file (.json)")


def check_library() -> None:
    """Raise MissingError where Dask is not installed."""
    try:
        import distributed  # noqa: F401 - asked for here, before any work
    except ImportError:
        raise MissingError(
            "work on several processes or machines needs the packages dask and distributed: install them with "
            "`pip install '.[sweep]'` in a clone"
        ) from None


@contextmanager
def connected(place: Place, *, quick: bool = False) -> Iterator[Cluster]:
    """Give the connection to a place, with workers that are of our version.

    Parameters
    ----------
    place
        From `parse_place`.
    quick
        Whether kernels may run slowly if they compile quickly, where the workers are started here: nothing is timed.

    Raises
    ------
    InputError
        Where there is no scheduler or no worker, and for workers of another version, by name.
    MissingError
        Where Dask is not installed.
    """
    check_library()
    _quiet()
    with ExitStack() as stack:
        client = stack.enter_context(_local(place.workers, quick=quick) if place.workers else _remote(place))
        check_workers(client)
        yield Cluster(client, place)


def check_workers(client: Any) -> None:
    """Raise InputError for workers that have another version of airlight, or none, by address."""
    from analytic.errors import InputError
    from reports import __version__
    from reports.machine.environment import activate
    from validation.study.keys import made_here

    own = made_here(__version__, activate())
    wrong = []
    for address, answer in client.run(facts, on_error="return").items():
        if isinstance(answer, OSError):  # it went away meanwhile
            continue
        if isinstance(answer, BaseException):
            wrong.append(f"worker {address} cannot do the work ({type(answer).__name__}: {answer})")
        elif own.differences(answer):
            wrong.append(f"worker {address} has {', '.join(own.differences(answer))}")
    if wrong:
        raise InputError(f"{'; '.join(wrong)}: install the same airlight there, or stop it")


@contextmanager
def _local(workers: int, *, quick: bool = False) -> Iterator[Any]:
    """Give the client of processes of this machine, one thread each; a single one has all threads and is alone."""
    import dask
    from distributed import Client, LocalCluster

    from reference.storage.files import temporary_folder

    alone = workers == 1
    # Dask would pause a worker near its limit, and wait for memory that only the next task gives back.
    memory = {f"distributed.worker.memory.{name}": False for name in ("target", "spill", "pause")}
    # What became of a group whose process died is decided by `reports.cluster.run`.
    counts: dict[str, object] = {"distributed.scheduler.allowed-failures": 0}
    # No group waits behind another that takes minutes while a worker has nothing to do.
    counts["distributed.scheduler.worker-saturation"] = 1.0
    # Dask lets the C library give every freed block back, and arrays of a frame's size come as new, zeroed pages: a
    # quarter of a sweep's time was the kernel's. `reports.cluster.run` gives memory back where there is much of it.
    counts["distributed.nanny.pre-spawn-environ"] = {
        "MALLOC_TRIM_THRESHOLD_": _KEPT,
        "MALLOC_MMAP_THRESHOLD_": _KEPT,
        "OMP_NUM_THREADS": 1,
    }
    # A cluster that is told of a death waits so long and then forgets the worker, though another process stands in.
    counts["distributed.deploy.lost-worker-timeout"] = 86400
    with temporary_folder() as folder, dask.config.set(memory | counts), ExitStack() as stack:
        with _without_interrupts():
            _start_quiet_tracker()
            cluster = stack.enter_context(
                LocalCluster(
                    n_workers=workers,
                    threads_per_worker=threads() if alone else 1,
                    processes=True,
                    host="127.0.0.1",
                    dashboard_address="127.0.0.1:0",  # None is port 8787 on all interfaces, which may be taken
                    scheduler_kwargs={"dashboard": False},
                    memory_limit=MEMORY,
                    local_directory=str(folder),
                    silence_logs=logging.CRITICAL,
                    resources={"alone": 1} if alone else None,
                    env=quick_compilation.settings() if quick else None,
                )
            )
            client = stack.enter_context(Client(cluster, set_as_default=False))
        yield client


def _start_quiet_tracker() -> None:
    """Start the process that frees semaphores of a process that was ended, without its words on that."""
    from multiprocessing import resource_tracker

    sys.warnoptions.append("ignore::UserWarning:multiprocessing.resource_tracker")
    try:
        resource_tracker.ensure_running()
    finally:
        sys.warnoptions.pop()


@contextmanager
def _without_interrupts() -> Iterator[None]:
    """Let processes that are started within the block ignore Ctrl-C: this one ends them."""
    import threading

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


@contextmanager
def _remote(place: Place) -> Iterator[Any]:
    from distributed import Client

    from analytic.errors import InputError

    given = {"address": place.address} if place.address else {"scheduler_file": str(place.file)}
    try:
        client = Client(**given, timeout=_PATIENCE, set_as_default=False)
    except (OSError, TimeoutError, ValueError, KeyError) as error:
        words = " ".join(str(error).split()) or type(error).__name__
        raise InputError(
            f"--cluster: no scheduler answers at {place.words} ({words}): start `dask scheduler`, or give its address"
        ) from None
    try:
        client.wait_for_workers(1, timeout=_WORKERS)
        yield client
    except TimeoutError:
        raise InputError(
            f"--cluster: the scheduler at {place.words} has no worker: start `dask worker` with its address, in an "
            "environment that has airlight"
        ) from None
    finally:
        with suppress(Exception):
            client.close(timeout=2)


def _quiet() -> None:
    """Let Dask's own words go: what concerns the user is said by the command."""
    for name in ("distributed", "tornado", "asyncio"):
        logging.getLogger(name).setLevel(logging.CRITICAL)


def facts() -> Any:
    """Return what a worker is made of, `validation.study.keys.Made`."""
    from reports import __version__
    from reports.machine.environment import activate
    from validation.study.keys import made_here

    return made_here(__version__, activate())
