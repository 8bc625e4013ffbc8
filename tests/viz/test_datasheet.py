"""The datasheet: complete, self-contained, and no figure where there is none."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fullam import cli
from fullam.analysis.atlas.envelope import Envelope
from fullam.analysis.datasheet import datasheet
from fullam.exceptions import FullamError
from fullam.model.loading import load_vehicle, vehicle_names
from fullam.viz.datasheet import page
from fullam.viz.polytope import force_polytope, rose_svg

NAMES = ("fullam", "hextilt", "borinot", "quadrotor_arm")


@pytest.mark.parametrize("name", NAMES)
def test_the_page_holds_everything_and_loads_nothing(name: str) -> None:
    assert name in vehicle_names()
    sheet = datasheet(load_vehicle(name), flights=1, date="2026-01-01")
    text = page(sheet)
    assert not re.search(r"(src|href)=\"(?!data:|#)", text), "nothing is loaded from elsewhere"
    for heading in ("Masses", "Rotors", "by arm pose", "When a rotor stops", "Suggested limits",
                    "Does it fly", "Can the dynamics be trusted"):  # fmt: skip
        assert heading in text
    assert "nan" not in re.sub(r"base64,[^\"]*", "", text).lower()
    assert f"{np.rad2deg(sheet.capability.worst_hover_tilt):.1f}°" in text
    assert "2026-01-01" in text
    assert sheet.trial.lost == 0
    data = json.loads(json.dumps(sheet.to_dict()))
    assert len(data["failures"]) == len(data["rotors"]) == sheet.vehicle.rotors.count
    tilt = data["arm_poses"][0]["worst_tilt_deg"]
    assert tilt == pytest.approx(np.rad2deg(sheet.capability.worst_hover_tilt))
    assert data["payload_tilt_deg"][-1] == pytest.approx(0.0, abs=0.1), "there hover ends"


def test_limits_keep_a_reserve_in_every_arm_pose() -> None:
    sheet = datasheet(load_vehicle("fullam"), flights=0)
    limits = sheet.limits
    least = np.rad2deg(np.nanmin(sheet.survey.tilts))
    assert limits.tilt_deg == pytest.approx(limits.share * least)
    assert limits.lateral_ratio == pytest.approx(11.2377 / (2.25 * 9.81), rel=1e-4)
    assert limits.down <= 9.81
    assert "Not flown: not asked for" in page(sheet)


def test_a_vehicle_that_cannot_hover_gets_a_sheet_without_figures(tmp_path, capsys) -> None:
    source = Path(load_vehicle("fullam").source)
    text = re.sub(r"(?m)^max_speed = .*", "max_speed = 300.0", source.read_text())
    (tmp_path / "weak.toml").write_text(text)
    (tmp_path / "fullam.urdf").write_text(source.with_name("fullam.urdf").read_text())
    out = tmp_path / "weak.html"
    assert cli.main(["datasheet", str(tmp_path / "weak.toml"), "--out", str(out)]) == 1
    assert capsys.readouterr().out.strip() == str(out)
    written = out.read_text(encoding="utf-8")
    assert "it cannot hover level: it lifts 0.64 of its weight" in written
    assert "Not flown: it cannot hover level" in written
    assert "None: it cannot hover" in written
    code = cli.main(["datasheet", str(tmp_path / "weak.toml"), "--json"])
    data = json.loads(capsys.readouterr().out)
    assert code == 1
    assert data["arm_poses"][0]["worst_tilt_deg"] is None
    assert data["limits"]["tilt_deg"] is None


def test_the_force_polytope_is_what_the_rays_reach() -> None:
    envelope = Envelope.of(load_vehicle("fullam"))
    points, triangles = force_polytope(envelope)
    assert triangles.max() < len(points)
    hover = np.array([0.0, 0.0, envelope.load.weight])
    center = envelope.load.center
    for point in points:  # on the rim, and a ray towards it ends there
        wrench = np.concatenate([point, np.cross(center, point)])
        assert envelope.facets.slacks(wrench).min() == pytest.approx(0.0, abs=1e-9)
        step = point - hover
        length = np.linalg.norm(step)
        assert envelope.force(step / length) == pytest.approx(length)
    with pytest.raises(FullamError):
        force_polytope(Envelope.of(load_vehicle("borinot")))


def test_the_small_rose_shows_tilt_and_survives_no_hover() -> None:
    vehicle = load_vehicle("fullam")
    assert 'aria-label="hover tilt by azimuth"' in rose_svg(Envelope.of(vehicle), 0.2, 1.0)
    rotors = replace(vehicle.rotors, max_speeds=0.5 * vehicle.rotors.max_speeds)
    assert "nan" not in rose_svg(Envelope.of(replace(vehicle, rotors=rotors)))


def test_design_on_the_command_line_writes_a_vehicle(tmp_path, capsys) -> None:
    out, figure = tmp_path / "mine.toml", tmp_path / "front.png"
    arguments = ["design", "--rotors", "6", "--period", "2", "--evaluations", "60", "--starts", "1"]
    assert cli.main([*arguments, "--out", str(out)]) == 0
    assert "against the ring" in capsys.readouterr().out
    vehicle = load_vehicle(out)
    assert (vehicle.name, vehicle.rotors.count) == ("mine", 6)
    code = cli.main([*arguments, "--pareto", "0.8,0.9", "--figure", str(figure), "--json"])
    front = json.loads(capsys.readouterr().out)
    assert code == 0
    assert len(front) == 2
    assert front[0]["found"]["efficiency"] >= 0.798
    assert figure.is_file()
