// Arrays come as base64 of small integers; the highest integer stands for "not known".

const MISSING = "\u2013";
const MINUS = "\u2212";

function bytesOf(text) {
  const raw = atob(text);
  const bytes = new Uint8Array(raw.length);
  for (let i = 0; i < raw.length; i += 1) bytes[i] = raw.charCodeAt(i);
  return bytes;
}

function decodeBytes(text, steps) {
  return Float64Array.from(bytesOf(text), (value) => (value === 255 ? NaN : value / steps));
}

function decodeWords(text, steps) {
  const view = new DataView(bytesOf(text).buffer);
  const values = new Float64Array(view.byteLength / 2);
  for (let i = 0; i < values.length; i += 1) {
    const word = view.getUint16(2 * i, true);
    values[i] = word === 65535 ? NaN : word / steps;
  }
  return values;
}

function isKnown(value) {
  return value !== null && value !== undefined && !Number.isNaN(value);
}

function shown(value, decimals = 3) {
  if (!isKnown(value)) return MISSING;
  if (typeof value !== "number") return String(value);
  return value.toFixed(decimals).replace("-", MINUS);
}

function signed(value, decimals = 1) {
  if (!isKnown(value)) return "";
  const text = Math.abs(value).toFixed(decimals);
  return (Number(text) === 0 ? "\u00b1" : value < 0 ? MINUS : "+") + text;
}

function counted(number, one, many) {
  return `${number.toLocaleString("en")} ${number === 1 ? one : many || `${one}s`}`;
}

// About `count` round numbers from `low` to `high`.
function ticks(low, high, count) {
  const rough = (high - low) / count || 1;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 2.5, 5, 10].map((factor) => factor * power).find((value) => value >= rough * 0.999);
  const found = [];
  for (let i = Math.ceil(low / step - 1e-9); i * step <= high + step * 1e-9; i += 1) {
    found.push(Number((i * step).toPrecision(12)));
  }
  return found;
}
