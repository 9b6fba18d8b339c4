// Labels of a drawn figure that would lie on one another: the later one is hidden, its value is told on hover.
"use strict";

const GAP = 3;

const boxOf = (label) => label.getBoundingClientRect();
const meet = (a, b) => Math.min(a.right, b.right) + GAP > Math.max(a.left, b.left) && Math.min(a.bottom, b.bottom) > Math.max(a.top, b.top);
const rotated = (label) => /rotate\(-?(?!0[,)])[\d.]+/.test(label.getAttribute("transform") || "");

// Numbers on axes, one axis after the other; slanted names are apart although their boxes are not.
function thinTicks(plot) {
  const axes = new Map();
  for (const tick of plot.querySelectorAll("g.xtick, g.ytick, g[class*='tick']")) {
    const label = tick.querySelector(":scope > text"), name = tick.getAttribute("class");
    if (!label || !/^[xy]\d*tick$/.test(name)) continue;
    label.style.visibility = "";
    if (!rotated(label)) axes.set(name, [...(axes.get(name) || []), label]);
  }
  for (const [name, labels] of axes) {
    const along = (label) => (name[0] === "x" ? boxOf(label).left : -boxOf(label).bottom);
    labels.sort((a, b) => along(a) - along(b));
    let last = null;
    for (const label of labels) {
      if (last && meet(boxOf(last), boxOf(label))) label.style.visibility = "hidden";
      else last = label;
    }
  }
}

// Numbers in cells: all or none, as a cell without one means something else.
function thinCells(plot) {
  const labels = [...plot.querySelectorAll(".textpoint text")];
  for (const label of labels) label.style.visibility = "";
  const boxes = labels.map(boxOf).sort((a, b) => a.top - b.top || a.left - b.left);
  const crowded = boxes.some((box, k) => boxes.slice(k + 1, k + 4).some((other) => meet({ ...edges(box), right: box.right - GAP }, other)));
  if (crowded) for (const label of labels) label.style.visibility = "hidden";
}

const edges = (box) => ({ left: box.left, right: box.right, top: box.top, bottom: box.bottom });
