# SPDX-License-Identifier: BSD-3-Clause
"""`airlight.doctor`: every part that a kernel needs, then a kernel itself, and what is cached between runs.

The kernel has a process of its own, because what can go wrong there ends the process: a libLLVM that aborts, a driver
that crashes.

    python -m reports.machine.doctor

prints Debian's names of the packages that are missing, for the launcher.
"""

import json
import signal
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from reports.machine.environment import (
    MissingError,
    atomic_problem,
    child_environment,
    missing_packages,
    prepare,
    processor,
    threads,
    versions,
)
from reports.machine.gpu import cuda_status, optix_status
from reports.machine.llvm import find_llvm
from reports.machine.opengl import opengl_status
from reports.tables.record import Result
from reports.tables.table import Table, table, words

_PATIENCE = 180.0  # seconds for the first kernel; the first one on a GPU compiles OptiX's own


@dataclass(frozen=True, repr=False)
class Doctor(Result):
    """What works on this machine, and what is cached."""

    machine: Mapping[str, Any]  #: as `airlight doctor --json` prints it, without the cache
    cache: Mapping[str, Any]

    @property
    def works(self) -> bool:
        """Whether kernels run here."""
        return bool(self.machine["works"])

    def to_dict(self) -> dict[str, Any]:
        """Return what `airlight doctor --json` prints."""
        return {**self.machine, "cache": dict(self.cache)}

    @property
    def tables(self) -> Sequence[Table]:
        """What works, with details."""
        return [table("", words("what", "works", "details"), self.machine["checks"])]

    @property
    def lines(self) -> Sequence[str]:
        """The cache, and the verdict."""
        cache = self.cache
        size = f"{_size(cache['bytes'])} of at most {_size(cache['limit'])}"
        lines = [f"cache {cache['folder']}: {cache['files']} files, {size}"]
        lines += [f"  {kind}: {of['files']} files, {_size(of['bytes'])}" for kind, of in cache["kinds"].items()]
        if "removed" in cache:
            lines.append(f"  {cache['removed']} files removed, {_size(cache['freed'])} freed")
        ready = "Everything that airlight needs works."
        return [*lines, ready if self.works else f"Not ready: {self.machine['problem']}"]

    @property
    def passed(self) -> bool:
        """Whether all files went, if the cache was to be cleared; the command has a status of its own for `works`."""
        return "removed" not in self.cache or not self.cache["files"]

    @property
    def status(self) -> int:
        """The exit status: 3 where no kernel can be run."""
        return super().status if self.works else 3

    @property
    def title(self) -> str:
        """Whether it works."""
        return "ready" if self.works else str(self.machine["problem"])


def doctor(*, clear_cache: bool = False) -> Doctor:
    """Show what works on this machine, and how to fix what does not.

    The command examines Python and its packages, LLVM, CUDA, OptiX, OpenGL for shaders, a test kernel in a separate
    process, and the cache: finished references and results lie in `~/.cache/airlight` (or in
    `$XDG_CACHE_HOME/airlight`). `AIRLIGHT_CACHE_DIR` names another folder, `AIRLIGHT_CACHE_SIZE` another limit than
    4 GiB (500MB, 20GiB; 0 keeps nothing): above it the files that were used longest ago are removed.

    Exit status 3 if no kernel can be run, 1 if a file of the cache could not be removed.

    Parameters
    ----------
    clear_cache
        Remove every file of the cache; what is needed is computed again.

    Examples
    --------
    >>> import airlight
    >>> airlight.doctor().works  # doctest: +SKIP
    True
    """
    cache = _cache(clear=clear_cache)
    return Doctor(diagnose(), cache)


def _cache(*, clear: bool) -> dict[str, Any]:
    """Return how much is cached, by kind, after everything is removed where that is asked for."""
    from analytic.errors import InputError
    from reference.storage.cache import cache_entries, cache_folder, cache_limit, clear_cache

    folder = cache_folder()
    if folder.exists() and not folder.is_dir():
        raise InputError(f"the cache {folder} is not a folder; remove it, or name another by AIRLIGHT_CACHE_DIR")
    removed = clear_cache() if clear else None
    entries = cache_entries()
    kinds = sorted({entry.kind for entry in entries})
    sizes = {kind: [entry.size for entry in entries if entry.kind == kind] for kind in kinds}
    data = {
        "folder": str(folder),
        "limit": cache_limit(),
        "files": len(entries),
        "bytes": sum(entry.size for entry in entries),
        "kinds": {kind: {"files": len(each), "bytes": sum(each)} for kind, each in sizes.items()},
    }
    return data | ({"removed": removed[0], "freed": removed[1]} if removed is not None else {})


def _size(size: float) -> str:
    """Return a number of bytes in the unit that leaves the fewest digits."""
    units = ["bytes", "KiB", "MiB", "GiB"]
    while size >= 1024 and len(units) > 1:
        size /= 1024
        units.pop(0)
    return f"{size:.0f} {units[0]}" if size >= 100 or units[0] == "bytes" else f"{size:.3g} {units[0]}"


def diagnose() -> dict[str, Any]:
    """Examine this machine, ready for JSON.

    ``works`` says whether kernels run here, ``problem`` what is wrong and what to do (None if nothing), ``variant``
    what was chosen, ``kernel`` what the test kernel found (the libLLVM that it really loaded, its threads and the
    shadow-ray epsilon), and ``checks`` of each part whether it works, and details.
    """
    import platform

    checks: list[dict[str, Any]] = []

    def check(what: str, works: bool | None, details: str) -> None:
        checks.append({"what": what, "works": works, "details": details})

    variant, used, problem, kernel = None, None, None, None
    try:
        prepared = prepare()
        variant, used = prepared.variant, prepared.llvm.path if prepared.llvm else None
        kernel = try_kernel(variant)
        problem = kernel.pop("problem", None)
    except MissingError as error:
        problem = str(error)
    check("platform", None, f"{platform.platform()}, {processor()}, {threads()} threads")
    for name, version in versions().items():
        check(name, version != "missing", f"{version}, {sys.executable}" if name == "python" else version)
    libraries = find_llvm()
    for llvm in libraries:
        check(llvm.label, llvm.works, f"{llvm.path}: {llvm.reason}{', used' if llvm.path == used else ''}")
    if not libraries:
        check("LLVM", False, "none found")
    atomic = atomic_problem()
    check("libatomic.so.1", not atomic, atomic or "can be loaded")
    for name, status in (("CUDA", cuda_status()), ("OptiX", optix_status())):
        check(name, status.works, status.reason)
    opengl = opengl_status(judged=problem is None)
    check("OpenGL", opengl.works, opengl.reason)
    check("variant", variant is not None, variant or "none works")
    if kernel:
        loaded = f"; loaded {kernel['library']}" if kernel["library"] else ""
        check("test kernel", True, f"ran in {kernel['seconds']:.1f} s on {kernel['threads']} threads{loaded}")
        check("shadow-ray epsilon", None, f"{kernel['epsilon']:.4g}, relative; measured")
    elif variant:
        check("test kernel", False, "failed")
    return {"works": problem is None, "problem": problem, "variant": variant, "kernel": kernel, "checks": checks}


def try_kernel(variant: str, patience: float = _PATIENCE) -> dict[str, Any]:
    """Run a kernel in a process of its own and return what it found, or its ``problem``."""
    environment = child_environment(variant)
    command = [sys.executable, "-m", "reports.machine.doctor", "--probe"]
    try:
        ran = subprocess.run(command, capture_output=True, text=True, timeout=patience, env=environment, cwd="/")
    except subprocess.TimeoutExpired:
        return {"problem": f"the test kernel in {variant} did not end within {patience:.0f} s"}
    if ran.returncode == 0:
        return json.loads(ran.stdout.splitlines()[-1])
    words = [line for line in ran.stderr.splitlines() if line.strip()]
    how = f"exit status {ran.returncode}"
    if ran.returncode < 0:
        how = f"killed by {signal.Signals(-ran.returncode).name}"
    return {"problem": f"the test kernel in {variant} failed, {how}: {words[-1] if words else 'without a word'}"}


def _probe() -> None:
    """Cast a ray at a sphere in the chosen variant and check where it meets it."""
    from reports.machine.environment import activate

    start = time.perf_counter()
    variant = activate()
    import drjit as dr
    import mitsuba as mi

    from reference.scene.shadow_epsilon import measure_shadow_epsilon

    scene = mi.load_dict({"type": "scene", "ball": {"type": "sphere", "radius": 0.5}})
    towards = scene.ray_intersect(mi.Ray3f(mi.Point3f([0, 3], 0, -2), mi.Vector3f(0, 0, 1)))
    distances = towards.t.numpy().tolist()
    if abs(distances[0] - 1.5) > 1e-5 or distances[1] < 1e30:
        sys.exit(f"wrong result: distances {distances}, wanted 1.5 and infinity")
    facts = {
        "variant": variant,
        "threads": dr.thread_count(),
        "library": _loaded_llvm(),
        "epsilon": measure_shadow_epsilon(),
        "seconds": time.perf_counter() - start,
    }
    print(json.dumps(facts))


def _loaded_llvm() -> str | None:
    """Return the libLLVM that this process really loaded, where the system tells."""
    try:
        lines = Path("/proc/self/maps").read_text().splitlines()
    except OSError:
        return None
    return next((line.split(maxsplit=5)[5] for line in lines if "libLLVM" in line), None)


if __name__ == "__main__":
    if sys.argv[1:] == ["--probe"]:
        _probe()
    else:
        print(*missing_packages())
