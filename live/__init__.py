"""The program: configuration, devices, the measuring pipeline, results and displays."""

import os

VERSION = "1.0.0rc1"  # stands here alone; CITATION.cff and CHANGELOG.md are compared with it

# Read when numpy is loaded. Its matrices are small: a second thread of OpenBLAS mostly spins, and keeps the camera
# and the recording from their cores. Preparing a reference of 5 megapixels took 2.2 s of processor time, now 1.0.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
