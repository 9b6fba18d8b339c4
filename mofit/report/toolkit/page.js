"use strict";
for (const group of document.querySelectorAll(".tabs")) {
  const panes = [...group.children];
  const bar = document.createElement("div");
  bar.className = "tabbar";
  bar.setAttribute("role", "tablist");
  const buttons = panes.map((pane, index) => {
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = pane.dataset.title;
    button.setAttribute("role", "tab");
    button.addEventListener("click", () => show(index));
    button.addEventListener("keydown", (event) => {
      const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
      if (!step) return;
      const next = (index + step + panes.length) % panes.length;
      show(next);
      buttons[next].focus();
    });
    bar.append(button);
    pane.setAttribute("role", "tabpanel");
    pane.querySelector("h3").hidden = true;
    return button;
  });
  function show(chosen) {
    panes.forEach((pane, index) => { pane.hidden = index !== chosen; });
    buttons.forEach((button, index) => {
      button.setAttribute("aria-selected", index === chosen);
      button.tabIndex = index === chosen ? 0 : -1;
    });
  }
  group.prepend(bar);
  show(0);
}

// Pictures out of view are decoded once the page can be read, one whenever there is time; print needs all of them.
const later = [...document.querySelectorAll('img[loading="lazy"]')];
const idle = window.requestIdleCallback || ((call) => setTimeout(call, 50));
function decode() {
  if (!later.length) return;
  later.shift().loading = "eager";
  idle(decode);
}
addEventListener("load", () => idle(decode));
addEventListener("beforeprint", () => later.splice(0).forEach((image) => { image.loading = "eager"; }));
