"""The running machine, in two processes.

``host`` runs in the user's process: ``Robot``, handles, reports, the log. ``streamer`` runs in the
real-time process: the cycle, supervision, how a run follows its path. They import nothing of each
other; all that crosses between them is in ``channel``.
"""
