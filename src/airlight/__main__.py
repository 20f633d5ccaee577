# SPDX-License-Identifier: BSD-3-Clause
"""`python -m airlight`: the command."""

from airlight.reports.commands.start import main

main()
