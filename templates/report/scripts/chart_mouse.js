// What a chart does with mouse and keys: values, zoom, saving.
const enliven = (svg, data, name) => {
  const values = placed(data), seen = windowOn(svg, data);
  const pointer = svg.querySelector(".pointer");
  const { said, button } = toolbar(svg.parentElement);
  const file = fileName(name, data.title);
  let current = -1, begun = null;
  said.setAttribute("aria-live", "polite");
  svg.setAttribute("tabindex", "0");

  const tell = (k) => {
    current = k;
    pointer.replaceChildren();
    const one = values[k];
    if (!one) { said.textContent = ""; return; }
    const [cx, cy] = seen.onPaper(...one.at);
    pointer.append(make("circle", { cx, cy, r: 5 }));
    const band = Number.isFinite(one.lower) && Number.isFinite(one.upper)
      ? ` (${shown(one.lower)} to ${shown(one.upper)})` : "";
    const [x, y] = data.labels, at = across(data, one.x);
    const where = typeof at === "string" ? at : shown(at);
    said.textContent =
      `${one.name ? `${one.name}: ` : ""}${x} ${where}; ${y} ${shown(one.y)}${band}`;
  };
  const nearest = (at) => {
    let best = -1, least = Infinity;
    const [px, py] = seen.onPaper(at.x, at.y);
    values.forEach((one, k) => {
      const [x, y] = seen.onPaper(...one.at);
      const far = (x - px) ** 2 + (y - py) ** 2;
      if (far < least) { least = far; best = k; }
    });
    return best;
  };
  const reset = () => { seen.look(WHOLE); tell(-1); };
  const closer = (factor) => { seen.zoom(factor, values[current] && {
    x: values[current].at[0], y: values[current].at[1] }); tell(current); };

  svg.addEventListener("pointermove", (event) => {
    const at = seen.onPlot(event);
    if (!at) return;
    if (begun) {
      const [x0, y0] = seen.onPaper(begun.x, begun.y), [x1, y1] = seen.onPaper(at.x, at.y);
      pointer.replaceChildren(make("rect", { x: Math.min(x0, x1), y: Math.min(y0, y1),
        width: Math.abs(x1 - x0), height: Math.abs(y1 - y0) }));
    } else tell(nearest(at));
  });
  svg.addEventListener("pointerdown", (event) => {
    if (event.pointerType === "mouse" && event.button === 0) {
      begun = seen.onPlot(event);
      if (begun) event.preventDefault();
    }
  });
  svg.addEventListener("pointerup", (event) => {
    const at = seen.onPlot(event), from = begun;
    begun = null;
    if (!from || !at) return;
    const w = Math.abs(at.x - from.x), h = Math.abs(at.y - from.y);
    if (w > 0.02 * seen.view.w && h > 0.02 * seen.view.h) {
      seen.look({ x: Math.min(at.x, from.x), y: Math.min(at.y, from.y), w, h });
    }
    tell(-1);
  });
  svg.addEventListener("pointerleave", () => { begun = null; tell(-1); });
  svg.addEventListener("dblclick", reset);
  svg.addEventListener("keydown", (event) => {
    const keys = {
      ArrowRight: () => tell(Math.min(current + 1, values.length - 1)),
      ArrowLeft: () => tell(Math.max(current - 1, 0)),
      "+": () => closer(0.5), "-": () => closer(2), 0: reset, Escape: reset,
    };
    if (event.key in keys) { keys[event.key](); event.preventDefault(); }
  });
  button("+", "zoom in", () => closer(0.5));
  button("−", "zoom out", () => closer(2));
  button("whole", "show the whole chart", reset);
  button("SVG", "save as SVG", () => saveSvg(file, svg));
  button("CSV", "save the values as CSV", () => saveCsv(file, chartRows(data)));
};

const enlivenCharts = (figure, data) => {
  figure.querySelectorAll("svg.chart").forEach((svg, k) => enliven(svg, data.charts[k], data.name));
};
