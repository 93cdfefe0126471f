// A chart that Vega draws: the value under the pointer, zoom, saving.
const OPTIONS = { mode: "vega", ast: true, renderer: "svg", actions: false, defaultStyle: false,
  tooltip: false, hover: false };

const viewIn = async (box, spec) => {
  const { view } = await vegaEmbed(box, spec, OPTIONS);
  const svg = box.querySelector("svg");
  const [width, height] = ["width", "height"].map((name) => svg.getAttribute(name));
  svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
  for (const name of ["width", "height"]) svg.removeAttribute(name);
  svg.setAttribute("class", "chart");
  svg.setAttribute("role", "img");
  svg.setAttribute("tabindex", "0");
  svg.setAttribute("aria-label", spec.usermeta.alt);
  return { view, svg };
};

// Where an event is in the plot, in its own units; null beside it.
const placeOf = (view, svg, event) => {
  const all = svg.getBoundingClientRect(), unit = all.width / svg.viewBox.baseVal.width;
  const [left, top] = view.origin();
  const x = (event.clientX - all.left) / unit - left, y = (event.clientY - all.top) / unit - top;
  return x < 0 || y < 0 || x > view.width() || y > view.height() ? null : [x, y];
};

// What the value under the pointer is, in a box beside it that stays within the window.
const tip = document.createElement("div");
tip.className = "tip";
tip.hidden = true;
tip.setAttribute("aria-hidden", "true");
document.body.append(tip);
const tipAt = (svg, view, [x, y], words) => {
  const all = svg.getBoundingClientRect(), unit = all.width / svg.viewBox.baseVal.width;
  const [left, top] = view.origin();
  tip.textContent = words;
  tip.hidden = false;
  const across = all.left + (left + x) * unit + 12, wide = document.documentElement.clientWidth;
  tip.style.left = `${Math.max(4, Math.min(across, wide - tip.offsetWidth - 4))}px`;
  tip.style.top = `${all.top + (top + y) * unit - tip.offsetHeight - 10}px`;
};

const rowsOf = (spec) => spec.data.flatMap(({ values: [own] }, k) => (own.x ?? []).map((x, i) => ({
  name: spec.usermeta.series[k], x, y: (own.y ?? own.upper)[i], lower: own.lower?.[i] ?? null,
  upper: own.upper?.[i] ?? null, value: own.values?.[i] ?? null })));

const enliven = (view, svg, spec, name, bar) => {
  const { labels: [across, up], y_names: rowNames, scale, title } = spec.usermeta;
  const ordinate = (y) => rowNames[Math.round(y) - 1] ?? shown(y);
  const { said, button } = bar, whole = [view.signal("xs"), view.signal("ys")];
  let rows = [], current = -1, begun = null;
  const placed = (row) => [view.scale("x")(row.x), view.scale("y")(row.y)];
  const known = (row) => row.x !== null && row.y !== null && placed(row).every(Number.isFinite);
  const fill = () => { rows = rowsOf(spec).filter(known); };
  const set = (signals) => {
    for (const [key, value] of Object.entries(signals)) view.signal(key, value);
    return view.run();
  };
  const tell = (k) => {
    const one = rows[current = k];
    set({ spot: one ? placed(one) : null, box: [0, 0, 0, 0] });
    if (!one) { said.textContent = ""; tip.hidden = true; return; }
    const band = one.lower === null || one.upper === null ? ""
      : ` (${shown(one.lower)} to ${shown(one.upper)})`;
    const value = one.value === null ? "" : `; ${title} ${shown(one.value)} ${scale}`;
    said.textContent = `${one.name ? `${one.name}: ` : ""}${across} ${shown(one.x)}; ` +
      `${up} ${ordinate(one.y)}${band}${value}`;
    tipAt(svg, view, placed(one), said.textContent);
  };
  const nearest = ([px, py]) => {
    let best = -1, least = Infinity;
    rows.forEach((row, k) => {
      const [x, y] = placed(row), far = (x - px) ** 2 + (y - py) ** 2;
      if (far < least) { least = far; best = k; }
    });
    return best;
  };
  const part = (x0, y0, x1, y1) => {
    const [x, y] = ["x", "y"].map((key) => view.scale(key));
    set({ xs: [x.invert(x0), x.invert(x1)], ys: [y.invert(y1), y.invert(y0)] });
    tell(current);
  };
  const zoom = (factor) => {
    const [w, h] = [view.width(), view.height()];
    const [x, y] = rows[current] ? placed(rows[current]) : [w / 2, h / 2];
    part(x - x * factor, y - y * factor, x + (w - x) * factor, y + (h - y) * factor);
  };
  const reset = () => { set({ xs: whole[0], ys: whole[1] }); tell(-1); };
  fill();
  svg.addEventListener("pointermove", (event) => {
    const at = placeOf(view, svg, event);
    if (at && begun) set({ box: [...begun, ...at] });
    else if (at) tell(nearest(at));
  });
  svg.addEventListener("pointerdown", (event) => {
    if (event.pointerType !== "mouse" || event.button) return;
    begun = placeOf(view, svg, event);
    if (begun) event.preventDefault();
  });
  svg.addEventListener("pointerup", (event) => {
    const at = placeOf(view, svg, event), from = begun;
    begun = null;
    if (!from || !at || Math.abs(at[0] - from[0]) < 8 || Math.abs(at[1] - from[1]) < 8) return;
    current = -1;
    part(...[0, 1].map((k) => Math.min(at[k], from[k])),
      ...[0, 1].map((k) => Math.max(at[k], from[k])));
  });
  svg.addEventListener("pointerleave", () => { begun = null; tell(-1); });
  svg.addEventListener("dblclick", reset);
  onKeys(svg, {
    ArrowRight: () => tell(Math.min(current + 1, rows.length - 1)),
    ArrowLeft: () => tell(Math.max(current - 1, 0)),
    "+": () => zoom(0.5), "-": () => zoom(2), 0: reset, Escape: reset,
  });
  if (button) {
    button("+", "zoom in", () => zoom(0.5));
    button("−", "zoom out", () => zoom(2));
    button("whole", "show the whole chart", reset);
    button("SVG", "save as SVG", () => saveView(fileName(name, title), view));
    button("CSV", "save the values as CSV", () => saveCsv(fileName(name, title), [
      ["series", across, up, "lower", "upper"],
      ...rowsOf(spec).map((row) => [row.name, row.x, rowNames[Math.round(row.y) - 1] ?? row.y, row.lower, row.upper]),
    ]));
  }
  return { set, fill };
};

const saveView = async (name, view) => save(`${name}.svg`, "image/svg+xml", await view.toSVG());

const enlivenCharts = async (figure, data) => {
  for (const [k, spec] of data.views.entries()) {
    const box = figure.querySelectorAll(".view")[k];
    const { view, svg } = await viewIn(box, spec);
    enliven(view, svg, spec, data.name, toolbar(box.parentElement));
  }
};
