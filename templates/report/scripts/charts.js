// A chart that can be looked into: a window on its places, and the axes that belong to it.
const WHOLE = { x: 0, y: 0, w: PLACES, h: PLACES };

// About so wide is a letter.
const LETTER = 6.4;
// A value along the axis across, or the name that stands there.
const across = (data, x) => data.names[Math.round(x) - 1] ?? x;

const windowOn = (svg, data) => {
  const plot = svg.querySelector(".plot"), grid = svg.querySelector(".axes");
  const [left, top, width, height] =
    ["x", "y", "width", "height"].map((name) => Number(plot.getAttribute(name)));
  const view = { ...WHOLE };
  const [across, up] = data.axes;
  const onPaper = (x, y) => [
    left + width * (x - view.x) / view.w,
    top + height * (1 - (y - view.y) / view.h),
  ];
  const onPlot = (event) => {
    const box = plot.getBoundingClientRect(), whole = svg.getBoundingClientRect();
    const unit = whole.width / svg.viewBox.baseVal.width;
    const x = (event.clientX - whole.left) / unit - left;
    const y = (event.clientY - whole.top) / unit - top;
    if (box.width === 0 || x < 0 || y < 0 || x > width || y > height) return null;
    return { x: view.x + view.w * x / width, y: view.y + view.h * (1 - y / height) };
  };
  const axes = () => {
    grid.replaceChildren();
    const within = ([at]) => at >= left - 1e-6 && at <= left + width + 1e-6;
    const named = data.names.map((name, k) => k + 1)
      .filter((value) => within(onPaper(placeOf(across, value), 0)));
    const most = Math.max(3, Math.floor(width / named.length / LETTER) - 1);
    const short = (name) => (name.length <= most ? name : `${name.slice(0, most - 1)}…`);
    for (const value of data.names.length ? named : ticksOf(across, view.x, view.x + view.w)) {
      const [at] = onPaper(placeOf(across, value), 0);
      const words = data.names.length ? short(data.names[value - 1]) : shown(value);
      grid.append(make("path", { d: `M${at} ${top}v${height}` }), make("text",
        { x: at, y: top + height + 16, "text-anchor": "middle" }, words));
      if (data.names.length) grid.lastChild.append(make("title", {}, data.names[value - 1]));
    }
    for (const value of ticksOf(up, view.y, view.y + view.h)) {
      const [, at] = onPaper(0, placeOf(up, value));
      grid.append(make("path", { d: `M${left} ${at}h${width}` }), make("text",
        { x: left - 6, y: at + 4, "text-anchor": "end" }, shown(value)));
    }
  };
  const look = (to) => {
    Object.assign(view, to);
    plot.setAttribute("viewBox", `${view.x} ${PLACES - view.y - view.h} ${view.w} ${view.h}`);
    axes();
  };
  const zoom = (factor, about) => {
    const w = Math.min(view.w * factor, PLACES), h = Math.min(view.h * factor, PLACES);
    if (w < 1 || h < 1) return;
    const { x, y } = about ?? { x: view.x + view.w / 2, y: view.y + view.h / 2 };
    const within = (value, size) => Math.min(Math.max(value, 0), PLACES - size);
    look({ w, h, x: within(x - (x - view.x) / view.w * w, w),
      y: within(y - (y - view.y) / view.h * h, h) });
  };
  return { look, zoom, onPaper, onPlot, view };
};

// Every value that is drawn, with its place.
const placed = (data) => data.series.flatMap((own) => {
  const y = own.y.length ? own.y : own.upper;
  return own.x.map((value, k) => ({
    name: own.name, x: value, y: y[k], lower: own.lower[k], upper: own.upper[k],
    at: [placeOf(data.axes[0], value), placeOf(data.axes[1], y[k])],
  }));
}).filter((one) => Number.isFinite(one.at[0]) && Number.isFinite(one.at[1]));

const chartRows = (data) => [
  ["series", ...data.labels, "lower", "upper"],
  ...data.series.flatMap((own) => own.x.map((value, k) =>
    [own.name, across(data, value), own.y[k], own.lower[k], own.upper[k]])),
];
