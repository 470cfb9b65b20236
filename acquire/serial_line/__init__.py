"""A load cell on a serial port, or behind any URL of pyserial.

``cell`` is the stream of samples, ``settings`` its address, ``link`` opens the port again after a loss,
``byte_ports`` are ports as bytes, ``scaling`` converts to newtons and tares, ``arrivals`` stamps samples,
``ports`` lists what is plugged in, ``identify`` finds the protocol of a port.
"""
