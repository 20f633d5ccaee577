# SPDX-License-Identifier: BSD-3-Clause
"""report.json: what stands in it, and how it is read and checked.

Read in this order:

- `records.py`: the records whose fields are its keys, with units and meanings; reading and writing
"""
