# SPDX-License-Identifier: BSD-3-Clause
"""The only place that sees both sides: scenes, metrics, statistics, and the studies of speed and error."""
