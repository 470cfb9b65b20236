"""Hardware that is not there: one virtual specimen behind a simulated camera and load cell."""
