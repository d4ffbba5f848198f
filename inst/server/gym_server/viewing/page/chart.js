// Draws the returns of the last episodes as points, and the return that counts as solved.

import { number, prepare } from "./canvas.js";

const LEAST_EPISODES = 20;

export function drawChart(canvas, returns, goal) {
  const values = returns.map(Number).filter(Number.isFinite);
  const { pen, width, height, colour } = prepare(canvas);
  if (!values.length) {
    pen.fillStyle = colour("--quiet");
    pen.textAlign = "center";
    pen.fillText("No episode has ended yet", width / 2, height / 2);
    canvas.setAttribute("aria-label", "No episode has ended yet");
    return;
  }
  const last = values[values.length - 1];
  const mean = values.reduce((sum, value) => sum + value, 0) / values.length;
  canvas.setAttribute(
    "aria-label",
    `Returns of the last ${values.length} episodes: mean ${number(mean)}, last ${number(last)}`
  );

  const marks = ticks(...range(values, goal));
  const [low, high] = [marks[0], marks[marks.length - 1]];
  const left = Math.max(...marks.map((mark) => pen.measureText(number(mark)).width)) + 8;
  const right = width - 8;
  const [top, bottom] = [8, height - 8];
  const y = (value) => bottom - ((value - low) / (high - low)) * (bottom - top);
  const room = Math.max(values.length, LEAST_EPISODES) - 1;
  const x = (index) => left + 6 + (index / room) * (right - left - 12);

  pen.textAlign = "right";
  pen.lineWidth = 1;
  for (const mark of marks) {
    pen.strokeStyle = colour("--line");
    stroke(pen, [[left, y(mark)], [right, y(mark)]]);
    pen.fillStyle = colour("--quiet");
    pen.fillText(number(mark), left - 6, y(mark));
  }
  if (Number.isFinite(goal)) {
    pen.strokeStyle = pen.fillStyle = colour("--goal");
    pen.setLineDash([5, 4]);
    stroke(pen, [[left, y(goal)], [right, y(goal)]]);
    pen.setLineDash([]);
    const above = y(goal) - 20 > top;
    // On the left, where points rarely are: early episodes have low returns.
    pen.textAlign = "left";
    pen.fillText(`solved: mean of ${number(goal)}`, left + 4, y(goal) + (above ? -9 : 11));
  }
  pen.strokeStyle = colour("--accent-soft");
  pen.lineWidth = 1.5;
  stroke(pen, values.map((value, index) => [x(index), y(value)]));
  pen.fillStyle = colour("--accent");
  values.forEach((value, index) => {
    const size = index === values.length - 1 ? 4.5 : values.length > 50 ? 2 : 2.8;
    pen.beginPath();
    pen.arc(x(index), y(value), size, 0, 2 * Math.PI);
    pen.fill();
  });
}

function stroke(pen, points) {
  pen.beginPath();
  points.forEach(([x, y]) => pen.lineTo(x, y));
  pen.stroke();
}

function range(values, goal) {
  const all = Number.isFinite(goal) ? [...values, goal] : values;
  let [low, high] = [Math.min(...all), Math.max(...all)];
  // The axis includes 0, so that returns can be compared with it.
  [low, high] = [Math.min(low, 0), Math.max(high, 0)];
  return low === high ? [0, 1] : [low, high];
}

// Round numbers from at most `low` to at least `high`.
function ticks(low, high) {
  const rough = (high - low) / 3;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 2.5, 5, 10].map((times) => times * power).find((size) => size >= rough);
  const [first, last] = [Math.floor(low / step), Math.ceil(high / step)];
  return Array.from({ length: last - first + 1 }, (_, index) => (first + index) * step);
}
