// The drawing in which a surface is turned: its faces, an arrow, and the bar of colours.
const WIDTH = 570, HEIGHT = 430, MARGIN = 12, BAR = 112, BAR_HEIGHT = 152;
const surfaceIn = (box, data, count) => {
  const svg = make("svg", { class: "solid", viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "img",
    "aria-label": data.alt || data.caption, tabindex: 0 });
  const faces = make("g", { class: "faces" }), warp = make("g", { class: "warp" });
  faces.append(...Array.from({ length: count }, () => make("path")));
  warp.append(make("path", { fill: "none", stroke: "#d55e00", "stroke-width": 2 }),
    make("text", { dx: 6, dy: 4 }, "warp"));
  const at = `translate(${WIDTH - BAR + 8} ${2 * MARGIN})`;
  const bar = make("g", { class: "scale", transform: at });
  const steps = data.colours[data.shades[0].shades].length, each = BAR_HEIGHT / steps;
  for (let k = 0; k < steps; k++) {
    bar.append(make("rect", { y: each * (steps - 1 - k), width: 12, height: each + 0.5 }));
  }
  for (const y of [9, 0.5 * BAR_HEIGHT + 4, BAR_HEIGHT]) bar.append(make("text", { class: "end", x: 16, y }));
  bar.append(make("text", { class: "unit", x: 0, y: BAR_HEIGHT + 16 }));
  svg.append(faces, ...data.warp ? [warp] : [], bar);
  box.replaceChildren(svg);
  return svg;
};

// The middle of the box around all loads, and the scale at which all fits however it is turned.
const fitted = (points, arrow) => {
  const axes = [0, 1, 2].map((i) => points.filter((_, k) => k % 3 === i));
  const middle = axes.map((own) => {
    const [low, high] = [Math.min, Math.max].map((end) => own.reduce((a, b) => end(a, b)));
    return 0.5 * (low + high);
  });
  let radius = 0;
  for (const every of [points, arrow]) {
    for (let k = 0; k < every.length; k += 3) {
      radius = Math.max(radius, Math.hypot(...middle.map((own, i) => every[k + i] - own)));
    }
  }
  return { middle, scale: (Math.min(HEIGHT, WIDTH - BAR) / 2 - MARGIN) / (radius || 1) };
};

// A surface to turn, with mouse, finger or arrow keys.
const enlivenSolid = async (figure, data) => {
  const points = await unpack(data.points);
  const corners = (await unpack(data.faces)).map(Math.round);
  const shades = await Promise.all(data.shades.map((shade) => unpack(shade.values)));
  const [loads, nodes] = data.points.shape, faces = data.faces.shape[0];
  const arrow = data.warp ? await unpack(data.warp) : [];
  const { middle, scale } = fitted(points, arrow), centre = [0.5 * (WIDTH - BAR), 0.5 * HEIGHT];
  const svg = surfaceIn(figure.querySelector(".one"), data, faces);
  const group = svg.querySelector(".faces"), warp = svg.querySelector(".warp");
  const slider = figure.querySelector("input"), label = figure.querySelector(".slider output");
  const choice = figure.querySelector("select");
  const { said, button } = toolbar(figure.querySelector(".one"));
  const paths = [...group.children], order = Array.from({ length: faces }, (_, k) => k);
  const eye = { turn: data.turn, raise: data.raise, scale };
  const ends = data.shades.map((shade, k) => endsOf(shades[k], shade.shades));
  let waiting = false;

  const draw = () => {
    waiting = false;
    const load = Math.min(Number(slider.value), loads - 1), own = Number(choice.value);
    const a = eye.turn * Math.PI / 180, b = eye.raise * Math.PI / 180;
    const [ca, sa, cb, sb] = [Math.cos(a), Math.sin(a), Math.cos(b), Math.sin(b)];
    const at = [], near = [];
    const seen = (every, k) => {
      const [x, y, z] = [0, 1, 2].map((i) => every[3 * k + i] - middle[i]);
      const away = -sa * x + ca * y;
      return [(centre[0] + eye.scale * (ca * x + sa * y)).toFixed(1),
        (centre[1] - eye.scale * (z * cb + away * sb)).toFixed(1), z * sb - away * cb];
    };
    for (let k = 0; k < nodes; k++) {
      const [across, up, nearness] = seen(points, load * nodes + k);
      at.push(`${across} ${up}`);
      near.push(nearness);
    }
    if (warp) {
      const ends = [0, 1, 2, 3, 4].map((k) => seen(arrow, k));
      warp.children[0].setAttribute("d", `M${ends.map((p) => `${p[0]} ${p[1]}`).join("L")}`);
      warp.children[1].setAttribute("x", ends[1][0]);
      warp.children[1].setAttribute("y", ends[1][1]);
    }
    const depth = order.map((_, f) =>
      [0, 1, 2, 3].reduce((sum, i) => sum + near[corners[4 * f + i]], 0));
    const rank = Array.from(depth.keys()).sort((p, q) => depth[p] - depth[q]);
    const shade = data.shades[own], colours = data.colours[shade.shades];
    rank.forEach((f, place) => {
      order[place] = f;
      const value = shades[own][load * faces + f];
      paths[place].setAttribute("d",
        `M${[0, 1, 2, 3].map((i) => at[corners[4 * f + i]]).join("L")}Z`);
      paths[place].setAttribute("fill", Number.isNaN(value) ? "#999"
        : colours[classOf(value, ends[own], colours.length)]);
    });
    label.textContent = `${data.loads[load]}, ${shade.name}`;
    tellScale(svg, ends[own], shade.unit, colours);
  };
  const later = () => { if (!waiting) { waiting = true; requestAnimationFrame(draw); } };
  const turn = (by, up) => {
    eye.turn += by;
    eye.raise = Math.min(Math.max(eye.raise + up, -90), 90);
    later();
  };
  const zoom = (factor) => { eye.scale *= factor; later(); };
  const reset = () => {
    Object.assign(eye, { turn: data.turn, raise: data.raise, scale });
    later();
  };

  svg.addEventListener("pointerdown", (event) => {
    svg.setPointerCapture(event.pointerId);
    svg.focus({ preventScroll: true });
  });
  svg.addEventListener("pointermove", (event) => {
    if (svg.hasPointerCapture(event.pointerId)) {
      turn(-0.5 * event.movementX, 0.5 * event.movementY);
      return;
    }
    const place = paths.indexOf(event.target), own = Number(choice.value);
    const load = Math.min(Number(slider.value), loads - 1);
    said.textContent = place < 0 ? "" : `${data.shades[own].name}: ` +
      `${shown(shades[own][load * faces + order[place]])} ${data.shades[own].unit}`;
  });
  onKeys(svg, {
    ArrowLeft: () => turn(5, 0), ArrowRight: () => turn(-5, 0), ArrowUp: () => turn(0, 5),
    ArrowDown: () => turn(0, -5), "+": () => zoom(1.2), "-": () => zoom(1 / 1.2), 0: reset,
  });
  slider.addEventListener("input", later);
  choice.addEventListener("input", later);
  svg.append(make("title", {}, "Drag it, or use the arrow keys, to turn it"));
  button("+", "larger", () => zoom(1.2));
  button("−", "smaller", () => zoom(1 / 1.2));
  button("as at first", "turn it back", reset);
  button("SVG", "save as SVG", () => saveSurface(svg, data));
  draw();
};

// The surface as a file: with the letters' look, which the page's style holds.
const saveSurface = (svg, data) => {
  const copy = svg.cloneNode(true), [, , width, height] = svg.getAttribute("viewBox").split(" ");
  for (const [key, value] of Object.entries({ xmlns: "http://www.w3.org/2000/svg", width, height,
    "font-family": "sans-serif", "font-size": 12 })) copy.setAttribute(key, value);
  copy.querySelector(".faces").setAttribute("stroke", "#0006");
  copy.querySelector(".faces").setAttribute("stroke-width", "0.5");
  copy.prepend(make("rect", { width, height, fill: "#fff" }));
  const load = data.loads[svg.closest("figure").querySelector("input").value];
  save(`${fileName(data.name, load)}.svg`, "image/svg+xml", new XMLSerializer().serializeToString(copy));
};
