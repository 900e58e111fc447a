"""What must not be started twice or where it cannot be: said plainly, and harmless to what runs."""

import os
import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from app.web.addresses import addresses_elsewhere, exposure, web_address
from tests.runtime.processes import Serving, environment, stream
from tests.waiting import Waits

pytestmark = pytest.mark.real_time("servers and workers start and stop")


def gainline(*arguments: str, **more: str) -> subprocess.CompletedProcess[str]:
    """A command that is expected to end by itself; its words in one line each."""
    done = subprocess.run(
        [sys.executable, "-m", "app.cli", *arguments],
        env=environment(COLUMNS="1000", **more),
        capture_output=True,
        text=True,
        check=False,
    )
    done.stderr = " ".join(done.stderr.split())
    return done


@pytest.mark.complete
def test_a_busy_port_is_named_with_the_option_that_helps(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        refused = gainline("serve", "--port", str(port), "--data-dir", str(tmp_path / "data"))
    assert refused.returncode == 1
    assert f"port: {port} is in use by another program" in refused.stderr
    assert "--port" in refused.stderr
    assert not (tmp_path / "data" / "gainline.sqlite3").exists(), "nothing was begun"


@pytest.mark.complete
def test_a_host_that_is_not_this_machine_is_refused(tmp_path: Path) -> None:
    refused = gainline("serve", "--host", "192.0.2.1", "--port", "0", "--data-dir", str(tmp_path))
    assert refused.returncode == 1
    assert "host: 192.0.2.1 is not an address of this computer" in refused.stderr


@pytest.mark.complete
def test_a_second_server_on_the_same_database_is_refused_and_the_first_goes_on(serving: Serving) -> None:
    refused = gainline("serve", "--port", "0", "--data-dir", str(serving.data_dir))
    assert refused.returncode == 1
    assert f"process {serving.process.pid} at {serving.url}" in refused.stderr
    assert "--data-dir" in refused.stderr
    assert serving.get("/health")["worker"] == "running"


@pytest.mark.complete
def test_a_second_worker_on_the_same_database_is_refused_and_the_first_goes_on(serving: Serving) -> None:
    worker = serving.worker_pid()
    refused = gainline("worker", "--data-dir", str(serving.data_dir))
    assert refused.returncode == 1
    assert f"process {worker}" in refused.stderr
    assert "gainline serve" in refused.stderr
    assert serving.worker_pid() == worker
    serving.trial(serving.fly(serving.campaign()), "valid")


@pytest.mark.complete
def test_a_worker_without_a_database_prints_what_to_run(tmp_path: Path) -> None:
    refused = gainline("worker", "--data-dir", str(tmp_path))
    assert refused.returncode == 1
    assert "gainline serve" in refused.stderr


@pytest.mark.complete
def test_a_worker_of_its_own_serves_a_server_without_one(tmp_path: Path) -> None:
    with Serving(tmp_path / "data", "--no-worker") as serving:
        assert serving.get("/health")["worker"] == "absent"
        with subprocess.Popen(
            [sys.executable, "-m", "app.cli", "worker", "--data-dir", str(serving.data_dir)],
            env=environment(),
            stderr=subprocess.DEVNULL,
        ) as worker:
            assert serving.worker_pid() == worker.pid
            serving.trial(serving.fly(serving.campaign()), "valid")
            worker.send_signal(signal.SIGTERM)
            assert worker.wait(Waits.at_most_s) == 0


@pytest.mark.complete
def test_a_server_in_a_deep_folder_flies_and_stops_by_itself_with_open_streams_and_its_worker_with_it(
    tmp_path: Path,
) -> None:
    """Its socket's path would be too long there."""
    deep = tmp_path / ("d" * 100) / ("e" * 100)
    deep.mkdir(parents=True)
    serving = Serving(deep / "data")
    serving.trial(serving.fly(serving.campaign()), "valid")
    worker = serving.worker_pid()
    with stream(serving.url) as events:
        following = iter(events)
        assert next(following)[0] == "hello"
        serving.process.send_signal(signal.SIGTERM)
        # The end of the flight is stored before it is told.
        assert [name for name, _, _ in following if name not in {"worker", "change", "phase"}] == []
    assert serving.stop() == 0
    assert "graceful shutdown exceeded" not in serving.logged()
    with pytest.raises(ProcessLookupError):
        os.kill(worker, 0)


@pytest.mark.parametrize("host", ["127.0.0.1", "127.0.0.2", "::1", "localhost"])
def test_nothing_is_exposed_on_loopback(host: str) -> None:
    assert exposure(host) is None


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.0.2.1", "field-laptop"])
def test_what_others_can_do_is_said_before_it_is_possible(host: str) -> None:
    warning = exposure(host)
    assert warning is not None
    assert host in warning
    assert "no user accounts" in warning


@pytest.mark.complete
def test_a_server_that_others_reach_says_where_a_tablet_finds_it(tmp_path: Path) -> None:
    elsewhere = addresses_elsewhere("0.0.0.0", 8000)
    if not elsewhere:
        pytest.skip("this machine is in no network")
    with Serving(tmp_path / "data", "--no-worker", "--host", "0.0.0.0") as serving:
        assert any(line.startswith("Warning: listening on 0.0.0.0") for line in serving.said)
        assert serving.process.stdout is not None
        line = serving.process.stdout.readline()
    address = elsewhere[0].url.rpartition(":")[0]
    assert line.startswith(f"On a tablet: {address}:")


def test_the_address_is_one_for_a_browser_on_this_machine() -> None:
    assert web_address("0.0.0.0", 80) == "http://127.0.0.1:80"
    assert web_address("::1", 80) == "http://[::1]:80"
