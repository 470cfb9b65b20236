"""``python -m phasedic`` is the command ``phasedic``, without the modules of the working folder."""

import os
import runpy
import sys

if __name__ == "__main__":
    here = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))  # noqa: PTH100, PTH120
    if not sys.flags.safe_path and sys.path[0] != here:
        del sys.path[0]  # the working folder, whose modules are not ours
    runpy.run_module("live", run_name="__main__")
