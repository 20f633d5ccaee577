# SPDX-License-Identifier: BSD-3-Clause
"""What is wrong with an image: every hypothesis predicts the image that it would make, and the data choose.

Read in this order:

- `prediction.py`: an image, and what a fog, a light, a camera and an encoding make of a scene;
- `hypothesis.py`: what a hypothesis is: a name, a kind, and ways to change a prediction;
- `medium.py`: faults of the medium and of the laws of scattering;
- `lights.py`: faults of lights and shadows;
- `camera.py`: faults of the camera and of the grid of pixels;
- `encoding.py`: faults of the values;
- `search.py`: the parameter with which a hypothesis fits best, alone and with another;
- `verdict.py`: evidence, and which one comes first;
- `diagnose.py`: an image file against a scene;
- `diagnosis_text.py`: what the command prints.
"""
