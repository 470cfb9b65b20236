"""The view in rerun, drawn by a process of its own.

``consumer`` takes what a test gives, ``view`` and ``outbox`` make ``messages`` of it, ``supervisor`` keeps the
process of ``live.ui.rerun.drawing`` alive. rerun is imported only there. ``playback`` shows a finished run.
"""
