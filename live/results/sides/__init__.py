"""Front and back of one specimen: ``together`` puts two runs together, ``folder`` has where they are, and clocks."""
