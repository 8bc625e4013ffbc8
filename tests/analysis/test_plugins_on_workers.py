"""A law of a file of one's own flies on worker processes and dask workers, which get the file."""

import sys

import pytest

pytest.importorskip("pyarrow", reason="the extra 'campaign' is not installed")
pytest.importorskip("cloudpickle", reason="the extra 'campaign' is not installed")

import fullam
from fullam import ownership
from fullam.analysis.campaign import Campaign, sweep
from fullam.analysis.campaign_table import read_campaign
from fullam.analysis.cluster import map_in_order, open_workers
from fullam.cli import main
from fullam.exceptions import FullamWarning, PluginError
from fullam.plugins import load_plugin
from fullam.simulation.scenarios.scenario import Scenario

# dask closes what it holds when it gets to it.
pytestmark = pytest.mark.filterwarnings("ignore::ResourceWarning")

LAW = '''
"""A law with settings, a helper and an estimator of its own."""

from dataclasses import dataclass

import numpy as np

import fullam

GAIN = 1.0


@dataclass(frozen=True)
class Gains:
    stiffness: np.ndarray = (20.0, 20.0, 40.0)


def pull(gains, way):
    return GAIN * np.array(gains.stiffness) * way


@fullam.register("sent-law")
class Law(fullam.Controller):
    Settings = Gains
    estimator = "sent-estimator"

    def reset(self, measurement, reference):
        pass

    def wrench(self, t, measurement, reference):
        u = np.zeros(6)
        u[:3] = pull(self.settings, reference.pose[:3] - measurement.q[:3])
        u[2] += self.vehicle.mass * self.vehicle.gravity
        return u


@fullam.register_estimator("sent-estimator")
class Told(fullam.Estimator):
    def reset(self, readings):
        pass

    def update(self, readings, measurement):
        measurement.q[:7] = np.concatenate(readings.pose)
'''

BRIEF = Scenario("brief", duration=0.2)


@pytest.fixture
def law(tmp_path, monkeypatch):
    """The plugin's path; what it registered is forgotten afterwards."""
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "sent_law.py"
    path.write_text(LAW, encoding="utf-8")
    yield path
    plugin = ownership.LOADED.pop(str(path), None)
    if plugin is not None:
        ownership.withdraw(plugin)
        del sys.modules[plugin.module.__name__]


def campaign():
    return Campaign((BRIEF,), ("sent-law",), tuple(range(4)))


def test_worker_processes_get_the_file_and_not_its_path(law, tmp_path):
    load_plugin(law)
    law.unlink()
    one, two = tmp_path / "one.parquet", tmp_path / "two.parquet"
    assert len(sweep(campaign(), one, jobs=1)) == 4
    sweep(campaign(), two, jobs=2)
    assert one.read_bytes() == two.read_bytes()


def names_there(item):
    """What a worker knows: whose the law is, and where it comes from."""
    plugin = ownership.owner_of("controller", "sent-law")
    return plugin.name, plugin.digest, plugin.module.__name__, item.stiffness


def test_a_worker_loads_the_plugin_before_what_is_of_it(law):
    """An item of one of the plugin's classes included."""
    module = load_plugin(law)
    here = ownership.owner_of("controller", "sent-law")
    with open_workers(2) as workers:
        there = map_in_order(workers, names_there, [module.Gains((1.0,)), module.Gains((2.0,))])
    assert there == [("sent_law.py", here.digest, "sent_law", (k,)) for k in (1.0, 2.0)]


def test_what_a_worker_lacks_is_named(law, tmp_path, monkeypatch):
    """A file that imports what stands beside it, on a machine where that does not stand."""
    (tmp_path / "beside_sent_law.py").write_text("X = 1\n", encoding="utf-8")
    law.write_text(f"{LAW}\nimport beside_sent_law\n", encoding="utf-8")
    load_plugin(law)
    (tmp_path / "beside_sent_law.py").unlink()
    del sys.modules["beside_sent_law"]
    with open_workers(2) as workers, pytest.raises(PluginError, match="install 'beside_sent_law'"):
        map_in_order(workers, str, [1, 2])


def test_dask_workers_get_the_file(law, tmp_path):
    distributed = pytest.importorskip("distributed", reason="the extra 'campaign' is not installed")
    load_plugin(law)
    law.unlink()
    here, there = tmp_path / "here.parquet", tmp_path / "there.parquet"
    sweep(campaign(), here)
    with (
        distributed.LocalCluster(
            n_workers=1, threads_per_worker=1, host="127.0.0.1", dashboard_address=":0"
        ) as cluster,
        pytest.warns(FullamWarning, match="neither encrypted"),
    ):
        sweep(campaign(), there, scheduler=cluster.scheduler_address)
    assert here.read_bytes() == there.read_bytes()


def test_sweep_flies_a_plugin_on_processes_and_a_changed_one_is_not_mixed_in(law, capsys):
    typed = ["sweep", "position-1", "--plugin", str(law), "--controllers", "sent-law"]
    out = ["--out", "rows.parquet"]
    assert main([*typed, "--runs", "2", "--jobs", "2", *out]) == 0
    law.write_text(LAW.replace("from dataclasses", "# a remark\nfrom dataclasses"), "utf-8")
    assert main([*typed, "--runs", "3", *out]) == 0, "a remark changes no row"
    assert len(read_campaign("rows.parquet").rows) == 3
    law.write_text(LAW.replace("GAIN = 1.0", "GAIN = 1.1"), encoding="utf-8")
    capsys.readouterr()
    assert main([*typed, "--runs", "4", *out]) == 2
    said = capsys.readouterr().err
    assert "under other conditions (registered (controller sent-law) differ)" in said
    assert main([*typed, "--runs", "1", *out, "--overwrite"]) == 0


def test_list_compare_and_view_know_a_plugin(law, capsys):
    flags = ["--plugin", str(law)]
    assert main(["list", *flags]) == 0
    assert "[sent_law.py]" in capsys.readouterr().out
    scenario = law.with_name("brief.toml")
    scenario.write_text('name = "brief"\nduration = 0.2\n', encoding="utf-8")
    assert main(["compare", str(scenario), *flags, "--controllers", "sent-law,pid", "--calm"]) == 0
    assert "sent-law" in capsys.readouterr().out
    view = ["view", str(scenario), *flags, "--controller", "sent-law", "--calm"]
    assert main([*view, "--html", "flight.html"]) == 0
    assert law.with_name("flight.html").stat().st_size > 1e5


def test_reproduce_judges_a_law_of_ones_own(law):
    from fullam.analysis import reproduce

    load_plugin(law)
    entry = reproduce.entries(own=["sent-law"])[-1]
    assert (entry.judged, entry.contender.label) == (True, "sent-law")
    claim, condition = reproduce.CLAIMS[0], reproduce.CONDITIONS[0]
    typed = reproduce.command(claim, entry, condition, 5)
    assert "--controllers sent-law" in typed
    assert typed.endswith("--plugin sent_law.py")
    typed = reproduce._typed((entry,))
    assert typed == " --controllers sent-law --plugin sent_law.py"
    assert fullam.controller_names()
