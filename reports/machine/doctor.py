# SPDX-License-Identifier: BSD-3-Clause
"""`airlight.doctor`: every part that a kernel needs, then a kernel itself, and
what is cached between runs.

The kernel has a separate process, because what can go wrong there ends the process: a libLLVM that
aborts, a driver that crashes.

    python -m airlight.reports.machine.doctor

prints Debian's names of the packages that are missing, for the launcher.
"""

import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from airlight.analytic.clock import stopwatch
from airlight.reference.storage.build import build
from airlight.reports.machine.environment import (
    MissingError,
    atomic_problem,
    missing_packages,
    prepare,
    processor,
    threads,
    versions,
)
from airlight.reports.machine.gpu import cuda_status, optix_status
from airlight.reports.machine.llvm import find_llvm
from airlight.reports.tables.record import Result
from airlight.reports.tables.table import Table, table, words


@dataclass(frozen=True)
class Kernel:
    """The findings of the test kernel."""

    variant: str
    threads: int
    library: str | None  #: the libLLVM that was really loaded, where the system tells
    epsilon: float  #: of shadow rays, relative
    seconds: float = 0.0  #: until its process had answered


@dataclass(frozen=True)
class Check:
    """Whether a part works; None for a fact."""

    what: str
    works: bool | None
    details: str


@dataclass(frozen=True)
class Machine:
    """Whether kernels run here."""

    works: bool
    problem: str | None  #: what is wrong and what to do
    variant: str | None  #: that was chosen
    kernel: Kernel | None
    checks: tuple[Check, ...]


@dataclass(frozen=True)
class Files:
    """How much is cached of a kind."""

    files: int
    bytes: int


@dataclass(frozen=True)
class Cache:
    """How much is cached."""

    folder: str
    limit: int
    files: int
    bytes: int
    kinds: Mapping[str, Files]
    removed: int | None = None  #: files, where the cache was to be cleared
    freed: int | None = None  #: bytes


@dataclass(frozen=True, repr=False)
class Doctor(Result):
    """The checks of this machine, and the contents of the cache."""

    machine: Machine
    cache: Cache

    @property
    def works(self) -> bool:
        """Whether kernels run here."""
        return self.machine.works

    def to_dict(self) -> dict[str, Any]:
        """Return the data that `airlight doctor --json` prints."""
        return asdict(self.machine) | {"cache": asdict(self.cache)}

    @property
    def tables(self) -> Sequence[Table]:
        """The checks with details."""
        return [table("", words("what", "works", "details"), map(vars, self.machine.checks))]

    @property
    def lines(self) -> Sequence[str]:
        """The cache, and the verdict."""
        cache = self.cache
        lines = [
            f"cache {cache.folder}: {cache.files} files, {_size(cache.bytes)} of at most "
            f"{_size(cache.limit)}"
        ]
        lines += [
            f"  {kind}: {of.files} files, {_size(of.bytes)}" for kind, of in cache.kinds.items()
        ]
        if cache.freed is not None:
            lines.append(f"  {cache.removed} files removed, {_size(cache.freed)} freed")
        ready = "Everything that airlight needs works."
        return [*lines, ready if self.works else f"Not ready: {self.machine.problem}"]

    @property
    def failures(self) -> Sequence[str]:
        """Why no kernel runs here, and that files are left of a cache that was to be cleared."""
        left = self.cache.files if self.cache.removed is not None else 0
        problem = [] if self.works else [self.machine.problem or "no kernel runs here"]
        return [*problem, *([f"{left} files of the cache are left"] if left else [])]

    @property
    def status(self) -> int:
        """The exit status: 3 where no kernel can be run, 1 where the cache was to be
        cleared and files are left.
        """
        return super().status if self.works else 3

    @property
    def title(self) -> str:
        """Whether it works."""
        return self.machine.problem or "ready"


def doctor(*, clear_cache: bool = False) -> Doctor:
    """Show what works on this machine, and how to fix what does not.

    The command examines Python and its packages, LLVM, CUDA, OptiX, OpenGL for shaders, a test
    kernel in a separate process, and the cache: finished references and results lie in
    `~/.cache/airlight` (or in `$XDG_CACHE_HOME/airlight`). `AIRLIGHT_CACHE_DIR` names another
    folder, `AIRLIGHT_CACHE_SIZE` another limit than 4 GiB (500MB, 20GiB; 0 keeps nothing): above it
    the files that were used longest ago are removed.

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
    # The cache first: its folder may be a mistake of the user, which is quicker to say than to run
    # a kernel.
    cache = _cache(clear=clear_cache)
    return Doctor(diagnose(), cache)


def _cache(*, clear: bool) -> Cache:
    """Return how much is cached, after everything is removed where that is asked for."""
    from airlight.errors import InputError
    from airlight.reference.storage.cache import (
        cache_entries,
        cache_folder,
        cache_limit,
        clear_cache,
    )

    folder = cache_folder()
    # A file in place of the folder would fail every command.
    if folder.exists() and not folder.is_dir():
        raise InputError(
            f"the cache {folder} is not a folder; remove it, or name another by AIRLIGHT_CACHE_DIR"
        )
    # Files are removed before they are counted: the numbers say what is left.
    removed = clear_cache() if clear else (None, None)
    entries = cache_entries()
    sizes = {
        kind: [each.size for each in entries if each.kind == kind]
        for kind in sorted({e.kind for e in entries})
    }
    kinds = {kind: Files(len(each), sum(each)) for kind, each in sizes.items()}
    return Cache(
        str(folder),
        cache_limit(),
        len(entries),
        sum(each.size for each in entries),
        kinds,
        *removed,
    )


def _size(size: float) -> str:
    """Return a number of bytes in the unit that leaves the fewest digits."""
    units = ["bytes", "KiB", "MiB", "GiB"]
    while size >= 1024 and len(units) > 1:
        size /= 1024
        units.pop(0)
    return (
        f"{size:.0f} {units[0]}" if size >= 100 or units[0] == "bytes" else f"{size:.3g} {units[0]}"
    )


def diagnose() -> Machine:
    """Examine this machine."""
    import platform

    from airlight.realtime.child_process import EndedError
    from airlight.reports.machine.opengl import opengl_status

    # The first thing that fails is the problem; all checks are listed whatever fails.
    variant, used, problem, kernel = None, None, None, None
    try:
        prepared = prepare()
        variant, used = prepared.variant, prepared.llvm.path if prepared.llvm else None
        kernel = try_kernel(variant)
    except (MissingError, EndedError) as error:
        problem = str(error)
    checks = [Check("platform", None, f"{platform.platform()}, {processor()}, {threads()} threads")]
    # Packages, then the libraries that the system has to bring.
    for name, version in versions().items():
        details = {"airlight": build().words, "python": f"{version}, {sys.executable}"}.get(
            name, version
        )
        checks.append(Check(name, version != "missing", details))
    # Every libLLVM of the machine with its reason: the one that was used may not be the one that
    # the user means.
    libraries = find_llvm()
    for llvm in libraries:
        details = f"{llvm.path}: {llvm.reason}{', used' if llvm.path == used else ''}"
        checks.append(Check(llvm.label, llvm.works, details))
    checks += [] if libraries else [Check("LLVM", False, "none found")]
    atomic = atomic_problem()
    checks.append(Check("libatomic.so.1", not atomic, atomic or "can be loaded"))
    # The error of OpenGL needs Mitsuba.
    opengl = opengl_status(judged=problem is None)
    for name, status in (("CUDA", cuda_status()), ("OptiX", optix_status()), ("OpenGL", opengl)):
        checks.append(Check(name, status.works, status.reason))
    # The kernel last: it ran with all of the above.
    checks.append(Check("variant", variant is not None, variant or "none works"))
    if kernel:
        loaded = f"; loaded {kernel.library}" if kernel.library else ""
        details = f"ran in {kernel.seconds:.1f} s on {kernel.threads} threads{loaded}"
        checks.append(Check("test kernel", True, details))
        checks.append(
            Check("shadow-ray epsilon", None, f"{kernel.epsilon:.4g}, relative; measured")
        )
    elif variant:
        checks.append(Check("test kernel", False, "failed"))
    return Machine(problem is None, problem, variant, kernel, tuple(checks))


def try_kernel(variant: str) -> Kernel:
    """Run a kernel in a separate process; raises EndedError or
    MissingError where it does not work.
    """
    from airlight.reports.machine.own_process import in_own_process

    # The time includes the start of the process and its imports. The first kernel on a GPU also
    # compiles OptiX's own, and gets three minutes for it.
    took = stopwatch()
    kernel = in_own_process(
        probe, what="the test kernel in", name=variant, limit=180, variant=variant
    )
    return replace(kernel, seconds=took().seconds)


def probe() -> Kernel:
    """Cast a ray at a sphere in the current variant, and check where it meets it."""
    import drjit as dr
    import mitsuba as mi

    from airlight.reference.scene.shadow_epsilon import measure_shadow_epsilon

    scene = mi.load_dict({"type": "scene", "ball": {"type": "sphere", "radius": 0.5}})
    towards = scene.ray_intersect(mi.Ray3f(mi.Point3f([0, 3], 0, -2), mi.Vector3f(0, 0, 1)))
    distances = towards.t.numpy().tolist()
    if abs(distances[0] - 1.5) > 1e-5 or distances[1] < 1e30:
        raise MissingError(
            f"the test kernel is wrong: distances {distances}, expected 1.5 and infinity"
        )
    return Kernel(mi.variant(), dr.thread_count(), _loaded_llvm(), measure_shadow_epsilon())


def _loaded_llvm() -> str | None:
    """Return the libLLVM that this process really loaded, where the system tells."""
    try:
        lines = Path("/proc/self/maps").read_text().splitlines()
    except OSError:
        return None
    return next((line.split(maxsplit=5)[5] for line in lines if "libLLVM" in line), None)


if __name__ == "__main__":
    print(*missing_packages())
