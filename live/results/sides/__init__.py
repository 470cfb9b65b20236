"""Front and back of one specimen: two runs put together, their folders and clocks, and channels while they run."""
