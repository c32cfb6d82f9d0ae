"""Linear-axis drives over CANopen (CiA 301, CiA 402), real and simulated.

The host's side: ``buses`` opens a bus by name, ``alone`` sees that no other host is on it,
``listen`` hears what is said there without a word of its own,
``axis`` brings one drive up over SDO (with ``configure``, ``drive_objects``, ``sdo_client`` and
``scale`` under it), ``pdo`` packs the frames of the cycle, ``cia402`` knows states, words and
codes.

The drives' side: ``firmware`` is a drive's application, ``plant`` what hangs on it, ``node`` its
place on the bus, ``rack`` three of them and their clock, ``hub`` the loopback bus, ``simulated``
and ``process`` run them, ``faults`` makes things go wrong, ``scenario`` says which and when.

``firmware_interface/README.md`` says in words what both sides hold to.
"""
