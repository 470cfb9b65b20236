"""The view in rerun, drawn by a separate process.

``consumer`` receives the data of a test, ``view`` and ``outbox`` turn them into ``messages``, ``supervisor`` starts
the process ``live.ui.rerun.drawing`` and restarts it. Only that process imports rerun. ``phasedic show``
shows a finished run.
"""
