# SPDX-License-Identifier: BSD-3-Clause
"""Checks that need no reference: two to four frames whose ratio, difference or sum is known.

- `relations.py`: the relations, and what each expects of its frames;
- `judge.py`: whether frames keep a relation, against the floor of the same frame twice;
- `check_file.py`: check.json, which names the frames of somebody's renderer;
- `changes.py`, `variants.py`: changed scenes whose frames are related.
"""
