"""The quality of a picture or a series before a test.

``exposure`` judges light and bits, ``steadiness`` a series, ``pattern`` the speckle of each ZOI; ``specimen`` finds
the speckled specimen and plates beside it.
"""
