# SPDX-License-Identifier: BSD-3-Clause
"""Published methods as their papers have them: with their orders, buffers and misprints,
to judge what they claim.

Nothing else imports this room. The exact form of a method has a room of its own.

Read in this order:

- `biri2006/`: shadow planes, drawn one by one with a stencil.
- `billeter2010/`: light volumes as meshes, drawn triangle by triangle.
- `bouthors2008.py`: clouds with slabs along the light, half the density, and two misprints.
"""
