"""The tests of this folder run through ``make pylon-test`` alone: with pypylon, on the cameras it emulates."""

from __future__ import annotations

import os
import warnings

collect_ignore = [] if os.environ.get("PYLON_CAMEMU") else ["test_pylon.py"]
if not collect_ignore:
    with warnings.catch_warnings():  # its C code does not survive a warning of its own that is an error
        warnings.simplefilter("ignore")
        import pypylon.pylon  # noqa: F401
