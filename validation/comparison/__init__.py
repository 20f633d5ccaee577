# SPDX-License-Identifier: BSD-3-Clause
"""Image files against each other (`images.py`), and what `airlight compare` prints."""
