"""Protocols of load cells and indicators: bytes to readings, commands to bytes.

Pure: no ports, threads or clock; ``acquire.serial_line`` drives them. One module a protocol; ``base`` is the
contract, finds a protocol by name, and has units of force and mass.
"""
