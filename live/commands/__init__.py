"""The commands, one file each; ``arguments`` is what can be said, ``overrides`` what it sets."""
