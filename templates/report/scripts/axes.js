// Round numbers along an axis, as the page's own drawing has them.
const linearTicks = (low, high) => {
  const rough = (high - low) / 5;
  if (!(rough > 0)) return [low];
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((k) => k * power).find((s) => s >= rough * (1 - 1e-9));
  const found = [];
  for (let k = Math.ceil(low / step - 1e-9); k <= high / step + 1e-9; k++) found.push(k * step);
  return found;
};

const logTicks = (low, high) => {
  if (high < 5 * low) return linearTicks(low, high);
  const first = Math.floor(Math.log10(low) + 1e-9), last = Math.ceil(Math.log10(high) - 1e-9);
  const every = Math.max(1, Math.ceil((last - first) / 7));
  const parts = last - first <= 3 ? [1, 2, 5] : [1];
  const found = [];
  for (let p = first; p <= last; p += every) for (const k of parts) found.push(k * 10 ** p);
  return found.filter((v) => v >= low * (1 - 1e-9) && v <= high * (1 + 1e-9));
};

// Places from 0 to 1000 along an axis, and back.
const PLACES = 1000;
const placeOf = (axis, value) => {
  if (value === null || (axis.log && value <= 0)) return NaN;
  const f = axis.log ? Math.log10 : (v) => v;
  return PLACES * (f(value) - f(axis.low)) / (f(axis.high) - f(axis.low));
};
const valueAt = (axis, place) => {
  const share = place / PLACES;
  return axis.log ? axis.low * (axis.high / axis.low) ** share
    : axis.low + (axis.high - axis.low) * share;
};
const ticksOf = (axis, from, to) =>
  (axis.log ? logTicks : linearTicks)(valueAt(axis, from), valueAt(axis, to));
