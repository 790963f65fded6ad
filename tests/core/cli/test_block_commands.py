"""`prt bake-blocks`, and `prt bake --finish`, on a bake that was planned."""

import json
import sys

import pytest

from prt_core import BakeSettings, Scene, run
from prt_core.bake.plan import plan_steps
from prt_core.cli import main
from tests.meshes import plane, wall


@pytest.fixture
def planned(tmp_path, monkeypatch):
    monkeypatch.setattr(sys.modules["prt_core.bake.visibility"], "BLOCK", 16)
    scene = Scene.from_meshes([plane(8), wall(0.9, 1.0, 1.0, albedo=0.7)], max_hidden=0)
    run(plan_steps(scene, tmp_path / "a.prt", BakeSettings(4, method="exhaustive")))
    return str(tmp_path / "a.prt")


def test_blocks_are_listed_computed_and_closed(planned, capsys):
    assert main(["bake-blocks", planned]) == 0
    name, count, _, missing = capsys.readouterr().out.split(maxsplit=3)
    assert (name, missing) == ("visibility", f"missing 0-{int(count) - 1}\n")
    last = int(count) - 1
    assert main(["bake-blocks", planned, "--stage", name, "--blocks", f"1-2,{last}", "--json"]) == 0
    done = json.loads(capsys.readouterr().out)
    assert [each["index"] for each in done] == [1, 2, last]
    assert all(each["rays"] > 0 and each["seconds"] > 0 for each in done)
    assert main(["bake", "--finish", planned]) == 3
    said = capsys.readouterr()
    assert said.out == "" and said.err.count("\n") == 1
    assert f"missing (0,3-{last - 1})" in said.err
    assert main(["bake-blocks", planned, "--stage", name]) == 0
    assert len(capsys.readouterr().out.splitlines()) == last + 1 - 3
    assert main(["bake-blocks", planned, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)[0] == {
        "stage": name, "blocks": last + 1, "missing": "",
    }  # fmt: skip
    assert main(["bake", "--finish", planned, "--json"]) == 3
    assert "stage 'gather2'" in capsys.readouterr().err
    assert main(["bake", "--finish", planned, "--compute", "--memory", "1", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["tolerance_met"]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["bake-blocks", "{}", "--blocks", "1"], "--blocks: changes nothing without --stage"),
        (["bake-blocks", "{}", "--stage", "gather2"], "--stage: expected one of visibility"),
        (["bake-blocks", "{}", "--stage", "visibility", "--blocks", "2-1"], "ranges as 12-20,25"),
        (["bake-blocks", "{}", "--stage", "visibility", "--blocks", "0-"], "ranges as 12-20,25"),
        (["bake-blocks", "{}", "--stage", "visibility", "--blocks", "99"], "has blocks 0 to"),
        (["bake-blocks", "{}x", "--stage", "visibility"], "there is no such bake"),
        (["bake", "{}", "--finish", "--plan"], "ask for one of --plan and --finish"),
        (["bake", "{}", "--compute"], "--compute: changes nothing without --finish"),
        (["bake", "{}", "--finish", "-o", "b.prt"], "--output: changes nothing with --finish"),
        (["bake", "{}", "--finish", "--only", "a"], "changes nothing"),
        (["bake", "{}", "--finish", "--gloss"], "--gloss: changes nothing with --finish"),
        (["bake", "{}", "--finish", "--tolerance", "0.2"], "--tolerance: changes nothing with"),
        (["bake", "{}", "--finish", "--memory", "0.1"], "memory: expected a number >= 0.5"),
        (["bake", "a.blend", "--plan", "--restart"], "restart: a plan replaces nothing"),
    ],
)
def test_what_is_wrong_is_said_in_one_line(planned, capsys, arguments, said):
    assert main([each.format(planned) for each in arguments]) == 2
    error = capsys.readouterr().err
    assert said in error and error.count("\n") == 1
