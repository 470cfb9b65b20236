"""A run in the formats of other programs.

``formats`` lists them and runs a ``job``. Text, arrays and the metadata of the experiment: ``tables``; pictures,
ImageJ and ParaView: ``maps``.
"""
