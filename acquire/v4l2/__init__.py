"""Cameras of Linux, from the ioctl to the frame.

``api`` has structures and calls, ``device`` the buffers of a node, ``formats`` converts bytes to grey levels,
``controls`` sets and reads back, ``camera`` sets up and joins them, ``listing`` lists cameras and says why one fails.
"""
