"""The picture of a report page, taken in Chromium, and how long the page takes to open.

python -m docs.studies.report

It needs Chromium and the package playwright. The environment variable MI_LCAIR_BROWSER names
another browser. The picture is docs/pictures/report.png.
"""

from pathlib import Path
from tempfile import TemporaryDirectory

from PIL import Image
from playwright.sync_api import sync_playwright

import mi_lcair
from tests.show.page.conftest import COMPLETE, FLAGS, PATIENCE, browser_path

PICTURE = Path(__file__).parents[1] / "pictures" / "report.png"
WIDTH, HEIGHT = 1200, 1000  # pixels of the window
# Panels that are shown, and where the pointer is, as fractions of the picture's width and height
CHOSEN = {"image": (0.47, 0.44), "model": (0.57, 0.52)}


def main():
    with TemporaryDirectory() as folder:
        page = Path(folder) / "page.html"
        mi_lcair.report("a340_landing", page, parameters={"position": 3}, spp=256)
        panels = photographs(page, Path(folder))
    height = sum(panel.height for panel in panels)
    picture = Image.new("RGB", (WIDTH, height), "white")
    top = 0
    for panel in panels:
        picture.paste(panel, (0, top))
        top += panel.height
    picture.save(PICTURE, optimize=True)
    print(f"{PICTURE}: {PICTURE.stat().st_size / 1000:.0f} kB")


def photographs(page: Path, folder: Path) -> list[Image.Image]:
    """Pictures of the panels, with the pointer on the aircraft."""
    found = []
    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=browser_path(), args=FLAGS)
        view = browser.new_page(viewport={"width": WIDTH, "height": HEIGHT})
        view.goto(page.as_uri())
        view.wait_for_selector(COMPLETE, timeout=PATIENCE)
        # What is in view is drawn first and can be used while the rest is drawn
        in_view, drawn = (
            view.evaluate(f"performance.getEntriesByName('{name}')[0].startTime") / 1000
            for name in ("ready", "complete")
        )
        print(
            f"{page.stat().st_size / 1e6:.1f} MB; what is in view is drawn {in_view:.1f} s after "
            f"the browser opened it, and all of it after {drawn:.1f} s"
        )
        for kind, place in CHOSEN.items():
            panel = view.locator(f".panel[data-kind={kind}]").first
            panel.evaluate("(panel) => panel.scrollIntoView({behavior: 'instant'})")
            box = view.locator(f".panel[data-kind={kind}] .plot").first.bounding_box()
            x, y = (box[side] * share for side, share in zip(("width", "height"), place))
            view.mouse.move(box["x"] + x - 3, box["y"] + y)
            view.mouse.move(box["x"] + x, box["y"] + y)
            view.wait_for_function("!document.getElementById('tip').hidden", timeout=PATIENCE)
            view.wait_for_timeout(500)
            area = panel.bounding_box()
            file = folder / f"{kind}.png"
            view.screenshot(path=file)  # a part would be taken in a window of another size
            seen = Image.open(file).convert("RGB")
            found.append(seen.crop((0, area["y"], WIDTH, area["y"] + area["height"])))
        browser.close()
    return found


if __name__ == "__main__":
    main()
