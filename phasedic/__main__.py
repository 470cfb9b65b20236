"""``python -m phasedic`` is the command ``phasedic``."""

import sys

from phasedic import main

if __name__ == "__main__":
    sys.exit(main())
