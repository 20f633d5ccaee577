# SPDX-License-Identifier: BSD-3-Clause
"""The environment of this machine, and the check that every command runs before its first kernel.

Importing this module imports neither Mitsuba nor Dr.Jit. `activate` is the only place
that sets a Mitsuba variant.
"""

import ctypes
import os
import sys
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from airlight import __version__
from airlight.errors import MissingError as MissingError
from airlight.errors import require as require
from airlight.reference.storage.build import build
from airlight.reports.machine import quick_compilation
from airlight.reports.machine.gpu import cuda_status, optix_status
from airlight.reports.machine.llvm import LLVM_VARIABLE, OLDEST_LLVM, Llvm, find_llvm

if TYPE_CHECKING:
    from airlight.reference.storage.exr import Image

#: Mitsuba variants that airlight runs in: vectorised, in colour.
VARIANTS = ("cuda_ad_rgb", "llvm_ad_rgb")
VARIANT_VARIABLE = "AIRLIGHT_VARIANT"

_PACKAGES = (
    "mitsuba",
    "drjit",
    "numpy",
    "scipy",
    "mpmath",
    "OpenEXR",
    "colour-science",
    "matplotlib",
)


#: Threads of Dr.Jit. With one, Mitsuba 3.9.1 never ends reading or writing an EXR file: its tasks
#: wait for a thread beside the caller, and there is none. A machine of one core has one by default.
LEAST_THREADS = 2


@dataclass(frozen=True)
class Prepared:
    """The choices of the check before the first kernel."""

    variant: str
    llvm: Llvm | None  #: the library that Dr.Jit will load; None with CUDA, which needs none


def prepare(variant: str | None = None) -> Prepared:
    """Check that kernels can be compiled here, and tell Dr.Jit which libLLVM to use; raises
    MissingError if one is missing.

    Call it before Dr.Jit compiles anything: it sets ``DRJIT_LIBLLVM_PATH``. Takes a few
    milliseconds. Where ``AIRLIGHT_COMPILATION`` is ``quick``, kernels compile quickly and run
    slowly (`reports.machine.quick_compilation`). The variant is by default ``AIRLIGHT_VARIANT``,
    else the best that works.
    """
    # The argument, the environment, then the better one of the two that works.
    variant = variant or os.environ.get(VARIANT_VARIABLE) or None
    if variant is not None:
        check_variant(variant)
    if variant == "cuda_ad_rgb" or variant is None:
        reason = cuda_problem()
        if variant is not None and reason:
            raise MissingError(
                f"the variant cuda_ad_rgb does not work here: {reason}; set "
                f"{VARIANT_VARIABLE}=llvm_ad_rgb"
            )
        variant = "llvm_ad_rgb" if reason else "cuda_ad_rgb"
    # LLVM is needed on a processor only; libatomic in both cases, as `import drjit` loads it.
    on_processor = variant == "llvm_ad_rgb"
    # The best library leads the list, or the one that the user names.
    llvm = next(iter(find_llvm()), None)
    problems = [
        problem
        for problem in (llvm_problem(llvm) if on_processor else "", atomic_problem())
        if problem
    ]
    if problems:
        packages = missing_packages()
        install = f". To install what is missing: {install_line(packages)}" if packages else ""
        raise MissingError("; ".join(problems) + install)
    # With CUDA a machine may lack LLVM.
    if llvm is None or not llvm.works:
        return Prepared(variant, None)
    # Dr.Jit reads the variable when it first compiles.
    os.environ[LLVM_VARIABLE] = llvm.path
    if on_processor and quick_compilation.is_asked_for():
        quick_compilation.compile_quickly(llvm.path)
    return Prepared(variant, llvm)


def activate(variant: str | None = None) -> str:
    """Check the machine as `prepare` does and make the Mitsuba variant current; return its name.

    A variant of `VARIANTS` that is already current stays, unless another one is asked for.

    Raises
    ------
    MissingError
        If the machine lacks what Mitsuba needs; the message says what to install.
    InputError
        If the variant is not one of `VARIANTS`.
    """
    # Objects of one variant are useless in another: the current variant stays unless another is
    # asked for.
    mitsuba = sys.modules.get("mitsuba")
    current = mitsuba.variant() if mitsuba else None
    if current in VARIANTS and (variant or os.environ.get(VARIANT_VARIABLE) or current) == current:
        return current
    # The environment has to be right before the import.
    chosen = prepare(variant)
    try:
        import mitsuba as mi
    except ImportError as error:
        raise MissingError(
            f"mitsuba cannot be imported ({error}): run `pip install mitsuba==3.9.1`"
        ) from error

    try:
        mi.set_variant(chosen.variant)
    except ImportError as error:  # the library exists but cannot be loaded
        raise MissingError(
            f"{chosen.variant} does not start ({error}); see `airlight doctor`"
        ) from error
    import drjit as dr

    from airlight.reports.machine.mitsuba_log import log_to_error_stream

    dr.set_thread_count(max(LEAST_THREADS, dr.thread_count()))
    log_to_error_stream()
    return chosen.variant


def child_environment(variant: str | None = None) -> dict[str, str]:
    """Return the environment of a child process: our modules, those of PYTHONPATH, and a
    variant, else the current.
    """
    # Not resolved: in a checkout src/airlight has links to the folders.
    paths = [str(Path(__file__).parents[3]), *filter(None, [os.environ.get("PYTHONPATH")])]
    mitsuba = sys.modules.get("mitsuba")
    current = variant or (mitsuba.variant() if mitsuba else None)
    chosen = {VARIANT_VARIABLE: current} if current else {}
    return os.environ | {"PYTHONPATH": os.pathsep.join(paths)} | chosen


def check_variant(variant: str) -> None:
    """Raise InputError for a variant that is not one of `VARIANTS`."""
    from airlight.errors import InputError, nearest

    if variant not in VARIANTS:
        raise InputError(
            f"variant: got {variant!r}, expected one of {', '.join(VARIANTS)}"
            + nearest(variant, VARIANTS)
        )


def atomic_problem() -> str:
    """Say what is wrong with libatomic, without which `import drjit` fails; nothing
    wrong gives an empty string.
    """
    if sys.platform != "linux":
        return ""
    try:
        ctypes.CDLL("libatomic.so.1")
    except OSError:
        return "libatomic.so.1 is missing, which Dr.Jit needs"
    return ""


def cuda_problem() -> str:
    """Say why `cuda_ad_rgb` does not work here; an empty string if it does."""
    cuda = cuda_status()
    if not cuda.works:
        return f"CUDA: {cuda.reason}"
    optix = optix_status()
    return "" if optix.works else f"OptiX: {optix.reason}"


def llvm_problem(llvm: Llvm | None) -> str:
    """Say what is wrong with the best libLLVM; nothing wrong gives an empty string."""
    if llvm is None:
        return f"no libLLVM found, {OLDEST_LLVM} or newer is needed (set {LLVM_VARIABLE} if it lies elsewhere)"
    if llvm.works:
        return ""
    if os.environ.get(LLVM_VARIABLE) == llvm.path:
        return f"{LLVM_VARIABLE} names {llvm.path}, which does not work ({llvm.reason}); unset it or name another"
    return f"the newest libLLVM here, {llvm.path}, does not work ({llvm.reason})"


def missing_packages() -> list[str]:
    """Return Debian's names of the packages that are missing here."""
    missing = [] if any(llvm.works for llvm in find_llvm()) else ["libllvm19"]
    return [*missing, "libatomic1"] if atomic_problem() else missing


def install_line(packages: list[str]) -> str:
    """Return in words how packages known by Debian's names are installed."""
    line = f"{'' if os.geteuid() == 0 else 'sudo '}apt-get install -y {' '.join(packages)}"
    return f"`{line}` on Debian; docs/install.md has the names of other systems"


def threads() -> int:
    """Return how many processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def processor() -> str:
    """Return the processor's name, by /proc/cpuinfo if that exists."""
    import platform

    # `platform.processor()` is empty on many Linux systems.
    named = ""
    with suppress(OSError), open("/proc/cpuinfo", encoding="utf-8", errors="replace") as lines:
        named = next(
            (line.partition(":")[2].strip() for line in lines if line.startswith("model name")), ""
        )
    return named or platform.processor() or platform.machine()


@cache
def versions() -> dict[str, str]:
    """Return the versions of airlight, Python and the packages that make the numbers."""
    from importlib.metadata import PackageNotFoundError, version

    installed = {"airlight": __version__, "python": ".".join(map(str, sys.version_info[:3]))}
    for package in _PACKAGES:
        try:
            installed[package] = version(package)
        except PackageNotFoundError:
            installed[package] = "missing"
    return installed


def stamped(image: "Image") -> "Image":
    """Return a layered image whose header names the versions and the build that made it."""
    # An EXR file may travel alone: its header says which code made it.
    made, named = build(), {f"airlight:version:{key}": value for key, value in versions().items()}
    named |= {"airlight:commit": made.commit, "airlight:digest": made.digest}
    if made.changed is not None:
        named["airlight:changed"] = str(made.changed).lower()
    return replace(image, attributes=dict(image.attributes) | named)


def describe_environment() -> dict[str, object]:
    """Return the software and hardware that make the numbers, as JSON-ready data."""
    import platform

    mitsuba = sys.modules.get("mitsuba")
    variant = mitsuba.variant() if mitsuba else None
    # The variant may not be set yet, and the device is known with CUDA only.
    environment: dict[str, object] = {
        "versions": versions(),
        "build": asdict(build()),
        "platform": platform.platform(),
        "processor": processor(),
        "threads": threads(),
        "variant": variant or "none yet",
    }
    if variant == "cuda_ad_rgb":
        environment["device"] = cuda_status().reason
    # With CUDA it is listed too, where there is one.
    llvm = next(iter(find_llvm()), None)
    if llvm is not None:
        environment["llvm"] = f"{llvm.label}, {llvm.path}"
    return environment


def machine() -> dict[str, str]:
    """Return the parts of the environment that times depend on, for the
    keys of results with times.
    """
    environment = describe_environment()
    known = {
        name: str(environment.get(name))
        for name in ("processor", "threads", "variant", "llvm", "device")
    }
    # Kernels that were compiled quickly run slowly: their times are others.
    return known | ({"compilation": "quick"} if quick_compilation.is_asked_for() else {})


def machine_in_words(environment: Mapping[str, Any]) -> str:
    """Return the machine in a line, from `describe_environment`: the GPU first, if there is one."""
    device = f"{environment['device']}, " if environment.get("device") else ""
    return f"{device}{environment['processor']}, {environment['threads']} threads, {environment['variant']}"
