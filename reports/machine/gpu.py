# SPDX-License-Identifier: BSD-3-Clause
"""Whether CUDA and OptiX work here, each with the reason: asked of the driver, without Dr.Jit.

Dr.Jit knows whether (`dr.has_backend`), but not why not, and it loads OptiX
when the first ray is cast.

The rules come from drjit-core 1.5 (`src/cuda_core.cpp`, `src/optix_api.cpp`): CUDA 12.2, which
is driver 535, or newer; for OptiX not CUDA 12.7 (drivers 565 to 569, refused as miscompiling);
compute capability 7.5 for the kernels that it ships.
"""

import ctypes
import os
import sys
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Status:
    """Whether something works, and why or why not."""

    works: bool
    reason: str


def cuda_status() -> Status:
    """Return whether Dr.Jit's CUDA backend can work, with the device's name or the reason."""
    # Each step needs the one before: driver, initialisation, version, device, capability.
    cuda = _load("libcuda.so.1", "DRJIT_LIBCUDA_PATH")
    if cuda is None:
        why = (
            "libcuda.so.1 cannot be loaded"
            if sys.platform == "linux"
            else "it is looked for on Linux alone"
        )
        return Status(False, f"no NVIDIA driver: {why}")
    error = cuda.cuInit(0)
    if error:
        return Status(
            False, f"cuInit fails with error {error}" + (": no device" if error == 100 else "")
        )
    version = _cuda_version(cuda)
    if version < (12, 2):
        return Status(
            False, f"driver too old: CUDA {_dotted(version)}, 12.2 (driver 535) or newer is needed"
        )
    count = ctypes.c_int()
    if cuda.cuDeviceGetCount(ctypes.byref(count)) or not count.value:
        return Status(False, "no device")
    device, name, numbers = (
        ctypes.c_int(),
        ctypes.create_string_buffer(256),
        (ctypes.c_int(), ctypes.c_int()),
    )
    failed = cuda.cuDeviceGet(ctypes.byref(device), 0)
    failed = failed or cuda.cuDeviceGetName(name, 256, device)
    # CU_DEVICE_ATTRIBUTE_COMPUTE_CAPABILITY_MAJOR and _MINOR.
    for number, attribute in zip(numbers, (75, 76)):
        failed = failed or cuda.cuDeviceGetAttribute(ctypes.byref(number), attribute, device)
    if failed:
        return Status(False, f"the device does not answer: error {failed}")
    capability = (numbers[0].value, numbers[1].value)
    words = f"{name.value.decode(errors='replace')}, compute capability {_dotted(capability)}, CUDA {_dotted(version)}"
    if capability < (7, 5):
        return Status(False, f"{words}: compute capability 7.5 or newer is needed")
    return Status(True, words + _driver())


def optix_status() -> Status:
    """Return whether OptiX, which casts the rays on a GPU, can work, with the reason."""
    cuda = _load("libcuda.so.1", "DRJIT_LIBCUDA_PATH")
    if cuda is None:
        return Status(False, "no NVIDIA driver")
    if _cuda_version(cuda) == (12, 7):
        return Status(
            False, "Dr.Jit refuses drivers 565 to 569, they miscompile: use an older or a newer one"
        )
    optix = _load("libnvoptix.so.1", "DRJIT_LIBOPTIX_PATH")
    if optix is None:
        return Status(
            False,
            "libnvoptix.so.1 cannot be loaded: install the graphics part of the driver "
            "(libnvidia-gl-<version>), in a "
            "container ask for the driver capability `graphics`",
        )
    if not hasattr(optix, "optixQueryFunctionTable"):
        return Status(False, "libnvoptix.so.1 has no optixQueryFunctionTable")
    return Status(True, "libnvoptix.so.1 can be loaded")


def _load(name: str, variable: str) -> ctypes.CDLL | None:
    if sys.platform != "linux":
        return None
    try:
        return ctypes.CDLL(os.environ.get(variable) or name)
    except OSError:
        return None


def _cuda_version(cuda: ctypes.CDLL) -> tuple[int, int]:
    number = ctypes.c_int()
    cuda.cuDriverGetVersion(ctypes.byref(number))
    return number.value // 1000, number.value % 1000 // 10


def _driver() -> str:
    try:
        return f", driver {Path('/sys/module/nvidia/version').read_text().strip()}"
    except OSError:
        return ""


def _dotted(numbers: tuple[int, int]) -> str:
    return f"{numbers[0]}.{numbers[1]}"
