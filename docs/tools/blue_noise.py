# SPDX-License-Identifier: BSD-3-Clause
"""Makes the mask of blue noise of the marchers: `python docs/tools/blue_noise.py
realtime/numerics/blue_noise.npy`.

64 x 64 pixels in 16 frames that repeat, by the void-and-cluster method (Ulichney 1993) in space and
time (Wolfe, Morrical, Akenine-Moller, Ramamoorthi 2022): two values are near each other in the same
frame, by exp(-d^2/(2 1.9^2)), or in the same pixel, by exp(-n^2/(2 1.9^2)) for frames n apart, and
nowhere else. Ranks of all values become ranks by frame, so that each frame has each of the 256
levels 16 times: the numbers of a frame are even.
"""

import sys

import numpy as np

FRAMES, SIDE, WIDTH, SEED = 16, 64, 1.9, 20261127


def energies(count: int) -> np.ndarray:
    """Return the energy of values by their distance on a circle of `count` places."""
    distance = np.minimum(np.arange(count), count - np.arange(count))
    return np.exp(-(distance**2) / (2 * WIDTH**2))


class Field:
    """Which values are set, and the energy of all places."""

    def __init__(self) -> None:
        self.set = np.zeros((FRAMES, SIDE, SIDE), dtype=bool)
        self.energy = np.zeros((FRAMES, SIDE, SIDE))
        row = energies(SIDE)
        self.in_frame, self.in_pixel = np.outer(row, row), energies(FRAMES)

    def change(self, place: int, sign: int) -> None:
        """Set a value, or take it away."""
        n, y, x = np.unravel_index(place, self.set.shape)
        self.set[n, y, x] = sign > 0
        self.energy[n] += sign * np.roll(self.in_frame, (y, x), (0, 1))
        self.energy[:, y, x] += sign * np.roll(self.in_pixel, n)

    def cluster(self) -> int:
        """Return the set value with the most energy."""
        return int(np.argmax(np.where(self.set, self.energy, -np.inf)))

    def void(self) -> int:
        """Return the place without a value that has the least energy."""
        return int(np.argmin(np.where(self.set, np.inf, self.energy)))


def ranks() -> np.ndarray:
    """Return in which order values are set, (FRAMES, SIDE, SIDE)."""
    field, rng = Field(), np.random.default_rng(SEED)
    first = field.set.size // 10
    for place in rng.permutation(field.set.size)[:first]:
        field.change(int(place), 1)
    while True:  # until the tightest cluster is the largest void
        cluster = field.cluster()
        field.change(cluster, -1)
        void = field.void()
        field.change(void, 1)
        if void == cluster:
            break
    order = np.zeros(field.set.size, dtype=int)
    start = Field()
    start.set, start.energy = field.set.copy(), field.energy.copy()
    for rank in range(first - 1, -1, -1):
        place = field.cluster()
        field.change(place, -1)
        order[place] = rank
    for rank in range(first, order.size):
        place = start.void()
        start.change(place, 1)
        order[place] = rank
    return order.reshape(field.set.shape)


def main(path: str) -> None:
    """Write the mask, uint8 of shape (FRAMES, SIDE, SIDE)."""
    by_frame = np.argsort(np.argsort(ranks().reshape(FRAMES, -1), axis=1), axis=1)
    np.save(path, (by_frame * 256 // SIDE**2).astype(np.uint8).reshape(FRAMES, SIDE, SIDE))


if __name__ == "__main__":
    main(sys.argv[1])
