"""Everything joined: configuration, devices, the measuring pipeline, results and the view."""

VERSION = "0.1.0"
