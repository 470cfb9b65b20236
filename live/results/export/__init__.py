"""A run in the formats of other programs.

``formats`` lists them and runs a ``job``. Text and arrays: ``tables``; ParaView: ``vtk``; ImageJ: ``tiff``;
pictures: ``films``; metadata of the experiment: ``r3xa``.
"""
