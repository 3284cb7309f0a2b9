"""Forked programs that are left running by a failed test, or write much."""

import os

import pytest
from forked_programs import Forker


@pytest.fixture(scope="module")
def forker():
    kept = Forker(["json"])
    yield kept
    kept.close()


def test_program_that_runs_too_long_is_ended_before_the_next_one(forker, tmp_path):
    left = forker.start("import time; print('begun', flush=True); time.sleep(60)", [], tmp_path)
    with pytest.raises(TimeoutError, match=r"longer than 0\.3 s"):
        left.communicate(0.3)
    done = forker.run("import os, sys; print(os.getpid()); sys.exit(3)", [], tmp_path)
    assert (left.returncode, left.communicate()) == (-9, (b"begun\n", b""))
    assert done.returncode == 3 and int(done.stdout) not in (left.pid, os.getpid())


def test_both_streams_may_be_longer_than_a_pipe(forker, tmp_path):
    source = "import sys; sys.stderr.write('e' * 200_000); sys.stdout.write('o' * 200_000)"
    done = forker.run(source, [], tmp_path)
    assert (done.stdout, done.stderr) == (b"o" * 200_000, b"e" * 200_000)
