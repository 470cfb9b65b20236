"""``python -m tests.bench.unpack``: time to unpack 5 MP of each GenICam format, in ratio to the plain copy of Mono12.

The formats are taken in turn, each several times since the first has its memory to find, and the shortest time of each
counts, so that other work on the machine matters little.
"""

from __future__ import annotations

import time

import numpy as np

from acquire.genicam.formats import FORMATS, MonoFormat, decode
from tests.bench import machine

WIDTH, HEIGHT, ROUNDS, TIMES, PADDING = 2448, 2048, 20, 4, 8


def took_s(content: bytes, pixel_format: MonoFormat, padding: int) -> float:
    """Seconds for one picture."""
    begun = time.perf_counter()
    decode(content, pixel_format, WIDTH, HEIGHT, padding)
    return time.perf_counter() - begun


def main() -> None:
    """A line a format, then those with padding after each row."""
    rng, cases = np.random.default_rng(0), {}
    best: dict[str, float] = {}
    for name, one in FORMATS.items():
        cases[name] = rng.bytes(one.size(WIDTH * HEIGHT)), one, 0
        cases[f"{name}, padded"] = rng.bytes((one.size(WIDTH) + PADDING) * HEIGHT), one, PADDING
    for _ in range(ROUNDS):
        for name, case in cases.items():
            best[name] = min(best.get(name, np.inf), *(took_s(*case) for _ in range(TIMES)))
    print(machine.describe())
    for name, seconds in best.items():
        print(
            f"{name:22} {seconds * 1e3:6.2f} ms, {seconds / best['Mono12']:5.2f} times the plain copy of Mono12"
        )


if __name__ == "__main__":
    main()
