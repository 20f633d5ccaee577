# SPDX-License-Identifier: BSD-3-Clause
"""Properties of a scene (`properties.py`), from how far rays go and what
lights reach (`view.py`).
"""
