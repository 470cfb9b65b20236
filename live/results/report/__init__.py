"""The report of a run, or of several: one HTML file that loads nothing else.

``report`` lists the sections: ``evaluation``, ``curves``, ``maps``, ``record`` (frame counts, events,
hashes, table of the iDICs guide). ``several`` compares tests, and joins the cameras of one. ``svg`` draws
curves, ``page`` makes HTML, ``saving`` writes the files.
"""
