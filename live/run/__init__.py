"""The test: devices, threads and consumers joined.

``live_run`` runs it: ``grabber``, ``burst_queue``, ``measuring``, ``load_thread``. ``recorder`` records, with
``pre_trigger``. ``control`` carries out commands from ``keyboard`` and ``tcp_lines``. ``alarms`` and
``strain_output`` are consumers.
"""
