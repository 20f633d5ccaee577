# SPDX-License-Identifier: BSD-3-Clause
"""A hack: kernels that compile faster and run slower, for work that runs most of them once.

Dr.Jit has LLVM optimise every kernel for all that it is worth: the passes of `-O2`, then the third
level of code generation. A random scene has its own kernels, and an image of it is rendered once:
two thirds of a sweep's time went into compilation. LLVM has no setting for Dr.Jit to pass on, but
options of its own command line, which any program can set through its C interface,
`LLVMParseCommandLineOptions`:

- `-opt-bisect-limit=0`, meant for finding the pass that breaks a program, runs no
  pass that can be left out;
- `-optimize-regalloc=false` allocates registers in one go.

None of the passes may change a result: IEEE arithmetic stays as it is written. The tests compare
images bit for bit. The column `cpu_ms` of two sweeps, with `times` of "none" and of "with", shows
the gain; the loss is printed by `AIRLIGHT_COMPILATION=quick airlight study methods`. No published
time is of such kernels. They have a separate folder in Dr.Jit's cache, as its keys do not tell how
a kernel was compiled.

LLVM reports each pass that it does not run on the standard error. A second process therefore passes
the standard error on without these reports, also messages from before an abort of the process that
compiles.
"""

import ctypes
import os
import subprocess
import sys
from functools import cache
from pathlib import Path

VARIABLE = "AIRLIGHT_COMPILATION"  #: 'quick' asks for it; unset, or 'full', is as Dr.Jit compiles
CACHE_VARIABLE = "DRJIT_CACHE_DIR"

_QUICK = (b"airlight", b"-opt-bisect-limit=0", b"-optimize-regalloc=false")
_FOLDER = "quick"  # of kernels, in Dr.Jit's folder
_PASS_ON = """
import sys
for line in sys.stdin.buffer:
    if not line.startswith(b"BISECT: "):
        sys.stdout.buffer.write(line)
        sys.stdout.buffer.flush()
"""


def is_asked_for() -> bool:
    """Return whether the environment asks for quick compilation."""
    value = os.environ.get(VARIABLE) or "full"
    if value not in ("quick", "full"):
        from airlight.errors import InputError

        raise InputError(f"{VARIABLE}: got {value!r}, expected quick, or full as without it")
    return value == "quick"


def settings() -> dict[str, str]:
    """Return the environment variables of a process that is to compile quickly."""
    folder = Path(os.environ.get(CACHE_VARIABLE) or Path.home() / ".drjit")
    return {
        VARIABLE: "quick",
        CACHE_VARIABLE: str(folder if folder.name == _FOLDER else folder / _FOLDER),
    }


@cache
def compile_quickly(library: str) -> None:
    """Let the libLLVM that Dr.Jit will load compile quickly in this process; call it
    before Dr.Jit is imported.

    A process that has imported it and was not started with `settings` stays as it is.
    """
    if "drjit" in sys.modules and not _has_settings():
        return  # Dr.Jit has chosen its folder, where the kernels of both kinds would mix
    os.environ.update(settings())
    _leave_out_passes()
    parse = ctypes.CDLL(library).LLVMParseCommandLineOptions
    parse.argtypes, parse.restype = (
        [ctypes.c_int, ctypes.POINTER(ctypes.c_char_p), ctypes.c_char_p],
        None,
    )
    parse(len(_QUICK), (ctypes.c_char_p * len(_QUICK))(*_QUICK), None)


def _has_settings() -> bool:
    return all(os.environ.get(name) == value for name, value in settings().items())


def _leave_out_passes() -> None:
    """Let a process pass on the standard error, without LLVM's words; Python goes on
    to write to the old one.
    """
    kept, stream = os.dup(2), sys.stderr
    command = [sys.executable, "-S", "-E", "-c", _PASS_ON]
    # It reads until the last process has closed its end, and is not stopped by Ctrl-C before.
    passing = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=kept, start_new_session=True)
    assert passing.stdin is not None
    os.dup2(passing.stdin.fileno(), 2)
    passing.stdin.close()
    passing.returncode = 0  # it is not waited for, and that is no mistake
    try:
        own = stream.fileno() == 2
    except (AttributeError, OSError, ValueError):
        own = False
    if own:  # a terminal stays a terminal
        sys.stderr = os.fdopen(
            kept, "w", buffering=1, encoding=stream.encoding, errors=stream.errors
        )
