"""One real server, with its worker, for all tests of a process that leave it able to fly and compute."""

from collections.abc import Iterator

import pytest

from tests.runtime.processes import Serving


@pytest.fixture(scope="session")
def serving(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Serving]:
    with Serving(tmp_path_factory.mktemp("serving") / "data") as one:
        yield one
