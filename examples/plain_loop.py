"""A live test as a plain loop: ``python plain_loop.py`` ends a simulated test when the strain is reached."""

from __future__ import annotations

import sys

from phasedic import measurements

SETTINGS = {
    "camera.address": "sim:uniform?seconds=20&fps=15&width=224&height=192",
    "load.address": "sim:",
    "measure.zoi": 48,
    "view.enabled": False,
    "view.rrd": False,
}


def main(until: float = 1e-3) -> int:
    """Print strain and force as they come; return how many there were."""
    count = 0
    for count, measurement in enumerate(measurements(SETTINGS), 1):  # noqa: B007 (the last is returned)
        step = measurement.time_step
        print(f"{step.eyy * 1e6:+8.0f} +- {step.sigma_eyy * 1e6:.0f} um/m")
        if step.eyy > until:
            break
    return count


if __name__ == "__main__":
    sys.exit(main() == 0)
