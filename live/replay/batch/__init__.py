"""Many tests replayed by worker processes or a Dask cluster.

``test_list`` finds the tests, ``scheduler`` sorts tasks and cuts long sessions into chunks,
``worker_processes`` and ``cluster`` run a ``worker``, ``task`` is one replay, ``row`` its line in the table,
``campaign`` joins all.
"""
