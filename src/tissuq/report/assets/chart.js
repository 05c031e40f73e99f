"use strict";
// Draws the chart of a page from the JSON beside it: hover or move the slider to read values, drag to zoom, double-click
// to see all, switch parts, formulations and stresses, and move the parameters of the material against the data.
(() => {
  const holder = document.getElementById("chart"), data = JSON.parse(document.getElementById("chart-data").textContent);
  const still = holder.parentElement.querySelector(".still");
  const parts = [
    { name: "measured", keys: ["measured"], on: true },
    { name: "95 % of measurements", keys: ["low", "high"], on: true, fill: "rgba(0, 114, 178, 0.16)" },
    { name: "95 % of the stress", keys: ["stress_low", "stress_high"], on: true, fill: "rgba(0, 114, 178, 0.34)" },
    { name: "median", keys: ["median"], on: true },
    { name: "material alone", keys: ["alone"], on: true },
    { name: "95 % of the material", keys: ["alone_low", "alone_high"], on: false, fill: "rgba(213, 94, 0, 0.2)" },
    { name: "your parameters", keys: ["yours"], on: false },
  ];
  const look = {
    measured: { stroke: "#222222", paths: () => null, points: { show: true, size: 5, fill: "#222222" } },
    median: { stroke: "#0072b2", width: 2 }, alone: { stroke: "#d55e00", width: 2 }, yours: { stroke: "#009e73", width: 2, dash: [6, 4] },
  };
  const keys = parts.flatMap(part => part.keys), values = data.parameters.map(parameter => parameter.value);
  let view = data.views[0], plot = null;

  const element = (name, attributes, parent) => {
    const made = Object.assign(document.createElement(name), attributes);
    parent.append(made);
    return made;
  };
  const number = value => value == null ? "–" : String(Number(value.toPrecision(3)));
  const row = element("div", { className: "chart-row" }, holder);
  const choice = (label, names, change) => {
    if (new Set(names).size < 2) return null;
    const select = element("select", {}, element("label", { textContent: label + " " }, row));
    for (const name of new Set(names)) element("option", { textContent: name, value: name }, select);
    select.addEventListener("change", change);
    return select;
  };
  const formulation = choice("discrepancy", data.views.map(item => item.formulation), () => pick());
  const stress = choice("test", data.views.map(item => item.name), () => pick());
  const canvas = element("div", {}, holder);
  const readout = element("p", { className: "chart-readout" }, holder);
  readout.setAttribute("aria-live", "polite");
  const at = element("input", { type: "range", step: "any" }, element("label", { textContent: "along the curve " }, holder));
  at.addEventListener("input", () => show(nearest(Number(at.value)), true));
  const more = element("details", { open: innerWidth > 820 }, holder);
  element("summary", { textContent: "parts and parameters" }, more);
  const switches = element("div", { className: "chart-row" }, more);
  for (const part of parts) {
    const label = element("label", {}, switches), box = element("input", { type: "checkbox", checked: part.on }, label);
    element("span", { className: "swatch" }, label).style.background = part.fill || look[part.keys[0]].stroke;
    label.append(part.name);
    box.addEventListener("change", () => { part.on = box.checked; draw(); });
    part.box = box;
  }
  const sliders = element("div", { className: "chart-row" }, more);
  data.parameters.forEach((parameter, index) => {
    const label = element("label", {}, sliders), name = element("span", {}, label);
    const write = () => { name.textContent = `${parameter.name} ${number(values[index])} ${data.unit} `; };
    const slider = element("input", { type: "range", min: parameter.low, max: parameter.high, step: "any", value: parameter.value }, label);
    slider.addEventListener("input", () => {
      values[index] = Number(slider.value);
      const part = parts.find(item => item.keys.includes("yours"));
      part.on = part.box.checked = true;
      write();
      draw();
    });
    write();
  });

  const columns = () => {
    const yours = view.x.map((_, point) => view.basis.reduce((sum, column, index) => sum + column[point] * values[index], 0));
    return [view.x, ...keys.map(key => key === "yours" ? yours : view[key])];
  };
  const nearest = x => view.x.reduce((best, value, index) => Math.abs(value - x) < Math.abs(view.x[best] - x) ? index : best, 0);
  const show = (place, moves) => {
    if (place == null) return;
    const measuredThere = view.x.findIndex((value, other) => value === view.x[place] && view.measured[other] != null);
    const index = measuredThere < 0 ? place : measuredThere;
    if (moves) plot.setCursor({ left: plot.valToPos(view.x[index], "x"), top: 0 }, false);
    else at.value = view.x[index];
    const measured = view.measured[index] == null ? "" : `measured ${number(view.measured[index])}, `;
    readout.textContent = `${view.control} ${number(view.x[index])}: ${measured}predicted ${number(view.median[index])}, ` +
      `95 % of measurements ${number(view.low[index])} to ${number(view.high[index])}, material alone ${number(view.alone[index])} ${data.unit}`;
  };
  const pick = () => {
    const fits = item => (!formulation || item.formulation === formulation.value) && (!stress || item.name === stress.value);
    const other = item => !formulation || item.formulation === formulation.value;
    view = data.views.find(fits) || data.views.find(other);
    if (stress) stress.value = view.name;
    draw();
  };
  const draw = () => {
    const shown = key => parts.find(part => part.keys.includes(key)).on, width = canvas.clientWidth;
    const position = key => keys.indexOf(key) + 1;
    if (plot) plot.destroy();
    plot = new uPlot({
      width, height: Math.round(Math.min(380, Math.max(240, 0.62 * width))), legend: { show: false },
      pxAlign: 0, cursor: { drag: { x: true, y: true } }, scales: { x: { time: false } },
      axes: [{ label: view.control }, { label: `engineering stress [${data.unit}]`, size: 62 }],
      series: [{}, ...keys.map(key => ({ show: shown(key), spanGaps: true, points: { show: false }, stroke: "transparent", ...look[key] }))],
      bands: parts.filter(part => part.fill).map(part => ({ series: [position(part.keys[1]), position(part.keys[0])], fill: part.fill })),
      hooks: { setCursor: [chart => show(chart.cursor.idx, false)] },
    }, columns(), canvas);
    at.min = view.x[0];
    at.max = view.x[view.x.length - 1];
    show(view.x.length - 1, false);
  };
  holder.hidden = false;
  still.classList.add("print-only");
  draw();
  addEventListener("resize", () => draw());
})();
