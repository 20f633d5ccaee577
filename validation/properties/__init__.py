# SPDX-License-Identifier: BSD-3-Clause
"""Properties of a scene (`properties.py`), from what the camera sees and lights reach (`view.py`)."""
