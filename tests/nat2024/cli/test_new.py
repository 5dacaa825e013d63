"""`nat-bench new`."""

import json


def test_new_writes_a_package_and_says_what(cli, tmp_path):
    status, out, _ = cli("new", "enhancer", "my_lift", "--out", tmp_path / "mine")
    assert status == 0
    assert "nat_bench_my_lift/plugin.py" in out
    assert (tmp_path / "mine" / "nat_bench_my_lift" / "plugin.py").is_file()


def test_new_in_json(cli, tmp_path):
    words = ["new", "tracker", "my_net", "--network", "--out", tmp_path / "mine", "--json"]
    status, out, _ = cli(*words)
    assert status == 0
    document = json.loads(out)
    assert document["kind"] == "tracker"
    assert document["folder"] == str(tmp_path / "mine")
    assert "nat_bench_my_net/model.py" in document["files"]


def test_bad_names_are_one_line(cli, tmp_path):
    status, out, err = cli("new", "tracker", "Bad-Name", "--out", tmp_path / "mine")
    assert (status, out) == (2, "")
    assert "'Bad-Name' cannot name a tracker" in err
    assert not (tmp_path / "mine").exists()
