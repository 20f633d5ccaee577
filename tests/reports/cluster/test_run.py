# SPDX-License-Identifier: BSD-3-Clause
"""Claim: every task ends in one outcome, whatever happens to its process, and only
the guilty one is given up.
"""

import os
import signal
import threading
import time
from collections import Counter

import pytest

pytest.importorskip("distributed", reason="the extra `sweep` is not installed")

from airlight.reports.cluster import connect
from airlight.reports.cluster.run import Group, Task, run_groups
from tests.helpers import cluster_tasks as tasks


@pytest.fixture(scope="module")
def cluster():
    """Two processes, without the check of versions, which imports Mitsuba in each."""
    connect._quiet()
    with connect._local(2) as client:
        yield client


def outcomes(cluster, *groups, **options):
    """Return status, value and reason of every task by name; no task has two outcomes."""
    ended = list(run_groups(cluster, groups, **options))
    assert not [
        name for name, count in Counter(each.task.name for each in ended).items() if count > 1
    ]
    return {each.task.name: each for each in ended}


def alone(*given):
    return Group(tuple(given))


def test_values_refusals_and_faults(cluster):
    ended = outcomes(
        cluster,
        alone(*(Task(f"s{n}", tasks.square, (n,)) for n in range(20))),
        alone(
            Task("dark", tasks.refuse), Task("fault", tasks.fail), Task("large", tasks.large, (7,))
        ),
        Group(
            (Task("one", tasks.add, (1,)), Task("two", tasks.add, (2,))),
            Task("ten", tasks.square, (10,)),
        ),
        Group((Task("dim", tasks.add, (1,)),), Task("night", tasks.refuse)),
    )
    assert [ended[f"s{n}"].value for n in range(20)] == [n * n for n in range(20)]
    assert (ended["dark"].status, ended["dark"].reason) == ("refused", "it is too dark")
    assert ended["fault"].status == "failed"
    assert ended["fault"].reason.startswith("ValueError: a fault (fail, line")
    assert ended["large"].value[-1] == 7
    assert (ended["one"].value, ended["two"].value) == (101, 102)
    assert (ended["dim"].status, ended["dim"].reason) == ("refused", "night: it is too dark")
    assert "ten" not in ended


def test_what_belongs_together_is_done_by_one_process_and_all_have_work(cluster):
    groups = [
        Group(tuple(Task(f"{g}-{n}", tasks.process, (0.05,)) for n in range(4))) for g in range(8)
    ]
    ended = outcomes(cluster, *groups)
    processes = [{ended[task.name].value for task in group.tasks} for group in groups]
    assert [len(each) for each in processes] == [1] * len(groups)
    assert len(set.union(*processes)) == 2


@pytest.mark.claim("sweeps-end-what-hangs", tolerance="none")
def test_a_task_that_ends_its_process_is_given_up_and_no_other(cluster):
    others = [Task(f"s{n}", tasks.square, (n, 0.05)) for n in range(12)]
    last = Group((Task("last", tasks.add, (1,)),), Task("reference of {a}", tasks.abort))
    ended = outcomes(cluster, alone(Task("bad", tasks.abort), *others), last, retries=1)
    assert (ended["bad"].status, ended["bad"].attempts) == ("aborted", 2)
    assert ended["bad"].reason == "its process ended 2 times while it ran"
    # A name of a user, here of a scene, stands as it is.
    assert (ended["last"].status, ended["last"].attempts) == ("aborted", 2)
    assert ended["last"].reason == "reference of {a}: its process ended 2 times while it ran"
    assert {ended[task.name].status for task in others} == {"done"}


@pytest.mark.slow
@pytest.mark.claim("sweeps-end-what-hangs", tolerance="none")
@pytest.mark.parametrize(
    "hang", [tasks.sleep_for_ever, tasks.hold_the_interpreter], ids=lambda task: task.__name__
)
def test_what_hangs_is_stopped_and_its_process_too(cluster, hang):
    ended = outcomes(
        cluster,
        alone(
            Task("hang", hang, limit=1.0), *(Task(f"s{n}", tasks.square, (n,)) for n in range(4))
        ),
    )
    assert (ended["hang"].status, ended["hang"].reason) == ("hung", "stopped after 1 s")
    assert sum(each.status == "done" for each in ended.values()) == 4
    # Both workers are there again: none waits for ever.
    again = outcomes(cluster, alone(*(Task(f"t{n}", tasks.square, (n, 0.02)) for n in range(10))))
    assert {each.status for each in again.values()} == {"done"}


@pytest.mark.slow
@pytest.mark.claim(
    "sweeps-lose-nothing", tolerance="none: every task has one outcome, with its value"
)
def test_twenty_kills_during_two_hundred_tasks(cluster):
    """Claim: no task is lost or counted twice when workers are killed at any moment."""
    killed = []
    stop = threading.Event()

    def kill():
        while len(killed) < 20 and not stop.wait(0.35):
            told = cluster.sync(cluster.scheduler.identity, n_workers=-1)
            known = [worker["nanny"] for worker in told["workers"].values()]
            pids = cluster.run(os.getpid, on_error="ignore")
            if known and pids:
                victim = sorted(pids.values())[len(killed) % len(pids)]
                try:
                    os.kill(victim, signal.SIGKILL)
                except ProcessLookupError:
                    continue
                killed.append(victim)

    groups = [
        Group(
            tuple(Task(f"{g}-{n}", tasks.add, (n,)) for n in range(10)),
            Task(f"reference {g}", tasks.square, (g, 0.2)),
        )
        for g in range(20)
    ]
    slowly = [alone(*(Task(f"slow {n}", tasks.square, (n, 0.3)) for n in range(60)))]
    thread = threading.Thread(target=kill)
    thread.start()
    begin = time.monotonic()
    try:
        ended = outcomes(cluster, *groups, *slowly, retries=30)
        while len(killed) < 20 and time.monotonic() - begin < 120:
            more = [alone(*(Task(f"more {n}", tasks.square, (n, 0.1)) for n in range(40)))]
            assert {each.status for each in outcomes(cluster, *more, retries=30).values()} == {
                "done"
            }
    finally:
        stop.set()
        thread.join()
    assert len(killed) == 20
    assert {name: each.value for name, each in ended.items()} == {
        f"{g}-{n}": g * g + n for g in range(20) for n in range(10)
    } | {f"slow {n}": n * n for n in range(60)}
