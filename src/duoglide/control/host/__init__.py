"""The user's process: the machine as one robot, its runs, what they were like, and their log.

``robot`` is what a user holds; ``drivetrain`` switches, homes and resets its drives over
``connection``, which starts the streamer (``process``) and reads what it tells (``monitor``). A
trajectory is judged (``fitness``), prepared (``prepare``) and run (``handle``); ``happenings`` puts
events into words, ``report`` and ``history`` sum a run up, ``run_log`` writes it down.
``commission`` is for the first hours of a machine.
"""
