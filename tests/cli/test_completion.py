"""Shells complete what the command line knows."""

import shutil
import subprocess

import pytest

from mofit.cli import main
from mofit.cli.app import app

#: Calls the function that bash has registered for mofit, as the Tab key does.
PRESS_TAB = """
eval "$(cat)"
complete_mofit=$(complete -p mofit | sed 's/.*-F \\([^ ]*\\).*/\\1/')
COMP_WORDS=("$@") COMP_CWORD=$(($# - 1)) COMP_LINE="$*" COMP_POINT=${#COMP_LINE}
$complete_mofit mofit
printf '%s\\n' "${COMPREPLY[@]}"
"""


def script(shell, capsys):
    assert main(["completion", shell]) == 0
    return capsys.readouterr().out


@pytest.mark.skipif(not shutil.which("bash"), reason="needs bash")
@pytest.mark.parametrize(
    ("typed", "completed"),
    [
        (["ident"], ["identify"]),
        (["identify", "--hold"], ["--hold-out"]),
        (["export", "runs/first", "--to", "re"], ["relaxation"]),
        (["completion", "z"], ["zsh"]),
        (["identify", "--no-such"], [""]),
    ],
)
def test_bash_completes_commands_options_and_choices(typed, completed, capsys):
    done = subprocess.run(
        ["bash", "-c", PRESS_TAB, "bash", "mofit", *typed],
        input=script("bash", capsys),
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.removesuffix("\n").split("\n") == completed


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_every_command_is_in_the_script(shell, capsys):
    text = script(shell, capsys)
    assert [name for name in app if not name.startswith("-") and name not in text] == []


def test_another_shell_is_refused_with_the_choices(capsys):
    assert main(["completion", "tcsh"]) == 2
    said = capsys.readouterr().err
    assert all(shell in said for shell in ("bash", "zsh", "fish"))
