"""The comparison of imported scenes with Mitsuba's images sees what differs."""

from docs.studies import imported

SCENE = """<scene version="3.0.0">
    <integrator type="path"/>
    <sensor type="perspective">
        <transform name="to_world"> <lookat origin="0, 0, 4" target="0, 0, 0" up="0, 1, 0"/>
        </transform>
        <film type="hdrfilm"> <integer name="width" value="64"/> </film>
    </sensor>
    <shape type="rectangle"> <bsdf type="diffuse"/> </shape>
    <shape type="sphere"> <float name="radius" value="0.4"/> <bsdf type="diffuse"/> </shape>
</scene>"""


def test_scenes_are_compared(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(imported, "SPP", 32)
    (tmp_path / "scene.xml").write_text(SCENE)
    (tmp_path / "none.xml").write_text("<scene version='3.0.0'> <shape type='none'/> </scene>")
    imported.main(str(tmp_path))
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("scene.xml: agrees: mean") and lines[1:] == ["1 agrees"]
    monkeypatch.setattr(imported, "RADIANCE", 1.02 * imported.RADIANCE)
    assert imported.compared(tmp_path / "scene.xml").startswith("differs: mean")
