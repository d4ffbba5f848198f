// Draws an observation: a bar for each number, and a line for its last values.

import { number, prepare } from "./canvas.js";

const KEPT = 200;
const LEAST_COLUMN = 300;

export class Observation {
  constructor(canvas) {
    this.canvas = canvas;
    this.forget();
  }

  forget() {
    this.names = "";
    this.histories = [];
  }

  draw({ names, values }) {
    if (names.join() !== this.names) {
      this.names = names.join();
      this.histories = names.map(() => []);
    }
    values.forEach((value, index) => {
      const history = this.histories[index];
      history.push(value);
      if (history.length > KEPT) history.shift();
    });
    this.paint(names, values);
  }

  paint(names, values) {
    const columns = Math.max(
      1, Math.min(Math.floor(this.canvas.clientWidth / LEAST_COLUMN), Math.ceil(values.length / 12))
    );
    const rows = Math.ceil(values.length / columns);
    const size = parseFloat(getComputedStyle(this.canvas).fontSize);
    const tall = Math.min(4.2, Math.max(1.7, 24 / Math.max(rows, 1))) * size;
    this.canvas.style.height = `${rows * tall + size}px`;
    const { pen, width, colour } = prepare(this.canvas);
    const wide = width / columns;
    const longest = Math.max(0, ...names.map((name) => pen.measureText(name).width));
    const nameWide = longest ? Math.min(7 * size, longest + 10) : 0;
    values.forEach((value, index) => {
      const place = {
        left: Math.floor(index / rows) * wide + 12,
        top: (index % rows) * tall + size / 2,
        wide: wide - 24,
        tall,
        nameWide,
        valueWide: 4.4 * size,
      };
      this.paintOne(pen, colour, place, names[index], value, this.histories[index]);
    });
    const texts = values.slice(0, 8).map((value, i) => `${names[i]} ${number(value)}`.trim());
    this.canvas.setAttribute("aria-label", `The observation: ${texts.join(", ")}`);
  }

  paintOne(pen, colour, place, name, value, history) {
    const { left, top, wide, tall, nameWide, valueWide } = place;
    const middle = top + tall / 2;
    pen.textAlign = "left";
    pen.fillStyle = colour("--quiet");
    if (name) pen.fillText(name, left, middle, nameWide - 6);
    if (typeof value === "string" && !Number.isFinite(Number(value))) {
      pen.fillStyle = colour("--ink");
      pen.fillText(value || "(empty text)", left + nameWide, middle, wide - nameWide);
      return;
    }
    const numbers = history.map(Number).filter(Number.isFinite);
    const [low, high] = [Math.min(...numbers), Math.max(...numbers)];
    pen.textAlign = "right";
    pen.fillStyle = colour("--ink");
    pen.fillText(number(Number(value)), left + wide, middle, valueWide);
    const room = wide - nameWide - valueWide;
    const barWide = room * 0.4;
    this.paintBar(pen, colour, left + nameWide, middle, barWide, tall, Number(value), low, high);
    const from = left + nameWide + barWide + 12;
    this.paintLine(pen, colour, from, top + 4, room - barWide - 20, tall - 8, numbers, low, high);
  }

  paintBar(pen, colour, left, middle, wide, tall, value, low, high) {
    const [least, most] = [Math.min(0, low), Math.max(0, high)];
    const x = (at) => left + (most > least ? ((at - least) / (most - least)) * wide : 0);
    const thick = Math.min(tall * 0.5, 14);
    pen.fillStyle = colour("--line");
    pen.fillRect(left, middle - thick / 2, wide, thick);
    pen.fillStyle = colour("--accent");
    pen.fillRect(Math.min(x(0), x(value)), middle - thick / 2, Math.abs(x(value) - x(0)), thick);
    pen.fillStyle = colour("--ink");
    pen.fillRect(x(0) - 0.5, middle - thick / 2 - 2, 1, thick + 4);
  }

  paintLine(pen, colour, left, top, wide, tall, numbers, low, high) {
    pen.strokeStyle = colour("--accent");
    pen.lineWidth = 1.3;
    pen.beginPath();
    numbers.forEach((value, index) => {
      const share = high > low ? (value - low) / (high - low) : 0.5;
      pen.lineTo(left + (index / (KEPT - 1)) * wide, top + tall - share * tall);
    });
    pen.stroke();
  }
}
