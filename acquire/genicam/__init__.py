"""GigE Vision and USB3 Vision cameras through Aravis, from the C library to the frame.

``library`` has the calls into C, ``device`` one open camera, ``formats`` converts packed bytes to grey levels,
``setup`` sets and reads back, ``camera`` looks for cameras and joins them.
"""
