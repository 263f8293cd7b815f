import json
import sys
from pathlib import Path

import pytest

from mhvedit.errors import MissingLibrary
from mhvedit.viewer.notebook import inline

NOTEBOOK = Path(__file__).resolve().parents[2] / "examples" / "viewer_notebook.ipynb"


def test_the_example_draws_a_picture(made: Path) -> None:
    cells = ["".join(c["source"]) for c in json.loads(NOTEBOOK.read_text())["cells"] if c["cell_type"] == "code"]
    first, served, drawn = cells
    assert "inline(OUT)" in served
    names: dict[str, object] = {}
    *before, last = drawn.splitlines()
    for code in (first, f"OUT = {str(made / 'out')!r}", "\n".join(before), f"picture = {last}"):
        exec(compile(code, NOTEBOOK.name, "exec"), names)
    assert names["picture"].size == (1600, 900)  # type: ignore[attr-defined]
    names["session"].close()  # type: ignore[attr-defined]


def test_outside_a_notebook_one_sentence_says_what_to_install(made: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "IPython.display", None)
    with pytest.raises(MissingLibrary, match="pip install notebook"):
        inline(made / "out")
