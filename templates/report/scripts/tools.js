// Small things that all figures of the page use.
const make = (name, attributes = {}, text = "") => {
  const node = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
  node.textContent = text;
  return node;
};

const toolbar = (below) => {
  const bar = document.createElement("div");
  bar.className = "tools";
  const said = document.createElement("output");
  said.setAttribute("aria-live", "polite");
  bar.append(said);
  below.append(bar);
  const button = (words, title, action) => {
    const made = document.createElement("button");
    made.type = "button";
    made.textContent = words;
    made.title = title;
    made.setAttribute("aria-label", title);
    made.addEventListener("click", action);
    said.before(made);
  };
  return { said, button };
};

const shown = (value) => {
  if (value === null || Number.isNaN(value)) return "–";
  return String(Number(value.toPrecision(4))).replace("-", "−");
};

const save = (name, kind, text) => {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([text], { type: kind }));
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
};

const fileName = (...words) => words.filter(Boolean).join("-").replace(/[^\p{L}\p{N}.]+/gu, "-");

const saveCsv = (name, rows) => {
  const cell = (value) => {
    const text = value === null || value === undefined || Number.isNaN(value) ? "" : String(value);
    return /[",\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text;
  };
  save(`${name}.csv`, "text/csv", rows.map((row) => row.map(cell).join(",") + "\n").join(""));
};

const onKeys = (node, keys) => node.addEventListener("keydown", (event) => {
  if (event.key in keys) { keys[event.key](); event.preventDefault(); }
});

// Sixteen bits a number, deflated, in base 64.
const MISSING = 65535;
const unpack = async (packed) => {
  const bytes = Uint8Array.from(atob(packed.data), (letter) => letter.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  const view = new DataView(await new Response(stream).arrayBuffer());
  return Float64Array.from({ length: view.byteLength / 2 }, (_, k) => {
    const steps = view.getUint16(2 * k, true);
    return steps === MISSING ? NaN : packed.least + packed.step * steps;
  });
};

const endsOf = (values, shades) => {
  let low = Infinity, high = -Infinity;
  for (const value of values) {
    if (value < low) low = value;
    if (value > high) high = value;
  }
  if (low > high) return [0, 1];
  if (shades === "about zero") {
    const most = Math.max(Math.abs(low), Math.abs(high)) || 1;
    return [-most, most];
  }
  return high > low ? [low, high] : [low, low + 1];
};

const classOf = (value, [low, high], count) =>
  Math.min(Math.max(Math.floor((value - low) / (high - low) * count), 0), count - 1);

const tellScale = (svg, [low, high], unit, colours) => {
  const short = (value) => shown(Number(value.toPrecision(3)));
  const texts = svg.querySelectorAll(".scale .end");
  [high, 0.5 * (low + high), low].forEach((value, k) => { texts[k].textContent = short(value); });
  svg.querySelector(".scale .unit").textContent = unit;
  svg.querySelectorAll(".scale rect").forEach((bar, k) => bar.setAttribute("fill", colours[k]));
};
