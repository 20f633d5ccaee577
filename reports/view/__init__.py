# SPDX-License-Identifier: BSD-3-Clause
"""The live view of a scene in the browser: `airlight view`.

Read in this order:

- `state.py`: what is shown, and the commands that show it again;
- `widgets.py`: what the page can change, from the records of methods, kernels and the scene;
- `stages.py`: the stages of a frame, each timed;
- `live_scene.py`: a scene of which camera, lights, media, method and parameters change from frame to frame;
- `picture.py`: frames as pictures, on the device;
- `reference_order.py`: in which order the reference of an image is computed, and what is known of it;
- `reference_process.py`: the process that computes it while the view is idle;
- `reference.py`: the reference of what is shown, and the error of the method against it;
- `session.py`: the loop that draws what the page asks for;
- `server.py`: the page and its socket, for anyone who knows the token.

`page/` holds the page.
"""
