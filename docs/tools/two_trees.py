# SPDX-License-Identifier: BSD-3-Clause
"""Frames of two checkouts side by side: `python docs/tools/two_trees.py OTHER
[--scenes A,B] [--methods A,B]`.

OTHER is a checkout with an environment `.venv`, usually the commit before a change. Both render the
same scenes with the same methods at 800 x 600, by the defaults of each. Frames are timed in turns,
one of this checkout and one of the other, so that what else the machine does meets both. A time is
the time of the processor, over all threads [ms]; a line has the medians, and how many kernels the
first frames ran for the first time.
"""

import json
import os
import statistics
import subprocess
import sys
from argparse import ArgumentParser
from collections.abc import Sequence
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]


class Checkout:
    """A process that renders frames of one checkout."""

    def __init__(self, root: Path):
        self._process = subprocess.Popen(
            [root / ".venv" / "bin" / "python", __file__, "--work"],
            cwd=root,
            env=os.environ | {"PYTHONPATH": str(root / "src"), "AIRLIGHT_COMPILATION": "full"},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def ask(self, *words: Any) -> dict[str, Any]:
        """Send one line of words, and return the answer."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        print(*words, file=self._process.stdin, flush=True)
        answer = self._process.stdout.readline()
        if not answer:
            raise SystemExit(f"the process of {self._process.args[0]} ended")  # type: ignore[index]
        return json.loads(answer)


def compare(
    other: Path, scenes: Sequence[str], methods: Sequence[str], size: str, frames: int
) -> None:
    """Print a line for each scene and method."""
    print(
        f"{'scene':16}{'method':20}{'frame [ms]':>20}{'ratio':>8}{'first [ms]':>16}{'kernels':>12} "
        "  here, other"
    )
    here = Checkout(ROOT).ask("methods", *scenes, "/", *methods)
    for scene, method in here["pairs"]:
        # A pair of processes for each line: the first frame of the one does not
        # find the kernels of another.
        both = [Checkout(ROOT), Checkout(other)]
        first = [checkout.ask("open", scene, method, size) for checkout in both]
        if not all(answer["first"] for answer in first):
            if any(answer["first"] for answer in first):
                print(f"{scene:16}{method:20} rendered by one of both only")
            continue
        times: list[list[float]] = [[], []]
        for _ in range(frames):
            for checkout, own in zip(both, times, strict=True):
                own.append(checkout.ask("frame")["time"])
        mine, theirs = (statistics.median(own) for own in times)
        starts = " ".join(f"{answer['first']:7.0f}" for answer in first)
        kernels = " ".join(f"{answer['kernels']:5d}" for answer in first)
        print(
            f"{scene:16}{method:20}{mine:10.1f}{theirs:10.1f}{mine / theirs:8.2f} {starts} "
            f"{kernels}",
            flush=True,
        )


def work() -> None:
    """Answer the questions of `compare` from the checkout in the current directory."""
    import time

    import drjit as dr

    # by the names that a checkout exports: its files may be in other places
    from airlight import (
        KERNELS,
        METHODS,
        SCENES,
        InputError,
        activate,
        find_method,
        frame_renderer,
        load_scene,
        read_scene,
        render_frame,
    )

    activate()
    renderer: Any = None
    for line in sys.stdin:
        question, *words = line.split()
        answer: dict[str, Any] = {}
        if question == "methods":
            cut = words.index("/")
            scenes, methods = words[:cut] or list(SCENES), words[cut + 1 :] or list(METHODS)
            answer["pairs"] = [(scene, method) for scene in scenes for method in methods]
        elif question == "open":
            scene, method, size = words
            width, height = map(int, size.split("x"))
            loaded = load_scene(scene, (width, height)).scene
            dr.set_flag(dr.JitFlag.KernelHistory, True)
            before = time.process_time()
            try:
                renderer = frame_renderer(
                    read_scene(loaded), find_method(method), kernel=KERNELS["exact"]
                )
                render_frame(renderer)
                answer["first"] = 1000 * (time.process_time() - before)
            except InputError:
                answer["first"] = None
            answer["kernels"] = len(
                {entry["hash"] for entry in dr.kernel_history([dr.KernelType.JIT])}
            )
            dr.set_flag(dr.JitFlag.KernelHistory, False)
        else:
            before = time.process_time()
            render_frame(renderer)
            answer["time"] = 1000 * (time.process_time() - before)
        print(json.dumps(answer), flush=True)


def main() -> None:
    """Read the command line."""
    parser = ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("other", type=Path, help="the other checkout")
    parser.add_argument(
        "--scenes", default="", help="names of built-in scenes with commas; default: all"
    )
    parser.add_argument("--methods", default="", help="names of methods with commas; default: all")
    parser.add_argument("--size", default="800x600", help="of the images [pixels]")
    parser.add_argument(
        "--frames", type=int, default=7, help="frames of each to take the median of"
    )
    chosen = parser.parse_args()
    scenes, methods = (
        list(filter(None, names.split(","))) for names in (chosen.scenes, chosen.methods)
    )
    compare(chosen.other.resolve(), scenes, methods, chosen.size, chosen.frames)


if __name__ == "__main__":
    work() if sys.argv[1:] == ["--work"] else main()
