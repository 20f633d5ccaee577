# SPDX-License-Identifier: BSD-3-Clause
"""`volpath`: Mitsuba's volumetric path tracer as a check by code that nobody here wrote.

Read in this order:

- `integrator.py`: runs it in batches, airlight and surface apart;
- `orders.py`: clouds by order of scattering.
"""
