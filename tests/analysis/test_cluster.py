"""Campaigns on a real dask scheduler with real worker processes, killed for the purpose."""

import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest

pytest.importorskip("pyarrow", reason="the extra 'campaign' is not installed")
distributed = pytest.importorskip("distributed", reason="the extra 'campaign' is not installed")

from fullam.analysis import cluster as cluster_module  # noqa: E402
from fullam.analysis.campaign import Campaign, sweep  # noqa: E402
from fullam.analysis.campaign_store import read_campaign  # noqa: E402
from fullam.exceptions import CampaignError  # noqa: E402
from fullam.simulation.scenario import load_scenario  # noqa: E402

# dask closes a killed worker's sockets when it gets to it.
pytestmark = pytest.mark.filterwarnings("ignore::ResourceWarning")

SHORT = replace(load_scenario("position-1"), name="short", duration=1.0)
CAMPAIGN = Campaign((SHORT,), ("pid", "dc-pid"), tuple(range(24)))

SCRIPT = """
import sys
from dataclasses import replace
from fullam.analysis.campaign import Campaign, sweep
from fullam.simulation.scenario import load_scenario

if __name__ == "__main__":
    short = replace(load_scenario("position-1"), name="short", duration=1.0)
    sweep(Campaign((short,), ("pid", "dc-pid"), tuple(range(24))), sys.argv[1], jobs=2)
"""


@pytest.fixture(scope="module")
def one_job(tmp_path_factory):
    out = tmp_path_factory.mktemp("one") / "sweep.parquet"
    sweep(CAMPAIGN, out, jobs=1)
    return out


def test_a_worker_killed_in_mid_run_costs_no_row(tmp_path, one_job):
    out = tmp_path / "sweep.parquet"
    killed = []
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, host="127.0.0.1", dashboard_address=None
        ) as cluster,
        distributed.Client(cluster, set_as_default=False) as client,
    ):
        pids = list(client.run(os.getpid).values())
        threads = client.run(os.environ.get, "OMP_NUM_THREADS")
        assert set(threads.values()) == {"1"}

        def kill_one(done: int, total: int) -> None:
            if 0 < done < total and not killed:
                os.kill(pids[0], signal.SIGKILL)
                killed.append(pids[0])

        sweep(CAMPAIGN, out, scheduler=cluster.scheduler_address, progress=kill_one)
    assert killed
    assert len(read_campaign(out)) == 48
    assert out.read_bytes() == one_job.read_bytes()


def test_killed_outright_and_started_again_it_ends_with_the_same_file(tmp_path, one_job):
    out, script = tmp_path / "sweep.parquet", tmp_path / "script.py"
    parts = out.with_name(out.name + ".parts")
    script.write_text(SCRIPT, encoding="utf-8")
    process = subprocess.Popen([sys.executable, str(script), str(out)])
    end = time.monotonic() + 60.0
    while len(list(parts.glob("[!.]*.parquet"))) < 2 and time.monotonic() < end:
        time.sleep(0.02)
    process.send_signal(signal.SIGKILL)
    process.wait()
    kept = len(list(parts.glob("[!.]*.parquet")))
    assert 2 <= kept < 6, "the sweep was to be killed in its middle"
    assert not out.exists()
    table = sweep(CAMPAIGN, out)
    assert len(table) == 48
    assert out.read_bytes() == one_job.read_bytes()
    assert not parts.exists()


def test_a_scheduler_that_is_not_there_is_named(monkeypatch):
    monkeypatch.setattr(cluster_module, "CONNECT_TIMEOUT", 1.0)
    with (
        pytest.raises(CampaignError, match="does not answer"),
        cluster_module.open_workers(1, "tcp://127.0.0.1:9"),
    ):
        pass


def test_the_flights_do_not_depend_on_the_folder_they_run_in(tmp_path, one_job, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert Path.cwd() == tmp_path
    assert sweep(CAMPAIGN, one_job).rows.equals(read_campaign(one_job).rows)
