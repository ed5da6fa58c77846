"""The study that draws the airliner in a camera's frames."""

import pytest

from docs.studies import camera


@pytest.mark.slow
def test_picture_and_table(tmp_path, monkeypatch, capsys, figures):
    monkeypatch.setattr(camera, "SPP", 18)
    monkeypatch.setattr(camera, "BOUNCES", 1)
    camera.main(tmp_path / "camera.png", ranges=(5000.0,))
    assert (tmp_path / "camera.png").stat().st_size > 3000
    # 5000 m over 50 mm times 15 um are 1.5 m a pixel
    title = figures[0].axes[0].get_title()
    assert title.startswith("5000 m: 12") and title.endswith("pixels on the target")
    assert capsys.readouterr().out.splitlines()[1].startswith("5000     12")
