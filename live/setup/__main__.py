"""``python -m live.setup PART KINDS PHASE``: one of the processes of ``compiling``."""

import sys

from live.setup.compiling import main

if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
