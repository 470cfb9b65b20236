"""Is the picture good enough, before the specimen is pulled? ``check`` takes a burst, ``judge`` judges it."""
