# SPDX-License-Identifier: BSD-3-Clause
"""Examine the machine: every part that a kernel needs, then a kernel itself, in a process of its own.

A process of its own, because what can go wrong there ends the process: a libLLVM that aborts, a driver that crashes.
"""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

from reports.machine.environment import (
    VARIANT_VARIABLE,
    MissingError,
    atomic_problem,
    prepare,
    processor,
    threads,
    versions,
)
from reports.machine.gpu import cuda_status, optix_status
from reports.machine.llvm import find_llvm

_PATIENCE = 180.0  # seconds for the first kernel; the first one on a GPU compiles OptiX's own


def diagnose() -> dict[str, Any]:
    """Examine this machine.

    Returns
    -------
    dict
        JSON-ready. ``works`` says whether kernels run here, ``problem`` what is wrong and what to do (None if nothing),
        ``variant`` what was chosen and ``kernel`` what the test kernel found: the libLLVM that it really loaded, its
        threads and the shadow-ray epsilon.

    Raises
    ------
    InputError
        If ``AIRLIGHT_VARIANT`` (or ``--variant``) names no variant.
    """
    import platform

    libraries = find_llvm()
    cuda, optix, atomic = cuda_status(), optix_status(), atomic_problem()
    variant, used, problem, kernel = None, None, None, None
    try:
        prepared = prepare()
        variant, used = prepared.variant, prepared.llvm.path if prepared.llvm else None
        kernel = try_kernel(variant)
        problem = kernel.pop("problem", None)
    except MissingError as error:
        problem = str(error)
    return {
        "works": problem is None,
        "problem": problem,
        "versions": versions(),
        "platform": platform.platform(),
        "python": sys.executable,
        "processor": processor(),
        "threads": threads(),
        "llvm": [
            {
                "path": llvm.path,
                "version": None if llvm.version is None else ".".join(map(str, llvm.version)),
                "works": llvm.works,
                "reason": llvm.reason,
                "used": llvm.path == used,
            }
            for llvm in libraries
        ],
        "libatomic": {"works": not atomic, "reason": atomic or "can be loaded"},
        "cuda": {"works": cuda.works, "reason": cuda.reason},
        "optix": {"works": optix.works, "reason": optix.reason},
        "variant": variant,
        "kernel": kernel,
    }


def try_kernel(variant: str, patience: float = _PATIENCE) -> dict[str, Any]:
    """Run a kernel in a process of its own (`reports.machine.probe`) and return what it found, or its ``problem``."""
    root = str(Path(__file__).resolve().parents[2])
    paths = os.pathsep.join([root, *filter(None, [os.environ.get("PYTHONPATH")])])
    environment = os.environ | {VARIANT_VARIABLE: variant, "PYTHONPATH": paths}
    command = [sys.executable, "-m", "reports.machine.probe"]
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


def print_diagnosis(diagnosis: dict[str, Any]) -> None:
    """Print a diagnosis as a table, plain where piped."""
    from reports.tables.table import table, words
    from reports.tables.terminal import print_table

    kernel = diagnosis["kernel"] or {}
    rows = [
        ("Python", "yes", f"{diagnosis['versions']['python']}, {diagnosis['python']}"),
        ("platform", "", f"{diagnosis['platform']}, {diagnosis['processor']}, {diagnosis['threads']} threads"),
    ]
    rows += [
        (name, "no" if version == "missing" else "yes", version)
        for name, version in diagnosis["versions"].items()
        if name != "python"
    ]
    for llvm in diagnosis["llvm"]:
        used = ", used" if llvm["used"] else ""
        rows.append((f"LLVM {llvm['version'] or '?'}", _yes(llvm["works"]), f"{llvm['path']}: {llvm['reason']}{used}"))
    if not diagnosis["llvm"]:
        rows.append(("LLVM", "no", "none found"))
    for key, name in {"libatomic": "libatomic.so.1", "cuda": "CUDA", "optix": "OptiX"}.items():
        rows.append((name, _yes(diagnosis[key]["works"]), diagnosis[key]["reason"]))
    rows.append(("variant", _yes(diagnosis["variant"] is not None), diagnosis["variant"] or "none works"))
    if "epsilon" in kernel:
        loaded = f"; loaded {kernel['library']}" if kernel["library"] else ""
        rows.append(("test kernel", "yes", f"ran in {kernel['seconds']:.1f} s on {kernel['threads']} threads{loaded}"))
        rows.append(("shadow-ray epsilon", "", f"{kernel['epsilon']:.4g}, relative; measured"))
    elif diagnosis["variant"]:
        rows.append(("test kernel", "no", "failed"))
    print_table(table("", words("what", "works", "details"), rows))
    print("Everything that airlight needs works." if diagnosis["works"] else f"Not ready: {diagnosis['problem']}")


def _yes(works: bool) -> str:
    return "yes" if works else "no"
