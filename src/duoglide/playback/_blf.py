"""Whether a BLF file is whole. python-can's reader takes a torn one for a shorter one.

It also unpacks a container whatever size it grows to, and does not come back from an object of no
size. What a frame says is left to it.
"""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Iterator
from typing import IO

from duoglide.errors import LogError

_HEAD = struct.Struct("<4sL8xQ")  # signature, size of the head, size of the file
_HEAD_SIZES = range(72, 1024)
_OBJECT = struct.Struct("<4sHHLL")  # signature, head's size and version, object's size and type
_CONTAINER = struct.Struct("<H6xL4x")  # compression, size of the content
_CONTAINER_TYPE = 10
_FRAMES = {1: 48, 86: 48, 73: 60, 100: 112, 101: 72}  # types that hold a frame: their least size
_LARGEST = 64 * 1024 * 1024  # bytes of a container; they usually have 128 kB
_VERSIONS = (1, 2)
_PLAIN, _DEFLATED = 0, 2


def require_whole(file: IO[bytes]) -> int:
    """Return how many frames a BLF file holds.

    Raises:
        LogError: It is none, it is cut, or python-can would leave out some of it.
    """
    size = file.seek(0, os.SEEK_END)
    file.seek(0)
    head = file.read(_HEAD.size)
    if len(head) < _HEAD.size or head[:4] != b"LOGG":
        raise LogError("it is no BLF file (it does not begin with LOGG)")
    _, start, told = _HEAD.unpack(head)
    if start not in _HEAD_SIZES or start > size:
        raise LogError("its head is damaged")
    if told not in (0, size):  # 0: the writer did not come to its end
        raise LogError(f"it says that it has {told} bytes, and has {size}: it is cut or damaged")
    frames = 0
    rest = b""
    for content in _containers(file, start, size):
        rest += content
        found, done = _walk(rest)
        frames += found
        rest = rest[done:]
    if rest.strip(b"\0"):
        raise LogError("it ends within an object: it is cut")
    return frames


def _containers(file: IO[bytes], offset: int, size: int) -> Iterator[bytes]:
    """Yield the content of one container after another."""
    while offset < size:
        file.seek(offset)
        head = file.read(_OBJECT.size)
        if len(head) < _OBJECT.size:
            if head.strip(b"\0"):
                raise LogError("it ends within an object: it is cut")
            return
        signature, _, _, length, kind = _OBJECT.unpack(head)
        if signature != b"LOBJ" or length < _OBJECT.size:
            raise LogError(f"there is no object at byte {offset}: it is damaged")
        if offset + length > size:
            raise LogError("it ends within an object: it is cut")
        if kind in _FRAMES:
            raise LogError("it holds frames outside of containers, which are not read")
        if kind == _CONTAINER_TYPE:
            yield _unpacked(file.read(length - _OBJECT.size))
        offset += length + length % 4


def _unpacked(data: bytes) -> bytes:
    """Return the content of a container."""
    if len(data) < _CONTAINER.size:
        raise LogError("it has a container without a head: it is damaged")
    method, size = _CONTAINER.unpack_from(data)
    content = data[_CONTAINER.size :]
    if size > _LARGEST:
        raise LogError(f"it has a container of {size} bytes; at most {_LARGEST} are unpacked")
    if method == _DEFLATED:
        inflater = zlib.decompressobj()
        try:
            content = inflater.decompress(content, size + 1)
        except zlib.error as error:
            raise LogError(f"it has a container that is damaged: {error}") from error
        if not inflater.eof:
            raise LogError("it has a container that is cut")
    elif method != _PLAIN:
        raise LogError(f"it has a container of compression {method}, which is not read")
    if len(content) != size:
        raise LogError("it has a container of another size than it says")
    return content


def _walk(data: bytes) -> tuple[int, int]:
    """Count the frames in some objects; return also where the last whole object ends."""
    frames = offset = 0
    while True:
        start = data.find(b"LOBJ", offset, offset + 8)  # objects are padded
        if start < 0:
            if offset + 8 <= len(data):
                raise LogError("an object of it is damaged")
            return frames, offset
        if start + _OBJECT.size > len(data):
            return frames, offset
        _, _, version, length, kind = _OBJECT.unpack_from(data, start)
        if length < _FRAMES.get(kind, _OBJECT.size) or length > _LARGEST:
            raise LogError(f"an object of it has {length} bytes: it is damaged")
        if start + length > len(data):
            return frames, offset
        if kind in _FRAMES and version not in _VERSIONS:
            raise LogError(f"an object of it has version {version}, which is not read")
        frames += kind in _FRAMES
        offset = start + length
