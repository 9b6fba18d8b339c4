"use strict";
// The brush of parallel coordinates: boxes across the lines, drawn by pointer or by keys; lines outside of them fade.
class Brush {
  constructor(figure) {
    this.figure = figure;
    this.boxes = [];
    this.axis = null; // place, among all axes, of the box that the keys move
  }

  listen() {
    const plot = this.figure.plot;
    plot.on("plotly_selected", () => setTimeout(() => this.set([...(plot.layout.selections || [])])));
    plot.on("plotly_deselect", () => this.set([]));
  }

  set(boxes) {
    this.boxes = boxes;
    if (!boxes.length) {
      this.axis = null;
      this.figure.note.textContent = "";
    }
    return this.figure.draw();
  }

  // Every line that passes all boxes; null without one.
  passing() {
    if (!this.boxes.length) return null;
    const shown = this.figure.panels(), all = new Set();
    const tests = this.boxes.map((box) => {
      const panel = shown[Number(box.xref.slice(1) || 1) - 1], part = panel.parts.find((one) => one.bundle);
      const [low, high] = [box.y0, box.y1].map(Number).sort((a, b) => a - b), [from, to] = [box.x0, box.x1].map(Number).sort((a, b) => a - b);
      return { part, low, high, from, to };
    });
    const { part: any } = tests[0];
    let count = 0;
    for (let line = 0; line * any.bundle < any.x.length; line++, count++)
      if (tests.every(({ part, low, high, from, to }) => {
        for (let k = line * part.bundle; k < (line + 1) * part.bundle - 1; k++)
          if (part.x[k] >= from && part.x[k] <= to && (part.y[k] < low || part.y[k] > high)) return false;
        return true;
      })) all.add(line);
    this.figure.note.textContent = `${all.size} of ${count} points pass ${tests.length} box${tests.length > 1 ? "es" : ""}${this.where()}. Double click or Escape shows all; shift and drag adds a box.`;
    return all;
  }

  // The axes that lines cross, in the order of the panels.
  axes() {
    return this.figure.panels().flatMap((panel, k) => {
      const part = panel.parts.find((one) => one.bundle);
      if (!part) return [];
      const [low, high] = panel.y.range;
      return panel.x.ticks.values.map((at, i) => ({ id: k ? k + 1 : "", at, low, high, name: panel.x.ticks.texts[i] }));
    });
  }

  where() {
    const axis = this.axis === null ? null : this.axes()[this.axis], box = this.boxes.at(-1);
    const plain = (html) => new DOMParser().parseFromString(html, "text/html").body.textContent;
    return axis && box ? `; ${plain(axis.name)}: ${box.y0.toPrecision(3)} to ${box.y1.toPrecision(3)}` : "";
  }

  // Left and right choose an axis, up and down move the upper end of its box, with shift the lower one.
  key(event) {
    const axes = this.axes(), sideways = { ArrowLeft: -1, ArrowRight: 1 }[event.key], upward = { ArrowDown: -1, ArrowUp: 1 }[event.key];
    if (event.key === "Escape" && this.boxes.length) return this.set([]);
    if (sideways) {
      const now = this.axis === null ? (sideways > 0 ? 0 : axes.length - 1) : (this.axis + sideways + axes.length) % axes.length;
      // a box that was left as high as its axis keeps nothing out
      const kept = this.boxes.filter((box) => !box.whole);
      this.axis = now;
      const { id, at, low, high } = axes[now];
      return this.set([...kept, { type: "rect", xref: `x${id}`, yref: `y${id}`, x0: at - 0.2, x1: at + 0.2, y0: low, y1: high, whole: true }]);
    }
    if (!upward || this.axis === null || !this.boxes.length) return null;
    const { low, high } = axes[this.axis], box = { ...this.boxes.at(-1), whole: false }, step = (upward * (high - low)) / 20;
    if (event.shiftKey) box.y0 = Math.min(Math.max(box.y0 + step, low), box.y1);
    else box.y1 = Math.max(Math.min(box.y1 + step, high), box.y0);
    return this.set([...this.boxes.slice(0, -1), box]);
  }
}
