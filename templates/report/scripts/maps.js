// Maps: another load, the value under the pointer, saving.
const enlivenMaps = async (figure, data) => {
  const places = await unpack(data.places);
  const panels = await Promise.all(data.panels.map((panel) => unpack(panel.values)));
  const maps = [...figure.querySelectorAll("svg.map")];
  const slider = figure.querySelector("input"), label = figure.querySelector(".slider output");
  const firsts = [0];
  for (const count of data.counts) firsts.push(firsts.at(-1) + count);
  const { said, button } = toolbar(figure);
  figure.querySelector(".grid").after(said.parentElement);
  said.setAttribute("aria-live", "polite");
  const size = Number(maps[0].querySelector(".spots").getAttribute("stroke-width"));
  const scale = (data.side - size) / data.span;
  const spot = (k) => [
    data.side / 2 + scale * (places[2 * k] - data.middle[0]),
    data.side / 2 - scale * (places[2 * k + 1] - data.middle[1]),
  ];
  const range = () => [firsts[slider.value], firsts[Number(slider.value) + 1]];

  const draw = () => {
    const [from, to] = range();
    label.textContent = data.loads[slider.value];
    maps.forEach((svg, m) => {
      const panel = data.panels[m], colours = data.colours[panel.shades];
      const alike = data.panels.flatMap((p, k) =>
        p.row === panel.row && p.shades === panel.shades ? [...panels[k].slice(from, to)] : []);
      const ends = endsOf(alike, panel.shades), marks = colours.map(() => "");
      for (let k = from; k < to; k++) {
        const value = panels[m][k];
        if (Number.isNaN(value)) continue;
        const [x, y] = spot(k);
        marks[classOf(value, ends, colours.length)] += `M${x.toFixed(1)} ${y.toFixed(1)}h0`;
      }
      svg.querySelectorAll(".spots path").forEach((path, c) => path.setAttribute("d", marks[c]));
      svg.setAttribute("aria-label", `${panel.name}, ${panel.unit}, ${data.loads[slider.value]}`);
      tellScale(svg, ends, panel.unit, colours);
    });
  };
  maps.forEach((svg, m) => svg.addEventListener("pointermove", (event) => {
    const area = svg.querySelector(".spots").getScreenCTM();
    if (!area) return;
    const x = (event.clientX - area.e) / area.a, y = (event.clientY - area.f) / area.d;
    const [from, to] = range();
    let best = -1, least = size ** 2 * 4;
    for (let k = from; k < to; k++) {
      const [a, b] = spot(k), far = (a - x) ** 2 + (b - y) ** 2;
      if (far < least) { least = far; best = k; }
    }
    said.textContent = best < 0 ? "" : `${data.panels[m].name} at x ${shown(places[2 * best])}, ` +
      `y ${shown(places[2 * best + 1])}: ${shown(panels[m][best])} ${data.panels[m].unit}`;
  }));
  slider.addEventListener("input", draw);
  button("SVG", "save the maps as SVG files", () => maps.forEach((svg, m) =>
    saveSvg(fileName(data.name, data.panels[m].name, data.loads[slider.value]), svg)));
  button("CSV", "save the values of all loads as CSV", () => saveCsv(fileName(data.name), [
    ["load", data.x_label, data.y_label, ...data.panels.map((p) => `${p.name}, ${p.unit}`)],
    ...data.loads.flatMap((load, f) => Array.from({ length: data.counts[f] }, (_, j) => {
      const k = firsts[f] + j, short = (value) => Number(value.toPrecision(6));
      return [load, short(places[2 * k]), short(places[2 * k + 1]),
        ...panels.map((own) => short(own[k]))];
    })),
  ]));
  draw();
};
