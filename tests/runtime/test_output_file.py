"""A file that a command writes is claimed before the work, and never one that mofit has not made."""

import pytest

from mofit.errors import InputError
from mofit.runtime.output_file import PAGE_MARK, PLAN_MARK, output_file


def write(target, content="new", **options):
    with output_file(target, **options) as path:
        path.write_text(content)


def test_a_new_file_is_written_and_nothing_else_stays(tmp_path):
    write(tmp_path / "page.html")
    assert [path.name for path in tmp_path.iterdir()] == ["page.html"]


@pytest.mark.parametrize("force", [None, False, True])
def test_what_mofit_has_not_made_is_never_replaced(force, tmp_path):
    (tmp_path / "thesis.html").write_text("<html>mine</html>")
    with pytest.raises(InputError, match="exists already"):
        write(tmp_path / "thesis.html", force=force)
    assert (tmp_path / "thesis.html").read_text() == "<html>mine</html>"


@pytest.mark.parametrize("mark", [PAGE_MARK, PLAN_MARK])
def test_its_own_file_is_replaced_when_asked(mark, tmp_path):
    write(tmp_path / "page.html", f"{mark} old")
    with pytest.raises(InputError, match="--force"):
        write(tmp_path / "page.html", force=False)
    write(tmp_path / "page.html", force=True)
    assert (tmp_path / "page.html").read_text() == "new"


def test_an_input_is_never_replaced_by_whatever_name(tmp_path):
    (tmp_path / "plan.toml").write_text(PLAN_MARK)
    (tmp_path / "link.toml").symlink_to(tmp_path / "plan.toml")
    for name in ("plan.toml", "link.toml"):
        with pytest.raises(InputError, match="is an input"):
            write(tmp_path / name, force=True, inputs=[tmp_path / "plan.toml"])
    assert (tmp_path / "plan.toml").read_text() == PLAN_MARK


def test_one_writes_and_the_other_says_who(tmp_path):
    with output_file(tmp_path / "page.html"), pytest.raises(InputError, match="has been working on it"):
        write(tmp_path / "page.html")


def test_an_unfinished_file_leaves_nothing(tmp_path):
    def fail(path):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt), output_file(tmp_path / "page.html") as path:
        fail(path)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["", ".", "x" * 300, "absent/page.html", "file/page.html"])
def test_an_unusable_name_is_refused(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").write_text("mine")
    with pytest.raises(InputError, match="--plan"):
        write(name, option="--plan")
