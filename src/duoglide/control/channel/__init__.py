"""All that crosses between the two processes: values, and the memory and sockets that carry them.

From host to streamer: ``orders`` (what it is told) and ``setpoints`` (a prepared trajectory), each
on a socket. From streamer to host: ``events`` (what has happened) and every cycle, in the shared
memory of ``ring``. ``scale`` turns carriages into increments for both.
"""
