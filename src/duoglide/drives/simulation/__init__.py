"""Simulated drives: what a linear-axis drive would be, down to its plant, on any bus.

``firmware`` is a drive's application (with ``firmware_objects``, ``firmware_status``,
``firmware_homing``, ``demand`` and ``watchdogs``; ``application`` says what one has to be),
``plant`` what hangs on it, ``node`` its place on the bus (with ``node_objects``, ``node_memory``,
``node_pdo`` and ``sdo_server``), ``rack`` three of them and their clock, ``hub`` the loopback bus,
``process`` runs them, ``faults`` makes things go wrong, ``scenario`` says which and when.
"""
