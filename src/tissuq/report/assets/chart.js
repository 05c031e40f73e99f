"use strict";
// Draws the chart of a page from the JSON beside it. Predict at a stretch by dragging the mark, by typing, or by the
// arrow keys of the slider; hover to read values; drag over the curve or press the buttons to zoom; switch tests,
// formulations and parts; move the material's parameters against the data. The curve of other parameters is that of the
// material alone: a linear combination of columns, which are interpolated between the nodes of an exponent.
(() => {
  const holder = document.getElementById("chart"), data = JSON.parse(document.getElementById("chart-data").textContent);
  const still = holder.parentElement.querySelector(".still");
  const parts = [
    { name: "measured", keys: ["measured"], on: true },
    { name: "measured, unloading (hollow)", keys: ["unloading"], on: true },
    { name: "material + discrepancy + noise", keys: ["low", "high"], on: true, fill: "rgba(0, 114, 178, 0.16)" },
    { name: "material + discrepancy", keys: ["stress_low", "stress_high", "median"], on: true, fill: "rgba(0, 114, 178, 0.34)" },
    { name: "material alone", keys: ["alone_low", "alone_high", "alone"], on: true, fill: "rgba(213, 94, 0, 0.16)" },
    { name: "discrepancy alone", keys: ["discrepancy"], on: false },
    { name: "your parameters", keys: ["yours"], on: false },
  ];
  const lines = {
    measured: { stroke: "#222222" }, unloading: { stroke: "#222222" }, median: { stroke: "#0072b2", width: 2 }, alone: { stroke: "#b84f00", width: 2 },
    discrepancy: { stroke: "#8a3d74", width: 2, dash: [2, 3] }, yours: { stroke: "#007a59", width: 2, dash: [6, 4] },
  };
  const keys = parts.flatMap(part => part.keys), values = data.parameters.map(parameter => parameter.value);
  let view = data.views[0], test = data.tests[view.test], rows = [], plot = null, spot = null, zoomed = null;

  const element = (name, attributes, parent) => {
    const made = Object.assign(document.createElement(name), attributes);
    parent.append(made);
    return made;
  };
  // As text elsewhere: an exponent below 0.0001, where leading zeros cannot be counted.
  const plain = value => (value && Math.abs(value) < 1e-4 ? value.toExponential() : String(value)).replace(/e([+-])(\d)$/, "e$10$2");
  const rounded = (value, digits) => value == null || !Number.isFinite(value) ? "–" : plain(Number(value.toPrecision(digits)));
  const number = value => rounded(value, 3);
  const stretch = value => rounded(value, 5); // of a stiff tissue hardly other than one
  const isMeasured = key => key === "measured" || key === "unloading";
  const isOn = key => parts.some(part => part.on && part.keys.includes(key));

  // A column of the view at any place of its abscissa: linear between its points.
  const at = (column, x) => {
    const xs = test.x, last = xs.length - 1;
    if (!column || x < xs[0] || x > xs[last]) return null;
    let low = 0, high = last;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (xs[middle] <= x) low = middle; else high = middle;
    }
    const share = xs[high] > xs[low] ? (x - xs[low]) / (xs[high] - xs[low]) : 0;
    return column[low] == null || column[high] == null ? null : (1 - share) * column[low] + share * column[high];
  };

  // Weights of the nodes of the exponent, or of its logarithm, for its value: barycentric, for Chebyshev nodes of the second kind.
  const nodeWeights = () => {
    const nodes = data.nodes, last = values[values.length - 1], value = data.is_logarithm ? Math.log(last) : last, hit = nodes.indexOf(value);
    if (!nodes.length) return [1];
    if (hit >= 0) return nodes.map((_, index) => Number(index === hit));
    const terms = nodes.map((node, index) => (index % 2 ? -1 : 1) * (index % (nodes.length - 1) ? 1 : 0.5) / (value - node));
    const sum = terms.reduce((total, term) => total + term);
    return terms.map(term => term / sum);
  };
  const yours = () => {
    const weights = nodeWeights();
    return test.x.map((_, point) => test.basis.reduce(
      (sum, columns, node) => sum + weights[node] * columns.reduce((total, column, index) => total + column[point] * values[index], 0), 0));
  };
  const column = key => {
    if (key === "yours") return yours();
    if (key === "discrepancy") return view.alone && view.median.map((value, point) => value - view.alone[point]);
    return view[key];
  };
  // Every measurement has a row of its own between the points of the bands.
  const columns = () => {
    const many = keys.filter(key => !isMeasured(key)).map(key => [key, column(key)]), of = Object.fromEntries(many);
    return [rows.map(row => row.x), ...keys.map(key => rows.map(row =>
      isMeasured(key) ? (row.measured != null && row.isBack === (key === "unloading") ? row.measured : null) : row.point == null ? at(of[key], row.x) : of[key] ? of[key][row.point] : null))];
  };
  const arrange = () => {
    rows = test.x.map((x, point) => ({ x, point, measured: null, isBack: false }));
    if (test.is_curve) {
      rows.push(...test.measured_at.map((x, index) => ({ x, point: null, measured: test.measured[index], isBack: test.is_back[index] })));
      rows.sort((a, b) => a.x - b.x);
    } else test.measured.forEach((value, index) => { rows[index].measured = value; });
  };

  const top = element("div", { className: "chart-row" }, holder);
  const choice = (label, options, change) => {
    if (options.length < 2) return null;
    const select = element("select", {}, element("label", { textContent: label + " " }, top));
    for (const [value, name] of options) element("option", { textContent: name, value }, select);
    select.addEventListener("change", change);
    return select;
  };
  const names = [...new Set(data.views.map(item => item.formulation))];
  const formulation = choice("discrepancy", names.map(name => [name, name]), () => pick());
  const stress = choice("test", data.tests.map((item, index) => [index, item.name]), () => pick());
  const canvas = element("div", { className: "chart-canvas" }, holder);
  canvas.setAttribute("role", "img");
  const hover = element("p", { className: "chart-hover soft" }, holder);
  hover.setAttribute("aria-hidden", "true");
  const where = element("div", { className: "chart-row" }, holder);
  element("span", { className: "chart-dashes", title: "drag the dashed line" }, where);
  const label = element("label", { textContent: "" }, where), words = element("span", {}, label);
  const typed = element("input", { type: "number", step: "any" }, label);
  const slid = element("input", { type: "range" }, where);
  const readout = element("p", { className: "chart-readout", role: "status" }, holder);
  readout.setAttribute("aria-live", "polite");
  const buttons = element("span", { className: "chart-buttons" }, where);
  const button = (text, title, action) => {
    const made = element("button", { type: "button", textContent: text, title }, buttons);
    made.setAttribute("aria-label", title);
    made.addEventListener("click", action);
  };
  button("+", "zoom in around the mark", () => zoom(0.5));
  button("−", "zoom out", () => zoom(2));
  button("all", "show the whole curve", () => look(null));

  const group = (name, parent) => {
    const set = element("fieldset", { className: "chart-row" }, parent);
    element("legend", { textContent: name }, set);
    return set;
  };
  const switches = group("shown, lines with their 95 % bands", holder);
  for (const part of parts) {
    const label = element("label", {}, switches), line = part.keys.find(key => lines[key]);
    part.box = element("input", { type: "checkbox", checked: part.on }, label);
    element("span", { className: "swatch" }, label).style.background = line ? lines[line].stroke : part.fill;
    label.append(part.name);
    part.box.addEventListener("change", () => { part.on = part.box.checked; refresh(); });
  }
  const more = element("details", { open: innerWidth > 820 }, holder);
  element("summary", { textContent: "parameters" }, more);
  const sliders = group("your parameters of the material alone", more);
  const write = data.parameters.map((parameter, index) => {
    const label = element("label", {}, sliders), name = element("span", {}, label);
    const step = (parameter.high - parameter.low) / 200 || "any";
    const slider = element("input", { type: "range", min: parameter.low, max: parameter.high, step, value: parameter.value }, label);
    const show = () => {
      name.textContent = `${parameter.name} ${number(values[index])} ${parameter.unit} `;
      slider.setAttribute("aria-valuetext", `${number(values[index])} ${parameter.unit}`);
    };
    slider.addEventListener("input", () => { values[index] = Number(slider.value); mine(true); show(); refresh(); });
    show();
    return () => { values[index] = slider.value = parameter.value; show(); };
  });
  const mine = on => {
    const part = parts.find(item => item.keys.includes("yours"));
    part.on = part.box.checked = on;
  };
  const back = element("button", { type: "button", textContent: "back to the fit" }, sliders);
  back.addEventListener("click", () => { write.forEach(reset => reset()); mine(false); refresh(); });
  if (data.fixed.length) element("p", { className: "soft", textContent: `At their medians: ${data.fixed.join(", ")}.` }, sliders);

  const range = () => [test.x[0], test.x[test.x.length - 1]];
  // The measurements beside a stretch: loading and unloading, and the ends of several.
  const measuredAt = (x, reach) => {
    const near = isBack => test.measured.filter((_, index) => Math.abs(test.measured_at[index] - x) <= reach && test.is_back[index] === isBack);
    const ends = values => [...new Set([Math.min(...values), Math.max(...values)].map(number))].join(" to ");
    const branches = [[near(false), test.is_back.includes(true) ? " (loading)" : ""], [near(true), " (unloading)"]];
    const texts = branches.filter(([values]) => values.length).map(([values, branch]) => ends(values) + branch);
    return texts.length ? `measured ${texts.join(" and ")}, ` : "";
  };
  const sentence = x => {
    const [low, high] = range(), value = key => number(at(column(key), x));
    return `${test.control} ${stretch(x)}, in ${data.unit}: ` + measuredAt(x, (high - low) / 200) +
      `predicted ${value("median")}, 95 % of measurements ${value("low")} to ${value("high")}, ` +
      `95 % of the stress ${value("stress_low")} to ${value("stress_high")}` +
      (view.alone ? `, material alone ${value("alone")}` : "") + (isOn("yours") ? `, yours ${value("yours")}` : "");
  };
  const move = (x, source) => {
    const [low, high] = range();
    if (!Number.isFinite(x)) return;
    if (x < low || x > high) {
      readout.textContent = `${stretch(x)} is beyond ${stretch(low)} to ${stretch(high)}, the strains that were measured: ` +
        "tissuq predict goes further, and says how much of it is extrapolated.";
      return;
    }
    spot = x;
    if (source !== typed) typed.value = stretch(x);
    if (source !== slid) slid.value = x;
    slid.setAttribute("aria-valuetext", stretch(x));
    readout.textContent = sentence(x);
    place();
  };
  typed.addEventListener("input", () => move(typed.valueAsNumber, typed));
  slid.addEventListener("input", () => move(Number(slid.value), slid));

  const mark = document.createElement("div");
  mark.className = "chart-mark";
  const place = () => {
    if (!plot) return;
    const left = plot.valToPos(spot, "x");
    mark.hidden = left < 0 || left > plot.over.clientWidth;
    mark.style.left = `${left}px`;
  };
  const along = event => plot.posToVal(event.clientX - plot.over.getBoundingClientRect().left, "x");
  const inRange = x => Math.min(Math.max(x, range()[0]), range()[1]);
  mark.addEventListener("pointerdown", event => { mark.setPointerCapture(event.pointerId); event.stopPropagation(); event.preventDefault(); });
  mark.addEventListener("mousedown", event => event.stopPropagation());
  mark.addEventListener("pointermove", event => { if (mark.hasPointerCapture(event.pointerId)) move(inRange(along(event)), mark); });

  const look = part => { zoomed = part; plot.setData(plot.data); };
  const zoom = factor => {
    const { x, y } = plot.scales, [low, high] = range(), height = at(view.median, spot);
    const around = (middle, { min, max }) => [middle - factor * (max - min) / 2, middle + factor * (max - min) / 2];
    const [left, right] = around(spot, x);
    look(right - left >= high - low ? null : { x: [Math.max(low, left), Math.min(high, right)], y: around(height, y) });
  };
  const selected = chart => {
    const { left, top, width, height } = chart.select;
    if (width > 5 && height > 5) look({
      x: [left, left + width].map(pixel => chart.posToVal(pixel, "x")), y: [top + height, top].map(pixel => chart.posToVal(pixel, "y")),
    });
    chart.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
  };
  const of = item => !formulation || item.formulation === formulation.value;
  // Modes of which a discrepancy says nothing cannot be chosen beside it.
  const restrict = () => {
    const known = new Set(data.views.filter(of).map(item => item.test));
    for (const option of stress ? stress.options : []) option.disabled = !known.has(Number(option.value));
  };
  const pick = () => {
    restrict();
    view = data.views.find(item => of(item) && (!stress || item.test === Number(stress.value))) || data.views.find(of);
    test = data.tests[view.test];
    if (stress) stress.value = view.test;
    spot = zoomed = null;
    draw();
  };
  // The axis holds measurements and their medians, and of bands, other parameters and predicted modes what is near.
  const limits = () => {
    let [low, high] = view.limits;
    const reach = high - low, other = isOn("yours") ? yours().filter(Number.isFinite) : [];
    if (isOn("discrepancy") && view.alone) other.push(...column("discrepancy"));
    return [Math.min(low, Math.max(low - reach, Math.min(...other, low))), Math.max(high, Math.min(high + reach, Math.max(...other, high)))];
  };
  const series = key => {
    const asPoints = isMeasured(key) || !test.is_curve, stroke = (lines[key] || { stroke: "#0072b2" }).stroke;
    return {
      show: isOn(key), spanGaps: true, stroke: "transparent", ...lines[key], paths: asPoints ? () => null : undefined,
      points: asPoints ? { show: true, size: isMeasured(key) ? 5 : 4, fill: key === "unloading" ? "#ffffff" : stroke } : { show: false },
    };
  };
  const refresh = () => {
    keys.forEach((key, index) => plot.setSeries(index + 1, { show: isOn(key) }));
    plot.setData(columns());
    readout.textContent = sentence(spot);
  };
  // The width of an axis: that of its longest number, so that its label stands beside it.
  const room = (chart, texts, index) => {
    const axis = chart.axes[index];
    chart.ctx.save();
    chart.ctx.font = axis.font[0];
    const longest = Math.max(0, ...(texts || []).map(text => chart.ctx.measureText(text).width));
    chart.ctx.restore();
    return Math.max(48, Math.ceil(axis.ticks.size + axis.gap + 8 + longest / devicePixelRatio));
  };
  const draw = () => {
    const width = canvas.clientWidth, position = key => keys.indexOf(key) + 1, [low, high] = range();
    if (plot) plot.destroy();
    arrange();
    for (const part of parts) part.box.parentElement.hidden = !view.alone && (part.keys.includes("alone") || part.keys.includes("discrepancy")) ||
      part.keys.includes("unloading") && !test.is_back.includes(true);
    plot = new uPlot({
      width, height: Math.round(Math.min(360, Math.max(220, 0.6 * width))), legend: { show: false },
      pxAlign: 0, cursor: { drag: { x: true, y: true, uni: 20, setScale: false }, bind: { dblclick: () => () => look(null) } },
      scales: { x: { time: false, range: () => zoomed ? zoomed.x : range() }, y: { range: () => zoomed ? zoomed.y : limits() } },
      axes: [{ label: test.control, labelSize: 22, size: 34 }, { label: `engineering stress [${data.unit}]`, labelSize: 22, size: room, values: (_, places) => places.map(place => plain(Number(place.toPrecision(6)))) }],
      series: [{}, ...keys.map(series)],
      bands: parts.filter(part => part.fill && test.is_curve).map(part => ({ series: [position(part.keys[1]), position(part.keys[0])], fill: part.fill })),
      hooks: {
        setCursor: [chart => { hover.textContent = chart.cursor.left >= 0 ? sentence(inRange(chart.posToVal(chart.cursor.left, "x"))) : ""; }],
        draw: [() => place()], setSelect: [selected],
      },
    }, columns(), canvas);
    plot.over.append(mark);
    canvas.setAttribute("aria-label", `Chart of stress over ${test.control}, ${test.name}: measurements and 95 % bands; the numbers follow below.`);
    words.textContent = `predict at ${test.control} `;
    Object.assign(typed, { min: low, max: high });
    Object.assign(slid, { min: low, max: high, step: (high - low) / 200 });
    slid.setAttribute("aria-label", `${test.control} at which to predict`);
    move(spot == null || spot < low || spot > high ? high : spot, null);
  };
  holder.hidden = false;
  still.classList.add("print-only");
  restrict();
  draw();
  addEventListener("resize", () => draw());
})();
