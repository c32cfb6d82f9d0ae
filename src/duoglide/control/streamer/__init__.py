"""The real-time process: ``python -m duoglide.control.streamer``, which ``host.process`` starts.

``clock`` says when cycles begin, ``cycle`` is one of them: ``wire`` sends and listens on a ``link``
to the bus, ``tracks`` keep what each drive has said, ``supervise`` decides when and how to stop,
``follower`` takes the next setpoint, ``power`` the controlwords. ``realtime`` asks the kernel for
as little disturbance as it grants.
"""
