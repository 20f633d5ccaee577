# SPDX-License-Identifier: BSD-3-Clause
"""The airlight equation in float64: the side of truth, which imports nothing else of the project."""
