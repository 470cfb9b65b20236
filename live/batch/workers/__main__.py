"""``python -m live.batch.workers``: one worker of ``pool``."""

import sys

from live.batch.workers.worker import main

if __name__ == "__main__":
    sys.exit(main())
