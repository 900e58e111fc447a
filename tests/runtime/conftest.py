"""One real server, with its worker, for all tests that leave it able to fly and compute: they are `real_time`, so that
one process runs them, one after another."""

from collections.abc import Iterator

import pytest

from tests.runtime.processes import Serving


@pytest.fixture(scope="package")
def serving(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Serving]:
    with Serving(tmp_path_factory.mktemp("serving") / "data") as one:
        one.worker_pid()  # what is asked for before its worker works is withdrawn
        yield one
