"""Motions made in carriage space: from rest to rest, the way out, by hand."""
