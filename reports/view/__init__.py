# SPDX-License-Identifier: BSD-3-Clause
"""The live view of a scene in the browser: `airlight view`.

Read in this order:

- `widgets.py`: what the page can change, from typed records, and the commands that show it again;
- `live_scene.py`: a scene that changes from frame to frame, and the stages of a frame, timed;
- `picture.py`: frames as pictures, on the device;
- `reference.py`: the reference of what is shown, computed by a process while the
  view is idle, and the error;
- `session.py`: the loop that draws what the page asks for;
- `server.py`: the page and its socket, for anyone who knows the token.

`page/` holds the page.
"""
