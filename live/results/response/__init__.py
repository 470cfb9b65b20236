"""What each place did over all instants of a test: ``stored`` in strain.h5, made by ``evaluate``, told by ``words``."""
