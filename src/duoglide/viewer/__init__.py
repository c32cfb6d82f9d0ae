"""Pictures and the live page."""
