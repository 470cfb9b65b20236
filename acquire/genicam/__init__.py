"""GigE Vision and USB3 Vision cameras through Aravis, from the C library to the frame.

``library`` has the calls into C, ``device`` one open camera, ``formats`` converts packed bytes to grey levels,
``setup`` sets and reads back, ``finding`` looks for cameras, ``camera`` joins them, ``listing`` lists cameras.
"""
