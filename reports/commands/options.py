# SPDX-License-Identifier: BSD-3-Clause
"""Options that several commands have."""

from typing import Annotated

import typer

from reports.machine.own_process import LIMIT

Force = Annotated[
    bool, typer.Option("--force", help="Start also what will take more than an hour, or more memory than there is.")
]
MethodLimit = Annotated[
    float, typer.Option("--method-limit", help="Your own method is stopped after so long in a scene [s].")
]
USUAL_LIMIT = LIMIT
