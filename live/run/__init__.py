"""The live test: cameras, load cell and outputs joined by a stream.

``live_run`` runs it, with a ``camera_run`` for each camera: ``sources`` publish, ``recorder``
records with ``pre_trigger``, ``incoming_bursts`` hands bursts to ``measurer``. ``control`` carries out commands from
the keyboard and ``tcp_lines``. ``alarms`` and ``strain_output`` are consumers. ``outcome`` is how a test ends.
"""
