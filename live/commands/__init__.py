"""The commands, one file each; ``arguments`` lists them, ``options`` says the keys of the configuration."""
