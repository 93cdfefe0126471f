// Maps: another load, the value under the pointer, saving.
const enlivenMaps = async (figure, data) => {
  const { maps, views } = data, places = await unpack(maps.places);
  const panels = await Promise.all(maps.panels.map((panel) => unpack(panel.values)));
  const slider = figure.querySelector("input"), label = figure.querySelector(".slider output");
  const firsts = [0];
  for (const count of maps.counts) firsts.push(firsts.at(-1) + count);
  const { said, button } = toolbar(figure);
  figure.querySelector(".grid").after(said.parentElement);
  const drawn = [];
  for (const [k, spec] of views.entries()) {
    const { view, svg } = await viewIn(figure.querySelectorAll(".view")[k], spec);
    drawn.push({ view, svg, spec, ...enliven(view, svg, spec, maps.name, { said }) });
  }
  const short = (value) => (Number.isNaN(value) ? null : Number(value.toPrecision(6)));
  const draw = () => {
    const load = Number(slider.value), x = [], y = [];
    label.textContent = maps.loads[load];
    for (let k = firsts[load]; k < firsts[load + 1]; k++) {
      x.push(short(places[2 * k]));
      y.push(short(places[2 * k + 1]));
    }
    drawn.forEach(({ view, svg, spec, set, fill }, m) => {
      const values = [...panels[m].slice(firsts[load], firsts[load + 1])].map(short);
      const own = { x, y, values }, { name, unit } = maps.panels[m];
      spec.data[0].values = [own];
      view.data("s0", [{ ...own }]);
      view.resize();  // labels of another load may be longer
      set({ ends: maps.ends[load][m] });
      fill();
      svg.setAttribute("aria-label", `${name}, ${unit}, ${maps.loads[load]}`);
    });
  };
  slider.addEventListener("input", draw);
  button("SVG", "save the maps as SVG files", () => drawn.forEach(({ view }, m) =>
    saveView(fileName(maps.name, maps.panels[m].name, maps.loads[slider.value]), view)));
  button("CSV", "save the values of all loads as CSV", () => saveCsv(fileName(maps.name), [
    ["load", maps.x_label, maps.y_label, ...maps.panels.map((p) => `${p.name}, ${p.unit}`)],
    ...maps.loads.flatMap((load, f) => Array.from({ length: maps.counts[f] }, (_, j) => {
      const k = firsts[f] + j;
      return [load, ...[places[2 * k], places[2 * k + 1], ...panels.map((own) => own[k])].map(short)];
    })),
  ]));
  draw();
};
