"""Replay of a recording, or any folder of pictures, through the measuring path of a live run.

``replay`` runs it. ``opening`` (of a session) and ``pictures`` make a ``source`` (reference, bursts, loads),
``burst_index`` finds the bursts of a session, ``forces`` reads loads from CSV, ``parts`` cuts a long session.
``study`` compares settings on one test.
"""
