# SPDX-License-Identifier: BSD-3-Clause
"""The command line, the error report, figures and tables for papers."""

__version__ = "0.1.0"
