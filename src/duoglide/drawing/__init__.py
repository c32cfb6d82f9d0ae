"""How pictures are made: one style, the carriages over time, the section across the rails.

Nothing here is imported before a picture is asked for, because matplotlib takes its time.
"""
