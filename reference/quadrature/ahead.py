# SPDX-License-Identifier: BSD-3-Clause
"""Work of NumPy alone that threads do ahead of what needs it in order.

NumPy works on one processor, and lets go of Python's lock while it does. What calls Dr.Jit stays with the caller: that
has threads of its own.
"""

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from itertools import islice
from typing import Any, TypeVar

Task = TypeVar("Task")
Result = TypeVar("Result")


def done_ahead(work: Callable[[Task], Result], tasks: Iterable[Task], *, workers: int) -> Iterator[Result]:
    """Yield the results of some work in the order of its tasks, while threads do those that follow.

    `work`: a function of one task that calls NumPy alone; `tasks`: in order; they are made by the caller's thread;
    `workers`: threads; as many results and one more are kept at once. Raises what the work raises, when its
    result is due; the tasks behind it are not begun.
    """
    remaining = iter(tasks)
    with ThreadPoolExecutor(max(1, workers)) as pool:
        waiting: deque[Future[Any]] = deque(pool.submit(work, task) for task in islice(remaining, workers + 1))
        try:
            while waiting:
                result = waiting.popleft().result()
                waiting.extend(pool.submit(work, task) for task in islice(remaining, 1))
                yield result
        finally:  # also where the caller stops, or is stopped
            pool.shutdown(wait=False, cancel_futures=True)
