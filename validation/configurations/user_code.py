# SPDX-License-Identifier: BSD-3-Clause
"""The source code of a user's own method and kernel, as part of keys: what we ship is not all that decides numbers."""

import time

from realtime.methods.user_method import method_file
from reference.storage.kept import code_digest
from validation.configurations.methods import Configuration


def user_code(chosen: Configuration) -> list[str]:
    """Return digests of the user's own code in a configuration, with the modules of its folder that it imports."""
    return [_digest(name) for name in (chosen.method, chosen.kernel) if name is not None and ":" in name]


def _digest(name: str) -> str:
    file = method_file(name)
    # A function typed into a notebook has no file, so its results cannot be kept.
    return code_digest([file]) if file is not None and file.is_file() else f"no file, {time.time_ns()}"
