"""Names of files that cannot be: every command refuses them in one sentence."""

from pathlib import Path

import pytest

from faceposer.cli.program import main

NAMES = ["n" * 300, "~nobodyx/x", "circle", "file/below", "zero\0byte", "lone\ud800surrogate"]
COMMANDS = [
    "character info {}.npz",
    "character check {}.npz",
    "character rename {}.npz --title x",
    "train --examples {}.npz -o out.npz",
    "train --examples {} -o out.npz",
    "train --rig {} -o out.npz",
    "train --rig {}.glb -o out.npz",
    "train --markers {}.csv --marker-map {}.json -o out.npz",
    "train --rig shapes --neutral {}.obj -o out.npz",
    "transfer low {}.npz -o out.json",
    "transfer {}.json low -o out.json",
    "transfer {}.obj low -o out.json",
    "solve {}.json -o out.obj",
    "photo low {}.png --pins {}.json -o out.json",
    "sketch low {}.json -o out.json",
    "animate low {}.csv -o out.json",
    "export low --pose {}.obj -o out.json",
    "export low --animation {}.csv -o out.json",
    "export {}.npz -o out.obj",
    "export low -o {}.obj",
    "export low -o {}.json",
]


@pytest.mark.parametrize("command", COMMANDS)
def test_names_that_no_file_can_have(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], command: str
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "shapes").mkdir()
    (tmp_path / "shapes" / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    (tmp_path / "file").write_text("x")
    for suffix in ("", ".npz", ".json", ".glb", ".csv", ".obj", ".png"):
        (tmp_path / f"circle{suffix}").symlink_to(f"circle{suffix}")
    for name in NAMES:
        if command.startswith("export low -o") and name in ("circle", "zero\0byte", "lone\ud800surrogate"):
            continue
        with pytest.raises(SystemExit) as end:
            main([word.format(*[name] * 2) for word in command.split()])
        said = "".join(capsys.readouterr()).strip()
        assert end.value.code == 2, name
        assert said.isprintable(), name
        assert said.endswith("."), said
        assert len(said) < 1001
    assert not list(tmp_path.glob("out.*"))
    assert not list(tmp_path.glob(".*"))
