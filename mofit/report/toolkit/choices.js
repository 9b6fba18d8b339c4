"use strict";
// A choice per kind (test, draw, ...): figures offer values, the bar on top of the page shows them, all figures follow.
const choices = {
  now: {}, offers: {}, followers: [],
  titles: {
    run: "Run", campaign: "Campaign", test: "Test", mode: "Mode", draw: "Posterior draw", firefly: "Firefly", model: "Model", lines: "Class of lines",
  },
  choose(kind, value) {
    this.now[kind] = this.now[kind] === value ? "" : value;
    this.show();
    for (const follow of this.followers) follow(kind);
  },
  // colours of tests go round the wheel in the order of the page
  colour(test) {
    const tests = this.offers.test || [], k = tests.indexOf(test);
    return k < 0 ? "" : `hsl(${Math.round((360 * k) / tests.length)} 62% ${k % 2 ? 42 : 55}%)`;
  },
  collect() {
    for (const figure of document.querySelectorAll("figure[data-offers]"))
      for (const [kind, values] of Object.entries(JSON.parse(figure.dataset.offers)))
        this.offers[kind] = [...new Set([...(this.offers[kind] || []), ...values])];
  },
  build(bar) {
    this.bar = bar;
    for (const [kind, values] of Object.entries(this.offers)) {
      if (values.length < 2) continue;
      if (values.length === 2) {
        bar.append(this.pair(kind, values));
        continue;
      }
      const label = document.createElement("label"), select = document.createElement("select");
      select.dataset.kind = kind;
      for (const value of ["", ...values]) select.add(new Option(value || "all", value));
      if (kind === "draw" || kind === "firefly") select.options[0].text = "none";
      select.addEventListener("change", () => { this.now[kind] = undefined; this.choose(kind, select.value); });
      label.append(`${this.titles[kind] || kind} `, select);
      bar.append(label);
    }
    bar.hidden = !bar.children.length;
    this.swatches();
  },
  // Two values: a switch.
  pair(kind, values) {
    const set = document.createElement("fieldset");
    set.append(`${this.titles[kind] || kind} `);
    for (const value of ["", ...values]) {
      const label = document.createElement("label"), radio = document.createElement("input");
      Object.assign(radio, { type: "radio", name: `choice-${kind}`, value, checked: !value });
      radio.dataset.kind = kind;
      radio.addEventListener("change", () => { this.now[kind] = undefined; this.choose(kind, value); });
      label.append(radio, value || "both");
      set.append(label);
    }
    return set;
  },
  show() {
    for (const radio of this.bar.querySelectorAll("input")) radio.checked = radio.value === (this.now[radio.dataset.kind] || "");
    for (const select of this.bar.querySelectorAll("select")) select.value = this.now[select.dataset.kind] || "";
    for (const row of document.querySelectorAll("tr[data-test]"))
      row.classList.toggle("chosen", row.dataset.test === this.now.test);
  },
  // rows of tables that begin with the name of a test have its colour, and choose it
  swatches() {
    for (const head of document.querySelectorAll("tbody tr > :first-child")) {
      const test = head.textContent.trim(), colour = this.colour(test);
      if (!colour) continue;
      const button = document.createElement("button"), key = document.createElement("span");
      button.type = "button";
      button.className = "test";
      button.title = `Show ${test} in all figures`;
      key.className = "key";
      key.style.background = colour;
      button.append(key, test);
      button.addEventListener("click", () => this.choose("test", test));
      head.replaceChildren(button);
      head.parentElement.dataset.test = test;
    }
  },
};
