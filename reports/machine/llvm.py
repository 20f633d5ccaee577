# SPDX-License-Identifier: BSD-3-Clause
"""Find a libLLVM that works, before Dr.Jit picks one that does not.

Dr.Jit 1.5 compiles its kernels with whatever libLLVM it meets first: the file named by
`DRJIT_LIBLLVM_PATH`, else `libLLVM.so` as the dynamic linker finds it, else the newest of
`/usr/lib/<multiarch>/libLLVM*.so.*` (drjit-core, `src/llvm_api.cpp`). It accepts version 11 and
newer, but 14 and 15, Debian 12's default, abort the process in the kernels of Mitsuba's volumetric
path tracer. The choice is therefore made here, from file names alone: nothing is loaded, because a
library that is loaded wins over any later setting.
"""

import os
import re
import subprocess
import sys
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

OLDEST_LLVM = 17
LLVM_VARIABLE = "DRJIT_LIBLLVM_PATH"

# Folders of the distributions and apt.llvm.org, of Homebrew, and of archives
# unpacked in /opt or /usr/local.
_FOLDERS = (
    *(
        f"usr/lib/{os.uname().machine}-linux-gnu",
        "usr/lib/llvm-*/lib",
        "usr/lib64/llvm*/lib*",
        "usr/lib64",
        "usr/lib",
        "usr/local/lib",
    ),
    *(
        "home/linuxbrew/.linuxbrew/opt/llvm*/lib",
        "opt/[lL][lL][vV][mM]*/lib",
        "usr/local/[lL][lL][vV][mM]*/lib",
    ),
)
# libLLVM-14.so.1, libLLVM-14.0.6.so, libLLVM.so.19.1, without a version libLLVM.so; not the
# libraries of single components, such as libLLVMCore.so.19.1.
_LIBRARY = re.compile(
    r"libLLVM(?:-(\d+)(?:\.(\d+))?[^/]*\.so[^/]*|\.so\.(\d+)(?:\.(\d+))?[^/]*|\.so)"
)
_ASK_VERSION = (
    "import ctypes, sys\n"
    "numbers = [ctypes.c_uint() for _ in range(3)]\n"
    "ctypes.CDLL(sys.argv[1]).LLVMGetVersion(*[ctypes.byref(number) for number in numbers])\n"
    "print(*[number.value for number in numbers[:2]])\n"
)


@dataclass(frozen=True)
class Llvm:
    """A libLLVM, and whether it can be used."""

    path: str  #: as `DRJIT_LIBLLVM_PATH` would name it
    version: tuple[int, int] | None  #: major and minor, None if the file does not tell
    works: bool
    reason: str  #: why it works or not, in words

    @property
    def label(self) -> str:
        """The version in words."""
        return "LLVM ?" if self.version is None else f"LLVM {self.version[0]}.{self.version[1]}"


def llvm_folders() -> list[Path]:
    """Return the folders in which a libLLVM may lie: those of LD_LIBRARY_PATH, of
    conda, and of the system.
    """
    # The order is the one in which equal versions are preferred.
    named = [Path(folder) for folder in os.environ.get("LD_LIBRARY_PATH", "").split(":") if folder]
    conda = [
        Path(prefix, "lib") for prefix in (sys.prefix, os.environ.get("CONDA_PREFIX")) if prefix
    ]
    return [
        *named,
        *conda,
        *(path for each in _FOLDERS for path in sorted(Path("/").glob(each), reverse=True)),
    ]


def find_llvm() -> list[Llvm]:
    """List every libLLVM of this machine: the user's setting first, then those
    that work, then the newest.
    """
    # One library has several names, links and versions: its real path stands for it, and the first
    # name that was found is reported.
    setting = os.environ.get(LLVM_VARIABLE)
    by_path: dict[str, Llvm] = {}
    for path in _libraries(llvm_folders()):
        by_path.setdefault(os.path.realpath(path), examine_llvm(str(path)))
    libraries = sorted(
        by_path.values(), key=lambda llvm: (llvm.works, llvm.version or (0, 0)), reverse=True
    )
    # The user's setting leads the list even if it does not work: `prepare` then says so, and does
    # not take another in silence.
    if setting:
        preferred = examine_llvm(setting)
        libraries = [
            preferred,
            *(
                llvm
                for llvm in libraries
                if os.path.realpath(llvm.path) != os.path.realpath(setting)
            ),
        ]
    return libraries


def examine_llvm(path: str) -> Llvm:
    """Say what a libLLVM is and whether it works, if possible without loading it."""
    # A bare name is looked up by the dynamic linker.
    if os.path.dirname(path) and not os.path.isfile(path):
        return Llvm(path, None, False, "there is no such file")
    # Loading is the last resort, and happens in another process (see the module).
    version = _version_of_name(path) or _version_asked(path)
    if version is None:
        return Llvm(
            path,
            None,
            False,
            "its version is unknown: it has no LLVMGetVersion, so it is older than 16",
        )
    if version[0] < OLDEST_LLVM:
        return Llvm(
            path,
            version,
            False,
            f"too old: {OLDEST_LLVM} or newer is needed, 14 and 15 abort the process",
        )
    return Llvm(path, version, True, "works")


def _libraries(folders: Iterable[Path]) -> Iterator[str]:
    for folder in folders:
        try:
            names = sorted(os.listdir(folder))
        except OSError:
            continue
        yield from (os.path.join(folder, name) for name in names if _LIBRARY.fullmatch(name))


def _version_of_name(path: str) -> tuple[int, int] | None:
    # A link such as libLLVM.so tells no version, the file that it leads to does.
    name = _LIBRARY.fullmatch(os.path.basename(os.path.realpath(path)))
    groups = [group for group in name.groups() if group] if name else []
    return (int(groups[0]), int(groups[1]) if len(groups) > 1 else 0) if groups else None


def _version_asked(path: str) -> tuple[int, int] | None:
    """Load the library in a separate process and ask it; slow, for names that do not tell."""
    command = [sys.executable, "-c", _ASK_VERSION, path]
    try:
        answer = subprocess.run(
            command, capture_output=True, text=True, timeout=30, check=True
        ).stdout.split()
    except (OSError, subprocess.SubprocessError):
        return None
    return (int(answer[0]), int(answer[1])) if len(answer) == 2 else None
