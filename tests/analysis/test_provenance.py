"""What decides a row, as digests: they notice what changes a flight and nothing else."""

import importlib
import sys
from pathlib import Path

import pytest

pytest.importorskip("pyarrow", reason="the extra 'campaign' is not installed")

from fullam.analysis.campaign import Campaign, sweep
from fullam.analysis.provenance import cached_vehicle, class_digest, is_ours, versions
from fullam.control import controllers
from fullam.control.controllers import controller_class
from fullam.exceptions import CampaignError
from fullam.model.loading import vehicle_path
from fullam.registry import Registry
from fullam.simulation.scenarios.scenario import Scenario

CONTROLLER = '''
"""A law of a user's own."""
from dataclasses import dataclass
from {helper} import gain
from fullam.control.controllers import register
from fullam.control.pid import Pid

@dataclass(frozen=True)
class Own(Pid.Settings):
    """Own."""
    stiffness: float = {stiffness}

@register("own")
class Law(Pid):
    """Own."""  # {comment}
    Settings = Own

    def wrench(self, t, measurement, reference):
        """Own."""
        return gain() * super().wrench(t, measurement, reference)
'''
HELPER = "def gain():\n    return {gain}\n"


@pytest.fixture
def own_law(tmp_path, monkeypatch):
    """A function that (re)loads a user's controller from files, as a fresh process would."""
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(controllers, "CONTROLLERS", Registry("controller", ORDINARY))

    def load(gain=1.0, stiffness=2.0, comment="none"):
        text = CONTROLLER.format(helper="own_helper", stiffness=stiffness, comment=comment)
        (tmp_path / "own_law.py").write_text(text, encoding="utf-8")
        (tmp_path / "own_helper.py").write_text(HELPER.format(gain=gain), encoding="utf-8")
        importlib.invalidate_caches()
        for name in ("own_law", "own_helper"):
            sys.modules.pop(name, None)
            for stale in tmp_path.rglob(f"{name}*.pyc"):
                stale.unlink()
        return importlib.import_module("own_law").Law

    yield load
    for name in ("own_law", "own_helper"):
        sys.modules.pop(name, None)


ORDINARY = {name: controller_class(name) for name in ("pid", "dc-pid")}


def test_the_digest_of_a_class_notices_what_flies_and_nothing_else(own_law):
    first = class_digest(own_law())
    assert class_digest(own_law()) == first
    assert class_digest(own_law(comment="another\n    # and one line more")) == first
    assert class_digest(own_law(gain=1.0 + 1e-9)) != first, "a helper in another file"
    assert class_digest(own_law(stiffness=3.0)) != first, "a default of its settings"


def test_only_classes_of_others_need_a_digest(own_law):
    assert is_ours(ORDINARY["pid"])
    assert not is_ours(own_law())


def test_rows_of_an_edited_controller_are_not_continued(tmp_path, own_law):
    scenario = Scenario("brief", duration=0.2)
    out = tmp_path / "own.parquet"
    own_law()
    sweep(Campaign((scenario,), ("own",), (0,)), out)
    own_law(comment="changes nothing")
    assert len(sweep(Campaign((scenario,), ("own",), (0, 1)), out)) == 2
    own_law(gain=0.5)
    with pytest.raises(CampaignError, match=r"registered \(controller own\) differ"):
        sweep(Campaign((scenario,), ("own",), (0, 1, 2)), out)


def copied_vehicle(folder: Path) -> Path:
    """The default vehicle as two files of their own."""
    source = vehicle_path("fullam")
    text = source.read_text(encoding="utf-8")
    path = folder / "mine.toml"
    path.write_text(text, encoding="utf-8")
    for urdf in source.parent.glob("fullam*.urdf"):
        (folder / urdf.name).write_bytes(urdf.read_bytes())
    return path


def test_an_edited_vehicle_is_another_vehicle_at_once(tmp_path):
    path = copied_vehicle(tmp_path)
    first = cached_vehicle(str(path))
    assert cached_vehicle(str(path)) is first
    text = path.read_text(encoding="utf-8")
    path.write_text("gravity = 3.71\n" + text, encoding="utf-8")
    assert cached_vehicle(str(path)).gravity == 3.71
    path.write_text(text, encoding="utf-8")
    assert cached_vehicle(str(path)).gravity == first.gravity == 9.81


def test_a_vehicle_edited_while_a_campaign_flies_does_not_mix_into_it(tmp_path):
    path = copied_vehicle(tmp_path)
    scenario = Scenario("mine", vehicle=str(path), duration=0.2)
    campaign = Campaign((scenario,), ("pid",), (0, 1, 2))
    undisturbed = sweep(campaign, tmp_path / "undisturbed.parquet")
    text = path.read_text(encoding="utf-8")

    def edit(done: int, total: int) -> None:
        path.write_text("gravity = 3.71\n" + text, encoding="utf-8")

    table = sweep(campaign, tmp_path / "edited.parquet", progress=edit)
    assert table.rows.equals(undisturbed.rows)
    with pytest.raises(CampaignError, match=r"vehicles \(.*\) differ"):
        sweep(Campaign((scenario,), ("pid",), (0, 1, 2, 3)), tmp_path / "edited.parquet")


def test_the_stamp_names_the_versions(tmp_path):
    table = sweep(Campaign(("task-1",), ("pid",), (0,)), tmp_path / "v.parquet")
    assert table.identity["versions"] == versions()
    assert {"fullam", "python", "pin", "numpy"} <= set(versions())
