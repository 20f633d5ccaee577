# SPDX-License-Identifier: BSD-3-Clause
"""The command `airlight challenge` as a processor of 2013 computes it.

`python -m tests.helpers.lesser_machine new 7 -o FOLDER` has kernels of Dr.Jit for x86-64-v3 in
packets of four; older ones lack the fused multiplications that its kernels ask for. NumPy, OpenBLAS
and Embree compute as on a processor of 2009. Challenges are small ones, of three scenes.
"""

import ctypes
import os
import sys
from pathlib import Path

#: the variables that a process needs before it imports NumPy
ENVIRONMENT = {
    "NPY_DISABLE_CPU_FEATURES": "AVX512F AVX512CD AVX512_SKX AVX512_CLX AVX512_CNL AVX512_ICL "
    "AVX2 FMA3",
    "OPENBLAS_CORETYPE": "Nehalem",
}
_TARGET, _PACKET = b"x86-64-v3", 4


def main() -> int:
    """Run the command after its kernels have another target."""
    from airlight.reports.commands.main import run
    from airlight.reports.machine.environment import activate
    from tests.helpers.challenge import make_small

    # Embree reads its settings from the home folder.
    Path(os.environ["HOME"], ".embree3").write_text("isa=sse2")
    activate()
    import drjit

    core = ctypes.CDLL(str(Path(drjit.__file__).parent / "libdrjit-core.so"))
    core._Z19jit_llvm_set_targetPKcS0_j(_TARGET, None, _PACKET)
    name = core._Z19jit_llvm_target_cpuv
    name.restype = ctypes.c_char_p
    assert (name(), core._Z21jit_llvm_vector_widthv()) == (_TARGET, _PACKET)
    make_small(setattr)
    return run(["challenge", *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
