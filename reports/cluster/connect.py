# SPDX-License-Identifier: BSD-3-Clause
"""Where a command's work runs: processes of this machine, or a Dask scheduler with
workers of any machines.
"""

import logging
import re
import signal
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

from airlight.reports.machine import quick_compilation
from airlight.reports.machine.environment import require, threads

MEMORY = "2GiB"  #: of a local worker, above which Dask ends it
_PATIENCE = 10.0  # until a scheduler has answered [s]
_ADDRESS = re.compile(r"(tcp|tls|ucx|ws|wss)://[^\s/]+")


Client = Any  #: `distributed.Client`


#: what `--cluster` names: processes of this machine, or a scheduler's
#: address, or a file that has it
Place = int | str


def parse_place(word: str | None) -> Place:
    """Return the place that a word names; a worker for each processor of this machine for None."""
    from airlight.errors import InputError

    require("distributed", "sweep", "work on several processes or machines")
    # `local` uses every processor, `local:N` that many processes; anything else is a scheduler's
    # address or its file.
    word = "local" if word is None else word.strip()
    if word == "local":
        return threads()
    if local := re.fullmatch(r"local:([1-9]\d{0,3})", word):
        return int(local[1])
    if _ADDRESS.fullmatch(word) or Path(word).is_file():
        return word
    raise InputError(
        f"--cluster: got {word!r}, expected local, local:N with up to 9999 processes, "
        "tcp://HOST:PORT, or the file "
        "that `dask scheduler --scheduler-file` writes"
    )


@contextmanager
def connected(place: Place, *, quick: bool = False) -> Iterator[Client]:
    """Give the connection to a place; `quick` compiles kernels quickly in its
    processes, where nothing is timed.
    """
    # A number of processes or a scheduler.
    _quiet()
    with _local(place, quick=quick) if isinstance(place, int) else _remote(place) as client:
        yield client


@contextmanager
def _local(workers: int, *, quick: bool = False) -> Iterator[Client]:
    """Give the client of processes of this machine, one thread each; a single one has
    all threads and is alone.
    """
    import dask
    from distributed import Client, LocalCluster

    from airlight.errors import InputError
    from airlight.reference.storage.files import temporary_folder

    alone = workers == 1
    settings: dict[str, object] = {
        # Dask would pause a worker near its limit, and wait for memory that only
        # the next task gives back.
        **{f"distributed.worker.memory.{name}": False for name in ("target", "spill", "pause")},
        # `reports.cluster.run` decides about a group whose process died.
        "distributed.scheduler.allowed-failures": 0,
        # No group waits behind another that takes minutes while a worker has nothing to do.
        "distributed.scheduler.worker-saturation": 1.0,
        # Dask lets the C library give every freed block back, and arrays of a frame's size come as
        # new, zeroed pages: a quarter of a sweep's time was the kernel's. A worker keeps so many
        # freed bytes, and no larger array may come of them.
        "distributed.nanny.pre-spawn-environ": {
            **{f"MALLOC_{name}_THRESHOLD_": 2**28 for name in ("TRIM", "MMAP")},
            "OMP_NUM_THREADS": 1,
        },
        # A cluster that is told of a death waits so long and then forgets the worker,
        # though another stands in.
        "distributed.deploy.lost-worker-timeout": 86400,
    }
    with temporary_folder() as folder, dask.config.set(settings), ExitStack() as stack:
        with _without_interrupts():
            _start_quiet_tracker()
            try:
                cluster = stack.enter_context(
                    LocalCluster(
                        n_workers=workers,
                        threads_per_worker=threads() if alone else 1,
                        processes=True,
                        host="127.0.0.1",
                        # None is port 8787 on all interfaces, which may be taken
                        dashboard_address="127.0.0.1:0",
                        scheduler_kwargs={"dashboard": False},
                        memory_limit=MEMORY,
                        local_directory=str(folder),
                        silence_logs=logging.CRITICAL,
                        resources={"alone": 1} if alone else None,
                        env=quick_compilation.settings() if quick else None,
                    )
                )
            except RuntimeError as error:
                # A process that is started imports the script of its caller, and would start others.
                raise InputError(
                    "cluster: its processes did not start; each runs the script that calls airlight "
                    'again: put what it does under `if __name__ == "__main__":`'
                ) from error
            client = stack.enter_context(Client(cluster, set_as_default=False))
        yield client


def _start_quiet_tracker() -> None:
    """Start the process that frees semaphores of a process that was ended,
    without its words on that.
    """
    from multiprocessing import resource_tracker

    sys.warnoptions.append("ignore::UserWarning:multiprocessing.resource_tracker")
    try:
        resource_tracker.ensure_running()
    finally:
        sys.warnoptions.pop()


@contextmanager
def _without_interrupts() -> Iterator[None]:
    """Let processes that are started within the block ignore Ctrl-C: this one ends them."""
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


@contextmanager
def _remote(scheduler: str) -> Iterator[Client]:
    from distributed import Client

    from airlight.errors import InputError

    # The file that a scheduler writes has its address, which may change when it starts again.
    given = {"address" if _ADDRESS.fullmatch(scheduler) else "scheduler_file": scheduler}
    try:
        client = Client(**given, timeout=_PATIENCE, set_as_default=False)
    except (OSError, TimeoutError, ValueError, KeyError) as error:
        words = " ".join(str(error).split()) or type(error).__name__
        raise InputError(
            f"--cluster: no scheduler answers at {scheduler} ({words}): start `dask scheduler`, or "
            "give its address"
        ) from None
    try:
        # A scheduler without workers accepts tasks and never does them: the command would wait for
        # ever.
        try:
            client.wait_for_workers(1, timeout=30)
        except TimeoutError:
            raise InputError(
                f"--cluster: the scheduler at {scheduler} has no worker: start `dask worker` with "
                "its address, in an "
                "environment that has airlight"
            ) from None
        yield client
    finally:
        # The scheduler may have disappeared during the work.
        with suppress(Exception):
            client.close(timeout=2)


def _quiet() -> None:
    """Let Dask's own words go: what concerns the user is said by the command."""
    for name in ("distributed", "tornado", "asyncio"):
        logging.getLogger(name).setLevel(logging.CRITICAL)


def facts() -> Any:
    """Return the versions and source code of this process, `validation.study.keys.Made`."""
    from airlight import __version__
    from airlight.reports.machine.environment import activate
    from airlight.validation.study.keys import made_here

    return made_here(__version__, activate())
