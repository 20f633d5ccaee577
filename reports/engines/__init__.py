# SPDX-License-Identifier: BSD-3-Clause
"""Engines of others in scenes of ours: each image judged by physics and by the engine's own
equation.

`record.py` has the data of engines.json, `measure.py` judges the images, `tables.py` says the
numbers in rows and sentences, and `page.py` draws the page and the strip.
"""
