"""`nat-bench weights` and what `nat-bench list` says of weights, as a user meets them."""

import json

import pytest
import torch

import nat2024


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("NAT2024_WEIGHTS", str(tmp_path / "registered"))
    return tmp_path / "registered"


@pytest.fixture(scope="module")
def checkpoint(tmp_path_factory):
    torch.manual_seed(0)
    path = tmp_path_factory.mktemp("weights") / "mine.pth"
    model = nat2024.create_enhancer("ldenhancer", weights=False).model
    torch.save(model.state_dict(), path)
    return path


def test_import_list_verify_remove(cli, checkpoint, folder):
    status, out, _ = cli("weights", "import", "ldenhancer", checkpoint)
    assert status == 0
    assert out.startswith("ldenhancer: fits, but is no published file that the card knows (sha256 ")
    assert f"registered as {folder}" in out
    status, out, _ = cli("weights", "list")
    assert status == 0
    assert "no published file" in out
    assert max(map(len, out.splitlines())) <= 100
    assert cli("weights", "verify", "ldenhancer")[:2] == (0, "ldenhancer: ok, no published file\n")
    status, out, _ = cli("weights", "remove", "ldenhancer")
    assert status == 0
    assert out.startswith("removed ldenhancer: ")
    assert cli("weights", "verify")[:2] == (0, "nothing is registered\n")


def test_import_says_what_it_replaces(cli, checkpoint, tmp_path):
    cli("weights", "import", "ldenhancer", checkpoint)
    assert "in place of" not in cli("weights", "import", "ldenhancer", checkpoint)[1]
    state = torch.load(checkpoint)
    torch.save({"state_dict": state, "epoch": 2}, tmp_path / "later.pth")
    _, out, _ = cli("weights", "import", "ldenhancer", tmp_path / "later.pth")
    assert out.endswith(f"\nin place of {checkpoint}\n")


@pytest.mark.shared
def test_import_names_the_official_file_and_its_licence(cli, shared):
    path = shared / "parity" / "enhancers" / "checkpoints" / "ldenhancer_model.pth"
    _, out, _ = cli("weights", "import", "ldenhancer", path)
    assert out.startswith("ldenhancer: model.pth, epoch 66, the released result; ")
    assert "; licence: none stated\n" in out


def test_every_verb_gives_one_json_object(cli, checkpoint, folder):
    status, out, _ = cli("weights", "import", "ldenhancer", checkpoint, "--json")
    entry = json.loads(out)
    assert status == 0
    assert (entry["plugin"], entry["form"], entry["known_as"]) == ("ldenhancer", "safetensors", "")
    listed = json.loads(cli("weights", "list", "--json")[1])
    assert listed == {"folder": str(folder), "weights": [entry]}
    verified = json.loads(cli("weights", "verify", "--json")[1])
    assert verified["ok"] is True
    assert verified["weights"][0]["problem"] == ""
    assert json.loads(cli("weights", "remove", "ldenhancer", "--json")[1]) == {"removed": [entry]}


def test_verify_fails_where_something_is_wrong(cli, checkpoint):
    path = json.loads(cli("weights", "import", "ldenhancer", checkpoint, "--json")[1])["path"]
    with open(path, "ab") as stream:  # noqa: PTH123
        stream.write(b"x")
    status, out, err = cli("weights", "verify")
    assert (status, err) == (1, "")
    assert "are damaged; import them anew" in out
    status, out, _ = cli("weights", "verify", "--json")
    assert status == 1
    assert json.loads(out)["ok"] is False


def test_options_are_kept(cli, tmp_path):
    torch.manual_seed(0)
    model = nat2024.create_enhancer("ldenhancer", weights=False, iterations=2).model
    torch.save(model.state_dict(), tmp_path / "two.pth")
    status, _, err = cli("weights", "import", "ldenhancer", tmp_path / "two.pth")
    assert status == 2
    assert "e_conv5.weight is (6, 32, 3, 3), expected (12, 32, 3, 3)" in err
    words = ("--opt", "iterations=2")
    status, out, _ = cli("weights", "import", "ldenhancer", tmp_path / "two.pth", *words)
    assert status == 0
    assert out.startswith("ldenhancer (iterations=2): ")
    assert nat2024.create_enhancer("ldenhancer").iterations == 2
    assert cli("weights", "remove", "ldenhancer", "--opt", "iterations=4")[0] == 2
    assert cli("weights", "remove", "ldenhancer", *words)[0] == 0


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("import", "ldenhancer", "absent.pth"), "absent.pth: no such file"),
        (("import", "ldenhanser", "x.pth"), "unknown plugin 'ldenhanser'; closest: ldenhancer"),
        (("import", "gamma", "x.pth"), "gamma takes no weights"),
        (("import", "siamrpnpp", "x.pth", "--variant", "a", "--opt", "variant=b"), "one is enough"),
        (("import", "ldenhancer", "x.pth", "--opt", "iterations"), "expected KEY=VALUE"),
        (("import", "ldenhancer", "x.pth", "--variant", "a"), "has no option 'variant'"),
        (("verify", "ldenhancer"), "no weights are registered for ldenhancer"),
        (("remove", "ldenhancer"), "nothing is registered"),
        (("remove", "../ldenhancer"), "is no plugin name"),
        (("imprt", "x", "y"), "no such command 'imprt'; closest: import"),
    ],
)
def test_mistakes_are_one_line(cli, words, message):
    status, out, err = cli("weights", *words)
    assert (status, out) == (2, "")
    assert message in err
    assert err.strip().count("\n") <= 1


def test_the_list_says_what_is_at_hand(cli, checkpoint):
    status, out, _ = cli("list", "--enhancers")
    assert status == 0
    assert max(map(len, out.splitlines())) <= 100
    (line,) = (line for line in out.splitlines() if line.startswith(" ldenhancer "))
    assert line.split()[-3:] == ["k", "1.723", "G"]
    assert " bundled " in line
    cli("weights", "import", "ldenhancer", checkpoint)
    _, out, _ = cli("list", "--enhancers")
    (line,) = (line for line in out.splitlines() if line.startswith(" ldenhancer "))
    assert " registered " in line


def test_the_list_as_json_has_the_whole_card(cli, checkpoint):
    cli("weights", "import", "ldenhancer", checkpoint)
    document = json.loads(cli("list", "ldenhancer", "--enhancers", "--json")[1])
    (row,) = document["enhancers"]
    assert row["weights"] == "registered: mine.pth"
    assert row["card"]["macs"] == 1_722_695_680
    assert row["card"]["weights"][0]["licence"] == "none stated"
    assert row["options"]["iterations"] == 4


def test_a_card_is_shown_whole(cli):
    status, out, _ = cli("list", "siamrpnpp", "--card")
    assert status == 0
    assert max(map(len, out.splitlines())) <= 100
    words = " ".join(out.split())
    assert "variant r50: 53,950,624 parameters, 48.81 G multiply-accumulates a search crop" in words
    assert "Weights at hand: bundled: compact.safetensors" in words
    assert "licence: CC BY-SA 3.0" in words
    assert "datasets" not in out.lower()
