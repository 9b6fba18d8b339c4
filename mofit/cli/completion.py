"""The command that teaches a shell the others: completion."""

from __future__ import annotations

from typing import Annotated, Literal

from cyclopts import Parameter

from mofit.cli.app import DONE, app


@app.command
def completion(shell: Annotated[Literal["bash", "zsh", "fish"], Parameter(show_choices=True)], /) -> int:
    """Print a script that lets a shell complete commands, options and their choices with the Tab key.

    It prints only: no file of the shell is touched. The script loads no part of mofit when it completes.

    Example: mofit completion bash > ~/.local/share/bash-completion/completions/mofit

    Parameters
    ----------
    shell
        Shell to write the script for.
    """
    print(app.generate_completion(shell=shell))
    return DONE
