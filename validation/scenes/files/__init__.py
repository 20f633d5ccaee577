# SPDX-License-Identifier: BSD-3-Clause
"""Scene files as people write them, made into what both readers take, once for every command.

Mitsuba's parser gives nodes before anything is built. Here old media get extinction and albedo,
instances are written out, lamps on flat quads become rectangles, and redundant references to media
are left out; features that no command can take are refused in Mitsuba's own words. Changes are
reported in notes, as warnings in Mitsuba's log.

Read in this order:

- `text.py`: what is no scene, before Mitsuba reads it;
- `nodes.py`: the nodes of a parsed file;
- `media.py`: extinction and albedo from what old files have;
- `grids.py`: grids of OpenVDB as grids of Mitsuba;
- `shapes.py`: instances written out, lamps on quads as rectangles, rooms of fog as boxes;
- `camera.py`: what no camera may be, and what its clip planes cut from Mitsuba's images;
- `references.py`: media that opaque shapes reference;
- `advice.py`: files and colours that are refused by name, and what to do about Mitsuba's refusals;
- `read.py`: a file made into a scene; what no command takes is refused by name.
"""
