"""Folders that one process locks while it writes there."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import pytest

from laufruhe.numerics.locks import folder_lock


def test_a_folder_is_kept_by_one_at_a_time(tmp_path: Path) -> None:
    with folder_lock(tmp_path) as first, folder_lock(tmp_path, wait=False) as second:
        assert first is True
        assert second is False
    with folder_lock(tmp_path, wait=False) as again:
        assert again is True


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system copies no process")
@pytest.mark.filterwarnings("ignore:This process:DeprecationWarning")
def test_a_copy_of_a_process_keeps_no_folder(tmp_path: Path) -> None:
    """A killed run whose copy lives on for a moment does not keep the next run from sweeping."""
    there, begun = os.pipe()
    with folder_lock(tmp_path) as locked:
        assert locked is True
        copy = os.fork()
        if copy == 0:
            os.write(begun, b"!")
            signal.pause()
            os._exit(0)
        assert os.read(there, 1) == b"!"
    try:
        with folder_lock(tmp_path, wait=False) as again:
            assert again is True
    finally:
        os.kill(copy, signal.SIGKILL)
        os.waitpid(copy, 0)
        for end in (there, begun):
            os.close(end)
