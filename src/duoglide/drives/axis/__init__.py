"""One drive, as the host sees it over SDO: its objects, its units, its bring-up, its states."""
