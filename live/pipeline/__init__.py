"""The measuring path of live and replay, and the state of a run.

``reference`` prepares a kernel, ``measure`` measures burst after burst, ``measurement`` is what comes out,
``history`` keeps it. ``run_state`` joins ``event_log``, ``frame_counts``, health and alarms; ``snapshot`` is
the state that displays show. ``queues`` connect threads, ``latency`` is monitored, ``consumer`` is the contract
of whatever takes measurements and ``consumer_thread`` runs one.
"""
