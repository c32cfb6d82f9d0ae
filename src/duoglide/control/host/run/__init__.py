"""One run: whether it may be, what is prepared for it, its handle, its report and its log."""
