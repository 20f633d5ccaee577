# SPDX-License-Identifier: BSD-3-Clause
"""Files of certified values: twelve scenes of fog to 12 digits for any
renderer, and airlight integrals.

The programs that computed them are evidence (`tests/evidence/certified` of the
source); here are the values.

Read in this order:

- `files.py`: which files there are, what each holds, and where it is.
"""
