// Functions that all drawings of this page share.

// Clear a canvas and set its resolution to the display's; lengths are in CSS pixels.
export function prepare(canvas) {
  const scale = window.devicePixelRatio || 1;
  const { clientWidth: width, clientHeight: height } = canvas;
  canvas.width = Math.round(width * scale);
  canvas.height = Math.round(height * scale);
  const style = getComputedStyle(canvas);
  const pen = canvas.getContext("2d");
  pen.scale(scale, scale);
  pen.font = `${0.8 * parseFloat(style.fontSize)}px ${style.fontFamily}`;
  pen.textBaseline = "middle";
  pen.lineJoin = "round";
  return { pen, width, height, colour: (name) => style.getPropertyValue(name).trim() };
}

const WORDS = new Intl.NumberFormat("en", { maximumSignificantDigits: 4 });
const WHOLE = new Intl.NumberFormat("en");

export function number(value) {
  if (typeof value !== "number") return String(value);
  const small = value !== 0 && Math.abs(value) < 1e-3;
  if (small || Math.abs(value) >= 1e9) return value.toExponential(2);
  return (Number.isInteger(value) ? WHOLE : WORDS).format(value).replace("-", "−");
}
