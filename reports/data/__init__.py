# SPDX-License-Identifier: BSD-3-Clause
"""report.json: what stands in it, and how it is read and checked.

`schema/report-2.json` is its schema in JSON Schema, which says what each key is.

Read in this order:

- `own_faults.py`: what user methods did wrong
- `claims.py`: the sentences at the top, from the numbers
- `reader.py`: reads a report back, checks it, draws its page again
"""
