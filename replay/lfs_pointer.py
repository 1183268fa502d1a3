"""Git LFS pointers: the few lines of text that stand for a large file until `git lfs pull` has brought it."""

from __future__ import annotations

LARGEST_POINTER = 1024
"""Pointers are shorter than this [bytes]."""
LFS_POINTER = "is a Git LFS pointer, not the file that it stands for; get that with: git lfs pull"
"""What is said of one, after the file's name."""

_BEGINNINGS = (b"version https://git-lfs.github.com/spec/", b"version https://hawser.github.com/spec/")


def is_lfs_pointer(data: bytes) -> bool:
    """Return whether a file is a pointer, by its bytes or its first `LARGEST_POINTER` ones."""
    return data.startswith(_BEGINNINGS) and b"oid " in data[:LARGEST_POINTER]
