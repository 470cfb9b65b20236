"""Cameras of Linux, from the ioctl to the frame.

``api`` has structures and calls, ``device`` the buffers of a node, ``formats`` converts bytes to grey levels,
``controls`` sets and reads back, ``faults`` classifies failures and counts lost frames, ``camera`` sets up
and joins them, ``listing`` lists cameras.
"""
