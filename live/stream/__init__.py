"""One stream of records: cameras and load cell publish, and what records, measures and shows takes.

``record`` is what goes through a test, ``stream`` passes it on. ``state_keeper`` fills the state of a camera's run,
``adapted`` runs each ``live.pipeline.consumer.Consumer`` in a thread of its own.
"""
