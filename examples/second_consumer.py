"""A consumer of your own beside results and view: it prints the largest strain of every measurement.

``python second_consumer.py`` runs it on a simulated test of three seconds.
"""

from __future__ import annotations

import sys

from phasedic import Consumer, Measurement, run


class Largest(Consumer):
    """Prints the largest strain of any ZOI; if the terminal is slow, older measurements are skipped."""

    name = "largest strain"
    last = 0.0

    def measurement(self, measurement: Measurement) -> None:
        self.last = measurement.time_step.largest
        print(f"{measurement.number:4}  {self.last * 1e6:+8.0f} um/m")

    def end(self) -> str:
        return f"the last was {self.last * 1e6:+.0f} um/m"


def main(folder: str | None = None) -> int:
    settings = {
        "camera.address": "sim:woven?lockstep=yes&seconds=3&fps=15&width=224&height=192",
        "load.address": "sim:",
        "measure.zoi": 48,
        "view.enabled": False,
        "view.rrd": False,
        "output.dir": folder,
    }
    outcome = run({key: value for key, value in settings.items() if value is not None}, [Largest()])
    for report in outcome.outputs.reports:
        print(report.line())
    return outcome.exit_code


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:2]))
