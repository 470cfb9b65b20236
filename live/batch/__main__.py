"""``python -m live.batch``: one worker of ``pool``."""

import sys

from live.batch.worker import main

if __name__ == "__main__":
    sys.exit(main())
