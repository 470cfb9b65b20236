"""The live test: devices, threads and consumers joined.

``live_run`` runs it with the threads of ``grabber``, ``measuring`` and ``load_thread``, joined by ``burst_queue``.
``recorder`` records, with ``pre_trigger``. ``control`` carries out commands from ``keyboard`` and ``tcp_lines``.
``alarms`` and ``strain_output`` are consumers. ``outcome`` is how a run ends.
"""
