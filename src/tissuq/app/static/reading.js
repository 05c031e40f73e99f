// How the files are read: the questions that they leave, and a form for everything that can be said.
import { button, byId, fill, make, options, repeatOf } from "./dom.js";
import { curveOf } from "./curve.js";

const DEFORMATIONS = ["stretch", "strain", "displacement", "length", "shear", "sliding", "twist", "outer_diameter", "inner_diameter"];
const LOADS = ["stress", "force", "total_force", "torque"];
const RIVALS = [DEFORMATIONS, LOADS, ["stress", "torque", "pressure"]]; // a tube has a pressure and a force
const ROLES = [...DEFORMATIONS, "axial_stretch", ...LOADS, "pressure", "sd", "sem", "n"];
const STRESSES = ["kPa", "MPa", "Pa", "N/cm2", "mmHg", "psi"], FORCES = ["N", "mN", "uN", "kN", "g", "gf"], LENGTHS = ["mm", "um", "cm", "m"];
const FIELDS = [
  ["What the columns hold", [
    ["stress_unit", "Unit of stress", STRESSES], ["force_unit", "Unit of force", FORCES], ["displacement_unit", "Unit of displacement", LENGTHS],
    ["strain_unit", "Unit of strain", ["%", "1"]],
    ["stress_type", "Kind of stress", ["engineering", "cauchy", "second-piola-kirchhoff", "torsion"]],
    ["strain_type", "Kind of strain", ["engineering", "true", "green", "almansi", "angle"]],
    ["compression_positive", "Compression is", [["true", "positive"], ["false", "negative"]]],
    ["turn", "Change the sign of", ["load", "deformation", "both"]]]],
  ["The specimen, undeformed", [
    ["dimensions.length", "Length", "20 mm"], ["dimensions.area", "Cross-section", "10 mm2"], ["dimensions.width", "Width", "5 mm"],
    ["dimensions.thickness", "Thickness", "2 mm"], ["dimensions.diameter", "Diameter", "8 mm"], ["axial_stretch", "Axial stretch of a tube", "1.5"],
    ["incompressible", "Take its volume as constant", Boolean]]],
  ["Where it begins", [
    ["zero", "Displacement counts from", "first, or 35.2 mm"], ["load_zero", "Load counts from", "first, or 0.02 N"],
    ["preload", "Taut (stretch 1) from", "auto, or 0.05 N"], ["compliance", "Compliance of the machine", "0.5 um/N"]]],
  ["Which rows", [
    ["cycle", "Cycle", "first, last, or 3"], ["branch", "Branch", ["loading", "unloading"]], ["low", "Stretch from", "1"], ["high", "Stretch to", "1.2"],
    ["until_peak", "Leave out what follows the largest stress", Boolean], ["every", "Every ... row", "2"], ["leave_out", "Leave out lines", "31,45:50"],
    ["sheet", "Sheet", "2"], ["table", "Table", "1"], ["skip_rows", "Skip lines at the top", "3"], ["axis", "Axis", ["x", "y"]]]],
];
const NUMBERS = new Set(["every", "table", "skip_rows", "axial_stretch"]);
const numberOf = text => (Number.isNaN(Number(text)) ? text : Number(text)); // what is no number is refused with a message

const valueOf = (reading, name) => {
  if (name === "low" || name === "high") return reading.stretch_range?.[name === "low" ? 0 : 1] ?? "";
  const [whole, part] = name.split(".");
  const value = part ? reading[whole]?.[part] : reading[whole];
  return value == null ? "" : String(value);
};

const changed = (reading, name, text) => {
  const next = structuredClone(reading), [whole, part] = name.split(".");
  if (name === "low" || name === "high") {
    const ends = next.stretch_range ?? [-1e9, 1e9];
    ends[name === "low" ? 0 : 1] = text === "" ? (name === "low" ? -1e9 : 1e9) : numberOf(text);
    next.stretch_range = ends[0] === -1e9 && ends[1] === 1e9 ? null : ends;
  } else if (part) {
    next[whole] = { ...next[whole], [part]: text };
    if (text === "") delete next[whole][part];
  } else if (text === "" || text === false) delete next[whole];
  else if (name === "compression_positive") next[whole] = text === "true";
  else next[whole] = NUMBERS.has(name) ? numberOf(text) : text;
  return next;
};

const fieldOf = ([name, words, kind], reading, change) => {
  const label = make("label", { className: kind === Boolean ? "check" : "" });
  let input;
  if (kind === Boolean) {
    input = make("input", { type: "checkbox", checked: Boolean(reading[name]) });
    label.append(input, ` ${words}`);
  } else if (Array.isArray(kind)) {
    input = options(make("select"), kind.map(item => Array.isArray(item) ? { value: item[0], textContent: item[1] } : item), "as the file says");
    label.append(words, input);
    if (valueOf(reading, name) && ![...input.options].some(option => option.value === valueOf(reading, name))) input.append(make("option", { textContent: valueOf(reading, name) }));
  } else {
    input = make("input", { placeholder: kind });
    label.append(words, input);
  }
  input.name = name;
  if (kind !== Boolean) input.value = Math.abs(valueOf(reading, name)) === 1e9 ? "" : valueOf(reading, name);
  input.addEventListener("change", () => change(now => changed(now, name, kind === Boolean ? input.checked : input.value.trim())));
  return label;
};

const columnsOf = (found, reading, change) => {
  const file = found.error?.file ?? found.tests[0]?.file, columns = found.tables[file]?.[0]?.columns ?? [];
  const isHere = ([, name]) => columns.some(column => column.name === String(name)), said = Object.entries(reading.columns ?? {}).flatMap(([role, names]) => [names].flat().map(name => [role, name])); // of several files a role may have several
  const seen = found.tests.find(test => test.file === file)?.roles ?? Object.fromEntries(said.filter(isHere).map(([role, name]) => [String(name), role]));
  const roles = { ...seen };
  const choose = (name, role) => {
    const kinds = [role, ...RIVALS.filter(group => group.includes(role)).flat()];
    for (const other of Object.keys(roles)) if (other !== name && kinds.includes(roles[other])) delete roles[other];
    if (role) roles[name] = role; else delete roles[name];
    const columns = {};
    for (const [of, column] of [...said.filter(item => !isHere(item)), ...Object.entries(roles).map(item => item.toReversed())]) columns[of] = [...columns[of] ?? [], column];
    change(now => ({ ...now, columns }));
  };
  return make("fieldset", {}, make("legend", { textContent: "Columns" }), make("div", { className: "columns" }, ...columns.map(column => {
    const select = options(make("select", { name: `column ${column.name}` }), [...new Set([...ROLES, ...Object.values(roles)])].map(role => ({ value: role, textContent: role.replace("_", " ") })), "not read");
    select.value = roles[column.name] ?? "";
    select.addEventListener("change", () => choose(column.name, select.value));
    return make("label", { textContent: column.name + (column.unit ? ` [${column.unit}]` : "") + " " }, select);
  })));
};

const questionOf = (question, answer) => {
  const rows = question.answers.map(item => {
    if (!item.asked_for.length) return make("li", {}, button(item.label, () => answer(question, item.settings)), item.gives ? make("span", { className: "soft", textContent: item.gives }) : null);
    const inputs = item.asked_for.map(name => make("input", { name, size: 8, placeholder: { area: "10 mm2", "axial-stretch": "1.5" }[name] ?? "10 mm", aria: { label: name } }));
    const use = () => {
      const { "axial-stretch": held, ...sizes } = Object.fromEntries(inputs.map(input => [input.name, input.value.trim()]));
      const of_stretch = held === undefined ? {} : { axial_stretch: numberOf(held) };
      answer(question, { ...item.settings, ...of_stretch, ...(Object.keys(sizes).length ? { dimensions: { ...item.settings.dimensions, ...sizes } } : {}) });
    };
    return make("li", {}, ...inputs.flatMap(input => [`${input.name} `, input, " "]), button("Use", use));
  });
  const folded = rows.slice(question.shown);
  return make("div", { className: "question" }, make("p", { textContent: question.plain }), make("ul", { className: "answers" }, ...rows.slice(0, question.shown)),
    folded.length ? make("details", {}, make("summary", { textContent: question.shown === 1 ? "Another one" : "More answers" }), make("ul", { className: "answers" }, ...folded)) : null);
};

// Shows what was understood. change(update) reads again, with what update makes of the settings; answer(question, settings) takes an answer; leave(question) settles it.
export const showFound = (found, reading, settled, { change, answer, leave }) => {
  const refusal = found.error;
  fill(byId("refusal"), refusal ? questionOf(refusal, answer) : null);
  if (refusal) {
    const table = found.tables[refusal.file]?.[0];
    if (!refusal.answers.length) byId("refusal").firstChild.append(make("p", { className: "soft", textContent: table
      ? "Mend it below, under “Change how the files are read”, or remove the file."
      : `Remove ${refusal.file}, or save it anew as a table with a line of names above columns of numbers, and drop it again.` }));
    if (table) byId("refusal").firstChild.append(make("p", { className: "soft", textContent: "The table in the file:" }),
      make("pre", { tabIndex: 0, textContent: [table.columns.map(column => column.name + (column.unit ? ` [${column.unit}]` : "")).join("  |  "), ...table.rows].join("\n") }));
    if (!refusal.answers.length && table) byId("mend").open = true;
  }
  fill(byId("questions"), ...found.questions.filter(question => !settled.has(question.text)).map(question => {
    const shown = questionOf(question, answer);
    shown.append(make("p", {}, button("Leave it as it is", () => leave(question), { className: "small" })));
    return shown;
  }));
  fill(byId("tests"), ...found.tests.map(test => make("div", { className: "test" },
    make("h3", { textContent: `${test.name}: ${test.mode}${test.is_mode_assumed ? " (assumed)" : ""}, ${test.rows} of ${test.all_rows} rows, ${test.control} ${test.range.map(end => end.toPrecision(4)).join(" to ")}` }),
    ...test.curves.map(curve => curveOf(curve, test.name, (low, high) => change(now => ({ ...now, stretch_range: [low, high].map(end => Number(end.toPrecision(4))) })))))));
  if (found.tests.length) byId("tests").append(make("p", { className: "soft" }, "Drag over a curve to use only that range of stretches. ",
    reading.stretch_range ? button("Use all stretches", () => change(now => ({ ...now, stretch_range: null })), { className: "small" }) : null));
  const isAsked = text => found.questions.some(question => question.text === text && !settled.has(text));
  fill(byId("findings"), ...found.findings.filter(item => !isAsked(item.text)).map(item => make("div", { className: "warning" }, make("span", { textContent: item.plain }),
    ...item.answers.flatMap(proposal => [" ", button(proposal.label, () => change(now => ({ ...now, ...proposal.settings })), { className: "small" })]))));
  const typing = byId("reading").contains(document.activeElement) ? document.activeElement : null;
  fill(byId("reading"), columnsOf(found, reading, change), ...FIELDS.map(([title, fields]) => make("fieldset", {}, make("legend", { textContent: title }),
    make("div", { className: "grid" }, ...fields.map(field => fieldOf(field, reading, change))))),
    make("p", {}, button("As the files say", () => change(() => ({})))));
  const again = typing?.name ? byId("reading").elements[typing.name] : null;
  if (again) {
    if (typing.type === "text") again.value = typing.value;
    again.focus({ preventScroll: true });
  }
  byId("account").hidden = !found.text;
  byId("account-text").textContent = found.text;
  fill(byId("inspect-repeat"), found.repeat && found.text ? repeatOf(found.repeat) : null);
};
