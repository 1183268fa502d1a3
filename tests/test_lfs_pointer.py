"""What a Git LFS pointer looks like: a version and an object id, in a small text."""

import pytest

from replay.lfs_pointer import LARGEST_POINTER, is_lfs_pointer

VERSION, OID = b"version https://git-lfs.github.com/spec/v1\n", b"oid sha256:" + b"0" * 64 + b"\n"


@pytest.mark.parametrize(
    ("data", "expected"),
    [
        (VERSION + OID + b"size 12\n", True),
        (VERSION + b"ext-0-a x\n" + OID, True),
        (VERSION, False),
        (VERSION + b"x" * LARGEST_POINTER + OID, False),
        (OID + VERSION, False),
        (b"solid version https://git-lfs oid ", False),
        (b"", False),
    ],
)
def test_a_pointer_is_a_version_and_an_object_id(data, expected):
    assert is_lfs_pointer(data) == expected
