"""The program: configuration, devices, the measuring pipeline, results and displays."""

VERSION = "0.1.0"
