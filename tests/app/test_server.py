"""However the page is ended, it ends without a word and leaves nothing."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time

import pytest

pytest.importorskip("uvicorn", reason="the extra 'app' is not installed")


@pytest.mark.skipif(os.name != "posix", reason="Windows has no such signals")
@pytest.mark.parametrize("name", ["SIGINT", "SIGHUP", "SIGTERM"])
def test_a_page_that_is_ended_while_it_gets_ready_leaves_no_files_and_no_traceback(tmp_path, name):
    process = subprocess.Popen(
        [sys.executable, "-m", "tissuq", "app", "--no-browser"],
        env={**os.environ, "TMPDIR": str(tmp_path)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    assert "http://127.0.0.1:" in process.stdout.readline()
    (folder,) = tmp_path.glob("tissuq-app-*")
    if name != "SIGINT":  # which comes while processes are still being started
        until = time.monotonic() + 60
        while not list(folder.iterdir()) and time.monotonic() < until:
            time.sleep(0.1)
        assert list(folder.iterdir()), "no process gets ready"
    os.killpg(process.pid, getattr(signal, name)) if name == "SIGINT" else process.send_signal(getattr(signal, name))
    _, said = process.communicate(timeout=60)
    assert (process.returncode, said, list(tmp_path.iterdir())) == (0, "", [])
