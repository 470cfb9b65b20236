"""The measuring path of live and replay, and the state of a run.

``reference`` prepares a kernel, ``measure`` measures burst after burst into ``measurement``, ``history`` keeps the
means in ``columns``. ``run_state`` joins ``event_log``, ``frame_counts``, health and alarms; ``snapshot`` is the state
that displays show. ``queues`` connect threads, ``latency`` monitors the measurement, and ``consumer`` is the contract
of all that take measurements.
"""
