"""The exit codes and their meanings."""

from __future__ import annotations

LOSS, NOT_READY, EXIT_INTERRUPTED = 5, 6, 130

EXIT_CODES = """exit codes:
  0 success   1 a defect of phasedic   2 usage or configuration   3 device   4 file or data
  5 finished with loss, or nothing measured   6 not ready (check, self-test)   130 interrupted, closed cleanly
"""

EXIT_WORDS = {
    1: "a defect of phasedic, see the log",
    3: "the camera was lost before the end",
    5: "finished with loss or nothing measured; summary, frame counts and events show what is missing",
    130: "interrupted; everything was closed cleanly",
}
