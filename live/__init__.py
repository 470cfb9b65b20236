"""The program: configuration, devices, the measuring pipeline, results and displays."""

VERSION = "1.0.0rc1"  # stands here alone; CITATION.cff and CHANGELOG.md are compared with it
