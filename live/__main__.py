"""``python -m live`` is ``phasedic``, without the modules of the working folder."""

import os
import sys

if __name__ == "__main__":
    # pathlib would be that of the working folder.
    here = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))  # noqa: PTH100, PTH120
    if not sys.flags.safe_path and sys.path[0] != here:
        del sys.path[0]  # the working folder, whose modules are not Python's

    from live.cli import main

    sys.exit(main())
