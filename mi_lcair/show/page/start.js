// Unpack the numbers and plotly, then draw the panels: first those in view, then the others.
// The root element tells by data-ready and data-complete how far this is, and marks of the browser's
// clock with these names tell when.
(async () => {
  document.querySelectorAll("main table.sortable").forEach(makeSortable);
  const root = document.documentElement, places = [...document.querySelectorAll(".panel")];
  const failed = (place, error) => {
    place.append(element("p", { className: "failed", textContent: `This panel cannot be drawn: ${error.message || error}` }));
    console.error(error);
  };
  const draw = async (place, numbers) => {
    const data = revived(JSON.parse(place.firstElementChild.textContent), numbers);
    try { await PANELS[place.dataset.kind](place, data); } catch (error) { failed(place, error); }
    place.classList.add("ready");
  };
  try {
    if (places.length) {
      const [bytes, source] = await Promise.all(["arrays", "plotly"].map(unpacked));
      const numbers = new Float32Array(bytes.buffer);
      document.head.append(element("script", { textContent: new TextDecoder().decode(source) }));
      const isInView = (place) => place.getBoundingClientRect().top < window.innerHeight;
      const first = places.filter(isInView);
      for (const place of first) await draw(place, numbers);
      root.dataset.ready = "yes";
      performance.mark("ready");
      for (const place of places.filter((place) => !first.includes(place))) {
        await new Promise((resolve) => setTimeout(resolve));  // lets the reader scroll and point
        await draw(place, numbers);
      }
    }
  } catch (error) {
    places.forEach((place) => failed(place, error));
  }
  root.dataset.ready = root.dataset.complete = "yes";
  performance.mark("complete");
})();
