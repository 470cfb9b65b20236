"""Many tests replayed by worker processes or a Dask cluster.

``test_list`` finds the tests, ``scheduler`` cuts long sessions into chunks and gives tasks to the ``worker``
processes of this machine or to a ``cluster``, ``task`` is one replay, ``row`` its line in the table, ``campaign``
joins all.
"""
