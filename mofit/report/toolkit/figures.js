"use strict";
// Figures to be explored, from what the axes of their pictures show (description.py); without scripts the pictures stay.
const NEUTRAL = "#8c959f";
const IN_THE_DARK = {
  "#1d2329": "#e6e9ec", "#000000": "#e6e9ec", "#57606a": "#9aa4ae", "#444444": "#b6bcc2", "#ffffff": "#14181d",
  "#0072b2": "#4aa8e0", "#d55e00": "#f0803c", "#009e73": "#2fc79b", "#cc79a7": "#e39cc4", "#e69f00": "#f0b429",
  "#56b4e9": "#8fd0f5", "#7a5c00": "#c9a227", "#999999": "#7d868f",
};
const INCH = 104, LEFT = 64, RIGHT = 12, TOP = 30, BOTTOM = 46, ACROSS = 66, DOWN = 74, BETWEEN = 12, NARROWEST = 230;
const darkScheme = matchMedia("(prefers-color-scheme: dark)");
const shade = (colour) => (darkScheme.matches && IN_THE_DARK[colour]) || colour;

async function unpack(text) {
  const packed = atob(text.trim()), bytes = new Uint8Array(packed.length);
  for (let k = 0; k < packed.length; k++) bytes[k] = packed.charCodeAt(k);
  return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"))).text();
}

let loading;
function library() {
  loading ||= unpack(document.getElementById("library").textContent).then((source) => {
    const script = document.createElement("script");
    script.textContent = source;
    document.head.append(script);
  });
  return loading;
}

class Explored {
  constructor(figure, spec) {
    this.spec = spec;
    this.off = new Set(); // names that are switched off
    this.brush = spec.brush ? new Brush(this) : null;
    this.plot = document.createElement("div");
    this.plot.className = "plot";
    this.plot.tabIndex = 0;
    this.plot.explored = this;
    this.plot.setAttribute("role", "group");
    const alt = figure.querySelector("img").alt;
    const keys = this.brush
      ? "Left and right choose an axis, up and down move the upper end of its box, with shift the lower end, Escape shows all points."
      : "Arrow keys move, + and - zoom, 0 shows all.";
    this.plot.setAttribute("aria-label", `${alt}. ${keys}`);
    this.legend = document.createElement("div");
    this.legend.className = "legend";
    this.note = document.createElement("p");
    this.note.className = "note";
    this.note.setAttribute("role", "status");
    figure.querySelector(".picture").after(this.legend, this.plot, this.note);
    figure.classList.add("explored");
    this.buildLegend();
    this.plot.addEventListener("keydown", (event) => this.key(event));
    new ResizeObserver(() => { if (this.plot.clientWidth && this.plot.clientWidth !== this.width) this.draw(); }).observe(this.plot);
  }

  buildLegend() {
    const rows = this.spec.panels.flatMap((panel) => [panel, panel.lower].filter(Boolean));
    const names = new Set(rows.flatMap((row) => row.parts.map((part) => part.name)));
    for (const entry of this.spec.legend) {
      const button = document.createElement("button"), key = document.createElement("span");
      button.type = "button";
      button.disabled = !names.has(entry.name);
      button.setAttribute("aria-pressed", "true");
      key.className = `mark ${entry.look} ${entry.dash}`;
      key.style.color = shade(entry.colour);
      key.style.opacity = entry.alpha;
      const text = document.createElement("span");
      text.innerHTML = entry.html;
      button.append(key, text);
      button.addEventListener("click", () => {
        const shown = this.off.delete(entry.name) || !this.off.add(entry.name);
        button.setAttribute("aria-pressed", shown);
        this.draw();
      });
      this.legend.append(button);
    }
  }

  // Where a choice rules a panel or a part out.
  hidden(keys, siblings) {
    return Object.entries(keys || {}).some(([kind, value]) => {
      const chosen = choices.now[kind];
      return typeof value === "string" && chosen && chosen !== value && siblings.some((other) => (other || {})[kind] === chosen);
    });
  }

  panels() {
    const all = this.spec.panels.map((panel) => panel.keys);
    return this.spec.panels.filter((panel) => !this.hidden(panel.keys, all));
  }

  draw() {
    this.width = this.plot.clientWidth;
    if (!this.width) return undefined;
    const shown = this.panels(), wide = this.width - LEFT - RIGHT;
    const fit = Math.max(1, Math.floor((wide + ACROSS) / (NARROWEST + ACROSS)));
    const columns = Math.min(this.spec.columns, fit, Math.max(shown.length, 1));
    const across = (wide - (columns - 1) * ACROSS) / columns;
    const alone = shown.length === 1 && this.spec.panels.length > 1 ? 1.6 : 1;
    const high = (row) => INCH * row.height * alone;
    const each = Math.max(...shown.map((panel) => high(panel) + (panel.lower ? high(panel.lower) + BETWEEN : 0)));
    const rows = Math.ceil(shown.length / columns), tall = rows * each + (rows - 1) * DOWN;
    this.traces = [];
    this.owners = [];
    this.layout = this.frame(tall + TOP + BOTTOM);
    shown.forEach((panel, k) => {
      const left = ((k % columns) * (across + ACROSS)) / wide, top = tall - Math.floor(k / columns) * (each + DOWN);
      const span = [left, left + across / wide];
      const edge = { first: k % columns === 0, last: k + columns >= shown.length, below: shown[k + columns] };
      this.title(panel, span[0], top / tall);
      const main = this.row(panel, panel, span, [(top - high(panel)) / tall, top / tall], edge, null);
      if (panel.lower) {
        const end = top - high(panel) - BETWEEN;
        this.row(panel, panel.lower, span, [(end - high(panel.lower)) / tall, end / tall], edge, main);
      }
    });
    // Plotly changes the layout that it is given
    this.home = Object.fromEntries(Object.entries(this.layout).filter(([name]) => /^xaxis/.test(name)).map(([name, axis]) => [name, [...axis.range]]));
    return Plotly.react(this.plot, this.traces, this.layout, {
      displaylogo: false, displayModeBar: true, modeBarButtonsToRemove: ["autoScale2d", "lasso2d", ...(this.brush ? [] : ["select2d"])],
    }).then(() => this.listen());
  }

  frame(height) {
    const style = getComputedStyle(document.body), touch = matchMedia("(pointer: coarse)").matches;
    return {
      height, width: this.width, showlegend: false, annotations: [], shapes: [], selections: this.brush ? this.brush.boxes : [],
      margin: { l: LEFT, r: RIGHT, t: TOP, b: BOTTOM, pad: 0 },
      paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", bargap: 0, barmode: "overlay",
      font: { family: style.fontFamily, size: 11.5, color: style.color },
      hovermode: !this.brush && this.overTime() ? "x" : "closest", hoverdistance: 30, separators: ".\u202f",
      dragmode: touch ? false : this.brush ? "select" : "zoom",
      modebar: { bgcolor: "rgba(0,0,0,0)", color: NEUTRAL, activecolor: style.color }, uirevision: "",
      hoverlabel: { font: { size: 11.5 }, namelength: -1 },
    };
  }

  overTime() {
    const rising = (x) => x.every((value, k) => !k || value === null || x[k - 1] === null || value >= x[k - 1]);
    return this.spec.panels.every((panel) => panel.parts.every((part) => part.kind !== "line" || (part.dash && rising(part.x))));
  }

  title(panel, x, y) {
    if (!panel.title) return;
    const colour = choices.colour(panel.keys.test);
    const text = `${colour ? `<span style="color:${colour}">■</span> ` : ""}<b>${panel.title}</b>`;
    this.layout.annotations.push({
      text, x, y, xref: "paper", yref: "paper", xanchor: "left", yanchor: "bottom", yshift: 3, showarrow: false,
      font: { size: 12 }, captureevents: Boolean(panel.keys.test), name: panel.keys.test || "",
    });
  }

  row(panel, row, across, up, edge, above) {
    const n = this.layout.rows = (this.layout.rows || 0) + 1, id = n === 1 ? "" : n;
    const x = this.axis(panel.x, across), y = this.axis(row.y, up);
    const first = this.spec.panels[0], same = (a, b) => a.title === b.title;
    Object.assign(x, { anchor: `y${id}`, automargin: Boolean(edge.last && panel.x.ticks), showticklabels: !panel.lower || row !== panel });
    Object.assign(y, { anchor: `x${id}`, automargin: edge.first });
    if (above || (panel.lower && row === panel) || (edge.below && same(panel.x, edge.below.x))) x.title.text = above && edge.last ? x.title.text : "";
    const like = row === panel ? first : first.lower;
    if (!edge.first && same(row.y, like.y)) y.title.text = "";
    if (above) x.matches = `x${above}`;
    this.layout[`xaxis${id}`] = x;
    this.layout[`yaxis${id}`] = y;
    const parts = row.parts.map((part) => part.keys);
    for (const part of row.parts) {
      const asked = part.asked && !Object.entries(part.keys).every(([kind, value]) => choices.now[kind] === value);
      if (!asked && !this.off.has(part.name) && !this.hidden(part.keys, parts)) this.part(panel, row, part, id);
    }
    this.stripes(panel.x, "x", id);
    this.stripes(row.y, "y", id);
    return id;
  }

  axis(axis, domain) {
    const log = (value) => (axis.log ? Math.log10(value) : value);
    const found = {
      domain, type: axis.log ? "log" : "linear", range: axis.range.map(log), autorange: false, zeroline: false,
      title: { text: axis.title, standoff: 6 }, gridcolor: darkScheme.matches ? "#2c333a" : "#e3e8ed", linecolor: NEUTRAL,
      exponentformat: "none", separatethousands: true, showline: true, ticks: "outside", ticklen: 3, tickcolor: NEUTRAL, nticks: 6, tickfont: { size: 10.5 },
    };
    if (axis.ticks) Object.assign(found, { tickmode: "array", tickvals: axis.ticks.values, ticktext: this.coloured(axis), autotickangles: [0, -30, -90] });
    if (!axis.ticks || axis.ticks.texts.every((text) => !isNaN(Number(text)))) found.tickangle = 0;
    return found;
  }

  coloured(axis) {
    const tests = axis.keys.test || [];
    return axis.ticks.texts.map((text, k) => tests[k] ? `<span style="color:${choices.colour(tests[k])}">■</span> ${text}` : text);
  }

  // The place of the chosen test (or class) on an axis that has one per tick.
  stripes(axis, which, id) {
    for (const [kind, values] of Object.entries(axis.keys)) {
      const k = values.indexOf(choices.now[kind]), at = k < 0 || !axis.ticks ? null : axis.ticks.values[k];
      if (at === null) continue;
      const ends = axis.log ? [at * 0.93, at * 1.07] : [at - 0.5, at + 0.5];
      this.shape({ type: "rect", [which + 0]: ends[0], [which + 1]: ends[1] }, which === "x" ? "y" : "x", id,
        { line: { color: choices.colour(choices.now.test) || NEUTRAL, width: 2 } });
    }
  }

  shape(place, whole, id, look) {
    const other = whole === "x" ? "y" : "x";
    this.layout.shapes.push({
      ...place, ...look, layer: "above", [whole + 0]: 0, [whole + 1]: 1,
      [`${whole}ref`]: `${whole}${id} domain`, [`${other}ref`]: `${other}${id}`,
    });
  }

  part(panel, row, part, id) {
    const colour = shade(part.colour), which = "x" in part && part.x !== undefined ? "x" : "y", whole = which === "x" ? "y" : "x";
    if (part.kind === "across") {
      const place = { type: "line", [which + 0]: part[which], [which + 1]: part[which] };
      this.shape(place, whole, id, { line: { color: colour, width: 1.4, dash: part.dash || "solid" } });
    } else if (part.kind === "stripe") {
      const place = { type: "rect", [which + 0]: part[which][0], [which + 1]: part[which][1] };
      this.shape(place, whole, id, { fillcolor: colour, opacity: part.alpha, line: { width: 0 } });
      this.layout.shapes.at(-1).layer = "below";
    } else {
      const maker = { line: lineTrace, band: bandTrace, bars: barsTrace, cells: cellsTrace, texts: textsTrace }[part.kind];
      const trace = { name: part.name, xaxis: `x${id}`, yaxis: `y${id}`, ...maker(part, colour) };
      if (!trace.hoverinfo) trace.hovertemplate = hoverText(panel.x, row.y, part);
      this.choosePoints(trace, part);
      if (this.brush && part.bundle) this.bundle(trace, part);
      this.traces.push(trace);
      this.owners.push({ panel, row, part });
    }
  }

  choosePoints(trace, part) {
    for (const [kind, values] of Object.entries(part.keys || {})) {
      const chosen = choices.now[kind];
      if (!Array.isArray(values) || !chosen || !values.includes(chosen)) continue;
      trace.selectedpoints = values.flatMap((value, k) => (value === chosen ? [k] : []));
      trace.unselected = { marker: { opacity: 0.3 } };
    }
  }

  // Parallel coordinates: many lines in one part, those outside of a box of the brush fade.
  bundle(trace, part) {
    const passing = this.brush.passing();
    if (!passing) return;
    this.traces.push({ ...trace, hoverinfo: "skip", hovertemplate: undefined, opacity: 0.12 });
    this.owners.push({});
    trace.y = trace.y.map((value, k) => (passing.has(Math.floor(k / part.bundle)) ? value : null));
    Object.assign(trace, { line: { ...trace.line, color: shade("#d55e00"), width: 1.4 }, opacity: 1, name: "chosen" });
  }

  listen() {
    if (this.listening) return;
    this.listening = true;
    this.thin();
    this.plot.on("plotly_afterplot", () => this.thin());
    this.plot.on("plotly_click", (event) => this.click(event.points[0]));
    this.plot.on("plotly_clickannotation", (event) => event.annotation.name && choices.choose("test", event.annotation.name));
    if (this.brush) this.brush.listen();
  }

  thin() {
    thinTicks(this.plot);
    if (this.spec.panels.some((panel) => panel.parts.some((part) => part.kind === "cells"))) thinCells(this.plot);
  }

  click(point) {
    const { panel, row, part } = this.owners[point.curveNumber];
    if (!part) return;
    for (const other of row.parts) {
      // a dot may lie on one that belongs to something
      const k = other === part ? point.pointNumber : (other.x || []).findIndex((x, i) => x === point.x && other.y[i] === point.y);
      for (const [kind, values] of Object.entries((k >= 0 && other.keys) || {}))
        if (Array.isArray(values) && values[k]) choices.choose(kind, values[k]);
    }
    for (const [axis, at] of [[panel.x, point.x], [row.y, point.y]])
      for (const [kind, values] of Object.entries(axis.keys)) {
        const k = axis.ticks.values.findIndex((value) => value === at);
        if (k >= 0 && choices.now[kind] !== values[k]) choices.choose(kind, values[k]);
      }
    if (this.spec.opens) document.getElementById(this.spec.opens).scrollIntoView({ behavior: "smooth" });
  }

  key(event) {
    if (this.brush && !event.ctrlKey && !event.metaKey && this.brush.key(event)) {
      event.preventDefault();
      return;
    }
    const step = { ArrowLeft: [-0.1, 1], ArrowRight: [0.1, 1], "+": [0, 0.8], "-": [0, 1.25], 0: null }[event.key];
    if (step === undefined || event.ctrlKey || event.metaKey) return;
    event.preventDefault();
    const change = {};
    for (const [name, home] of Object.entries(this.home)) {
      const [low, high] = this.plot.layout[name].range.map(Number), middle = (low + high) / 2, half = (high - low) / 2;
      change[`${name}.range`] = step
        ? [middle + 2 * half * step[0] - half * step[1], middle + 2 * half * step[0] + half * step[1]]
        : home.slice();
    }
    Plotly.relayout(this.plot, change);
  }
}

const unitOf = (axis) => { const found = /\(([^()]*)\)\s*$/.exec(axis.title); return found && found[1] !== "–" ? ` ${found[1]}` : ""; };
function hoverText(x, y, part) {
  const at = (axis, letter) => (axis.ticks && part.kind !== "line" ? `%{${letter}}` : `%{${letter}:.5~g}${unitOf(axis)}`);
  if (part.kind === "cells") return "%{x}, %{y}: %{z:.3~g}<extra></extra>";
  return `${at(x, "x")}, ${at(y, "y")}<extra>${part.name}</extra>`;
}
function lineTrace(part, colour) {
  const found = { x: part.x, y: part.y, type: "scatter", mode: part.dash ? "lines" : "markers", opacity: part.bundle ? 0.35 : part.alpha,
    line: { color: colour, width: Math.max(1, 1.15 * part.width), dash: part.dash || "solid" } };
  if (!part.dots.symbol) return found;
  const dots = Array.isArray(part.dots.colour) ? part.dots.colour : shade(part.dots.colour);
  found.mode = part.dash ? "lines+markers" : "markers";
  found.marker = { symbol: part.dots.symbol, size: Math.max(3, 1.4 * part.dots.size), color: dots, line: { width: part.dots.symbol.endsWith("-open") ? 1.4 : 0 } };
  return found;
}
const bandTrace = (part, colour) => ({
  x: part.x, y: part.y, type: "scatter", mode: "none", fill: "toself", fillcolor: colour, opacity: part.alpha, hoverinfo: "skip",
});
const barsTrace = (part) => ({
  type: "bar", orientation: part.flat ? "h" : "v", [part.flat ? "y" : "x"]: part.at, [part.flat ? "x" : "y"]: part.length,
  base: part.base, width: part.width, opacity: part.alpha, marker: { color: part.colours.map(shade) },
});
const cellsTrace = (part) => ({
  type: "heatmap", x: part.x, y: part.y, z: part.z, zmin: part.low, zmax: part.high, colorscale: part.shades, showscale: false, xgap: 1, ygap: 1,
});
const textsTrace = (part) => ({
  x: part.x, y: part.y, text: part.text, type: "scatter", mode: "text", hoverinfo: "skip", textfont: { size: 10, color: part.colours },
});

(function explore() {
  if (typeof DecompressionStream === "undefined" || typeof IntersectionObserver === "undefined") return;
  choices.collect();
  choices.build(document.getElementById("choices"));
  const drawn = [];
  const seen = new IntersectionObserver((entries) => {
    for (const { isIntersecting, target } of entries) {
      if (!isIntersecting) continue;
      seen.unobserve(target);
      Promise.all([unpack(target.querySelector(".described").textContent), library()]).then(([text]) => {
        const figure = new Explored(target, JSON.parse(text));
        drawn.push(figure);
        return figure.draw();
      }).then(() => { target.dataset.drawn = "yes"; });
    }
  }, { rootMargin: "300px" });
  for (const script of document.querySelectorAll(".described")) seen.observe(script.closest("figure"));
  const again = () => drawn.forEach((figure) => figure.draw());
  choices.followers.push(again);
  darkScheme.addEventListener("change", again);
})();
