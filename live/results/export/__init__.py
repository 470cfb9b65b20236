"""A run in the formats of other programs.

``formats`` lists them and runs a ``job``. Text and arrays: ``tables``; ParaView: ``vtk``; ImageJ: ``tiff``;
``films``; ``r3xa``.
"""
