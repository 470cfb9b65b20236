"""What a test and the process of its view say to each other: ``messages`` over a ``wire``, of a ``setup`` first.

``thinned`` is a bounded history, for both of them.
"""
