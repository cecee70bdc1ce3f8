"""What the documentation says exists, and what exists is documented."""

from __future__ import annotations

import ast
import inspect
import re
from importlib import import_module
from pathlib import Path

import pytest

import monodyn
from docstrings import Rules, violations
from monodyn.cli.options import COMMANDS
from monodyn.cli.parse import parsed
from monodyn.settings import RunSettings
from monodyn.settings_file import run_toml

ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "src" / "monodyn"
README = (ROOT / "README.md").read_text(encoding="utf-8")
ARCHITECTURE = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")

AXES = (
    "row column sample record piece knot term step entry key pose picture plane colour channel pixel geom "
    "corner face shared block local tied free size unknown variable candidate inequality form way direction M"
    " subframe exposure iteration outline draw feature belief motor quantity"
)
"""Array axes of single rooms and of the benchmarks, in addition to those that docs/architecture.md lists."""

WHOLE = '''
@dataclass(frozen=True)
class Track:
    """Positions.

    Attributes:
        time: Time stamps [s], (frame,).
    """

    time: np.ndarray

    def part(self, first: int, rows: np.ndarray, *names: str) -> np.ndarray:
        """Cut by eq. (3) of a paper.

        Args:
            first: Where.
            rows: Which,
                (row, 2 dof + 1).
            names: Of what.

        Returns:
            Positions, (..., dof).

        Raises:
            FitError: Nothing is left.

        Source:
            The paper.
        """
        raise FitError("Nothing.")
'''
CHANGES = {
    "names: Of what.": ("name: Of what.", "'Args:' has 'name', which is no argument"),
    "            first: Where.\n": ("", "argument 'first' has no entry under 'Args:'"),
    "(row, 2 dof + 1)": ("(row, 2 things)", "argument 'rows' is an array without its shape"),
    "Positions, (..., dof)": (
        "Positions, (dof, 14)",
        "the result has the shape (dof, 14) with the number 14",
    ),
    "(..., dof)": ("by joint", "the result is an array without its shape"),
    "Returns:\n            Pos": ("Note:\n            Pos", "has no 'Returns:'"),
    "FitError: Nothing": ("ValueError: Nothing", "raises FitError, which 'Raises:' does not list"),
    "FitError: Nothing is left.\n": (
        "FitError: .\n            Lost: .\n",
        "lists 'Lost', which is no exception",
    ),
    "        Source:\n            The paper.\n": ("", "cited without its source"),
    "        time: Time stamps [s], (frame,).\n": ("", "field 'time' has no entry under 'Attributes:'"),
    "[s], (frame,)": ("[s]", "field 'time' is an array without its shape"),
    "        time: Time": (
        "        rate: One.\n        time: Time",
        "'Attributes:' has 'rate', which is no field",
    ),
}
"""What to change in ``WHOLE``, into what, and what is found then."""


def rules() -> Rules:
    """Read the names of the array axes and of the exceptions."""
    listed = re.search(r"Array axes: ([^.]*)\.", ARCHITECTURE)
    assert listed
    errors = ast.parse((SOURCE / "errors.py").read_text(encoding="utf-8")).body
    return Rules(
        axes=frozenset(re.findall(r"\w+", listed[1])) | {*AXES.split()},
        errors=frozenset(node.name for node in errors if isinstance(node, ast.ClassDef)),
    )


def shell_lines() -> list[str]:
    blocks = re.findall(r"```sh\n(.*?)```", README, re.DOTALL)
    return [line.strip() for block in blocks for line in block.splitlines() if line.strip()]


@pytest.mark.parametrize("name", monodyn.__all__)
def test_public_names_load_and_have_a_docstring(name: str) -> None:
    value = getattr(monodyn, name)
    if name != "__version__":
        assert (inspect.getdoc(value) or "").strip()


def test_unknown_names_are_refused_with_the_known_ones() -> None:
    with pytest.raises(
        AttributeError, match=r"^module 'monodyn' has no attribute 'nothing'; public names: .*track"
    ):
        monodyn.nothing  # noqa: B018


@pytest.mark.parametrize(
    "path",
    [
        path
        for folder in (SOURCE, ROOT / "benchmarks", ROOT / "examples")
        for path in sorted(folder.rglob("*.py"))
    ],
    ids=lambda path: str(path.relative_to(SOURCE if path.is_relative_to(SOURCE) else ROOT)),
)
def test_docstrings_of_public_functions_and_data_are_whole(path: Path) -> None:
    found = violations(path.read_text(encoding="utf-8"), rules())
    assert not found, "\n" + "\n".join(f"{path.relative_to(ROOT)}:{line}" for line in found)


def test_a_docstring_that_lacks_something_is_found() -> None:
    assert violations(WHOLE, rules()) == []
    for old, (new, complaint) in CHANGES.items():
        assert WHOLE.count(old) == 1, old
        found = violations(WHOLE.replace(old, new), rules())
        assert any(complaint in line for line in found), (old, found)


@pytest.mark.parametrize("line", [line for line in shell_lines() if line.startswith("monodyn ")])
def test_commands_in_the_readme_parse(line: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("run").mkdir()
    written = run_toml("run", {"clip": "clip.mp4", "model": "double.xml"}, RunSettings())
    Path("run/run.toml").write_text(written, encoding="utf-8")
    command, *words = line.split()[1:]
    assert command in COMMANDS
    assert isinstance(parsed(command, words), COMMANDS[command][0])


def test_make_targets_in_the_readme_exist() -> None:
    targets = set(re.findall(r"^(\w+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE))
    named = set(re.findall(r"`make (\w+)`", README)) | {
        line.split()[1] for line in shell_lines() if line.startswith("make ")
    }
    assert {"demo", "test", "check", "fmt", "bench", "docs"} <= named <= targets


def test_files_in_the_readme_exist() -> None:
    named = set(re.findall(r"(?:examples|docs)/[\w./]+", README))
    assert named
    assert all((ROOT / name).exists() for name in named)


@pytest.mark.parametrize(
    "page", [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))], ids=lambda page: page.name
)
def test_every_row_of_a_table_has_the_cells_of_its_head(page: Path) -> None:
    """What stands after the last bar of a row is shown nowhere."""
    for table in re.findall(r"(?:^\|.*\n)+", page.read_text(encoding="utf-8"), re.MULTILINE):
        rows = table.splitlines()
        bars = {len(re.findall(r"(?<!\\)\|", row)) for row in rows}
        assert len(bars) == 1, rows[0]
        assert all(row.rstrip().endswith("|") for row in rows), rows[0]


def test_the_page_on_filming_shows_its_pictures() -> None:
    page = (ROOT / "docs" / "filming.md").read_text(encoding="utf-8")
    shown = set(re.findall(r"\]\((filming/\w+\.jpg)\)", page))
    assert shown == {f"filming/{path.name}" for path in (ROOT / "docs" / "filming").iterdir()}
    # good and bad side by side
    assert len(shown) == 2 * page.count("\n## ")


def test_the_readme_of_the_benchmarks_names_every_script() -> None:
    folder = ROOT / "benchmarks"
    named = set(re.findall(r"(\w+\.py)\b", (folder / "README.md").read_text(encoding="utf-8")))
    here = {path.name for path in folder.glob("*.py")}
    scripts = {name for name in here if "__main__" in (folder / name).read_text(encoding="utf-8")}
    assert scripts <= named <= here


def test_verbs_in_the_documents_exist() -> None:
    for name in re.findall(r"monodyn\.(\w+)\(", README + ARCHITECTURE):
        assert name in monodyn.__all__


def test_the_run_folder_in_the_readme_is_the_one_written() -> None:
    from monodyn.results.folder import DRAWN, FILES

    table = README.split("### The run folder")[1].split("\n### ")[0]
    # of the models that are drawn the first stands for all
    assert set(re.findall(r"`(\w+\.\w+)`", table)) == {*FILES} - {*DRAWN[1:]}


def test_equations_name_functions_and_tests_that_exist():
    text = (ROOT / "docs" / "equations.md").read_text(encoding="utf-8")
    rows = [line.split(" | ") for line in text.splitlines() if line.startswith("| ") and " | `" in line]
    assert len(rows) >= 25
    for row in rows:
        for name in re.findall(r"`([\w.]+)`", row[1]):
            module, _, function = name.rpartition(".")
            assert hasattr(import_module(f"monodyn.{module}"), function), name
        file = ""
        for mention in re.findall(r"`([^`]+)`", row[2]):
            file, test = mention.split(": ") if ": " in mention else (file, mention)
            path = next((ROOT / "tests").rglob(file))
            assert f"def {test}(" in path.read_text(encoding="utf-8"), mention
        assert ": test_" in row[2], row[0]
        assert row[3].startswith(("*as printed*", "*as read*", "*ours*")), row[0]
