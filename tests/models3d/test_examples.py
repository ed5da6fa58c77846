"""The models that README and site show: closed, outward, and no flux reaches a back."""

from pathlib import Path

import pytest

import mi_lcair.scenes
from mi_lcair import audit
from mi_lcair.models3d import export, read, report

EXAMPLES = Path(mi_lcair.scenes.__path__[0]) / "examples"
OPTIONS = {"drone": {"names": EXAMPLES / "drone.csv", "forward": "-Z", "up": "Y"}}
OPEN_EDGES = {"box": 4}  # those of the plate below the box


@pytest.mark.slow
@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("*.obj")), ids=lambda path: path.stem)
def test_models_of_the_documentation(path, tmp_path):
    """A plate in the plane of the box's bottom would send 5.44 % of the flux into the box, to the
    backs of its sides.
    """
    model = read(path, **OPTIONS.get(path.stem, {}))
    figures = report(model)
    assert figures["open_edges"] == OPEN_EDGES.get(path.stem, 0)
    for flaw in ("inward", "degenerate", "duplicate", "non_planar"):
        assert figures[flaw] == 0, flaw
    assert figures["back_to_back"]["count"] == figures["one_on_the_other"]["count"] == 0
    export(model, tmp_path / "model")
    result = audit(mi_lcair.load(tmp_path / "model" / "scene.xml"), paths=2**14)
    assert result.total["behind"][0] == 0
    assert all("see nothing (0 K)" in remark for remark in result.remarks)
