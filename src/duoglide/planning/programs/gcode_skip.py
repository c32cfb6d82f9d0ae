"""Skips the words of slicers and CAM systems that the user has named."""

from __future__ import annotations

import re

from duoglide.errors import InputError
from duoglide.planning.programs.gcode_words import Block, split_words
from duoglide.planning.programs.notes import ProgramNotes

_PRINTERS = 200.0  # M words from here on are those of 3D printers only, X and all
_TEXTS = re.compile(r"[Mm] *(0*(?:16|23|32|115|117|118|486)|0*862\.\d)(?![0-9.])")
_FLAGS = re.compile(r"[Mm] *([0-9]{1,4}(?:\.[0-9])?)(?:[ \t]+[A-Za-z])+")  # M84 X Y E: no places
_PLACES = "XYZIJKF"  # R alone is no arc: it needs an end


def read_block(code: str, notes: ProgramNotes) -> Block:
    """Split a line into words, without those that are to be skipped.

    A line that holds a skipped M word, no G word and no other M word belongs to that word:
    ``M104 S200``, ``T1 M6``. In all other lines only the words that are named are skipped.

    Raises:
        InputError: Words that cannot be read, or of which nobody can say whose they are.
    """
    text = _TEXTS.match(code) or _FLAGS.fullmatch(code)
    if text is not None and notes.skip(f"M{float(text[1]):g}"):
        return Block()  # what follows is a text for a display, the name of a file, or motors
    block = split_words(code)
    if not notes.names:
        return block
    _skip_origin(block, notes)
    skipped = [m for m in block.ms if notes.skip(f"M{m:g}")]
    if skipped and not block.gs and len(skipped) == len(block.ms):
        _require_parameters(block, skipped[0])
        return Block()
    block.ms = [m for m in block.ms if f"M{m:g}" not in notes.names]
    block.gs = [g for g in block.gs if not (f"G{g:g}" in notes.names and notes.skip(f"G{g:g}"))]
    for letter in [letter for letter in block.words if letter in notes.names]:
        if letter in block.glued:
            raise InputError(
                f"{block.glued[letter]} right after a number may be an exponent; put a blank before"
                f" {letter}"
            )
        notes.skip(letter)
        del block.words[letter]
    return block


def _skip_origin(block: Block, notes: ProgramNotes) -> None:
    """Skip ``G92 E0``, which sets the extruder's count, and never an origin of the axes."""
    if 92.0 not in block.gs or not {"G92", "E"} & notes.names:
        return
    if set(block.words) != {"E"}:
        raise InputError(
            f"G92 {' '.join(block.words) or 'alone'} moves the origin: it is not skipped; G92 E is"
        )
    notes.skip("G92" if "G92" in notes.names else "E")
    block.gs.remove(92.0)
    block.words.clear()


def _require_parameters(block: Block, m: float) -> None:
    """Refuse a line in which a place may belong to the skipped word, or may be a move."""
    places = [letter for letter in block.words if letter in _PLACES]
    for_printers = m >= _PRINTERS and block.order[0] == f"M{m:g}"
    if places and not for_printers:
        raise InputError(
            f"{', '.join(places)}: it may belong to M{m:g}, which is skipped, or be a move; put it"
            " on a line of its own, or delete it"
        )
